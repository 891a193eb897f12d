"""Faces that move: cut open at lips and lids, with a mouth inside, and their shapes."""
