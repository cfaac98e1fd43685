"""wive's Warp kernels on a GPU: the same bits as the core, their speed, and other libraries' streams."""
