"""The traversal loop, its visit of a node and its test of a leaf."""
