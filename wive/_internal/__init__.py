"""Internals of wive: not for import by others, and free to change."""
