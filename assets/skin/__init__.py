"""Joint weights of a surface, and the surface in its rest pose."""
