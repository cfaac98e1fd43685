"""Functions for users' own kernels, and their gradients."""
