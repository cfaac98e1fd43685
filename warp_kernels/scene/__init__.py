"""Backend "warp" of wive.Scene: queries, results computed on the device, pictures."""
