"""Kernels over batches of rays, and their launches."""
