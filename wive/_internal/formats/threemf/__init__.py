"""3MF: reader of packages, model parts."""
