"""Closed triangle meshes: what they are, cleaning them, and how far they are from a field."""
