"""glTF 2.0: reader, document with its buffers, accessors, nodes, pose, Draco."""
