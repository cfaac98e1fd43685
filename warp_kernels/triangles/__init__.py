"""The triangle tests of each accuracy."""
