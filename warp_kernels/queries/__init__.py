"""A ray made ready for traversal, and what each query keeps of the hits it finds."""
