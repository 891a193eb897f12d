"""How depth is stored: whole steps in 16 bits reach 6.5 m."""

DEPTH_UNIT = 1e-4  # metres
