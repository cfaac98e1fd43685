"""The Warp backend's room: the same traversal as NVIDIA Warp kernels. Empty in this version."""
