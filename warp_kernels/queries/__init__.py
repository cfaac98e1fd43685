"""A ray as a traversal uses it, and what each query keeps of the hits it finds."""
