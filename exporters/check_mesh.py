"""What is wrong with an .obj, .ply or .stl file: read back, it must be a closed surface of numbers."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np

from assets.mesh.surface import Surface, find_defects
from exporters import read_mesh

SECONDS = 120


def check_mesh(path: str | Path) -> list[str]:
    """Every finding about the file, none if it is sound. Never raises for what a file holds."""
    command = [sys.executable, "-P", str(read_mesh.__file__), str(path)]
    try:
        run = subprocess.run(command, capture_output=True, timeout=SECONDS, check=True)
    except subprocess.SubprocessError:
        return ["the file cannot be read as a mesh; it is damaged, cut short or of another kind"]
    with np.load(io.BytesIO(run.stdout)) as arrays:
        vertices, faces = arrays["vertices"], arrays["faces"]
    if len(faces) == 0:
        return ["the mesh has no faces"]
    if faces.min() < 0 or faces.max() >= len(vertices):
        return [f"faces name vertices up to {faces.max()}, but there are {len(vertices)}"]
    if not np.isfinite(vertices).all():
        return ["vertices hold NaN or infinity"]
    # vertices may be split at seams, which are no holes, or meet at one place and yet be apart
    places, number = np.unique(vertices, axis=0, return_inverse=True)
    whole, joined = Surface(vertices=vertices, faces=faces), Surface(vertices=places, faces=number[faces])
    defects = min((find_defects(whole), find_defects(joined)), key=lambda defects: defects.bad_edges)
    findings = []
    if defects.bad_edges:
        findings.append(f"the surface is open, or folded onto itself, at {defects.bad_edges} edges")
    if defects.inward:
        findings.append("the surface is turned inside out or encloses nothing")
    return findings
