"""The traversal loop and its slab test."""
