"""What `wive.render` is made of: light, sampling, shadings, viewpoints, and picture files."""
