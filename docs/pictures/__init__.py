"""Drawings of the documentation, one per module; `python docs/picture.py` writes all of them to docs/images."""
