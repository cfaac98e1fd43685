"""Measurements of wive, one module per table or figure: `python -m bench NAME`."""
