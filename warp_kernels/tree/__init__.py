"""The tree on a device: layout, node and block forms, upload."""
