"""Fewer triangles, laid where the field is."""
