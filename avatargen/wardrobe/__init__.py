"""A procedural wardrobe over the canonical body: endless clothed people as fields, coded by Gaussian
latents.
"""

from pathlib import Path

MARKS = Path(__file__).parent / "marks.npz"
