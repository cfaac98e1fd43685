"""The figures that benches draw of their results."""
