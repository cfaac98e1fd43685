"""COLLADA: reader, tree of elements, geometries."""
