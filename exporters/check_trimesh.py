"""What trimesh has against an .obj, .ply or .stl file: its own verdicts, in words."""

import json
import subprocess
import sys
from pathlib import Path

from exporters import verdicts_of_trimesh

SECONDS = 120


def check_trimesh(path: str | Path) -> list[str]:
    """Every finding about the file, none if it is sound. Never raises for what a file holds."""
    command = [sys.executable, "-P", str(verdicts_of_trimesh.__file__), str(path)]
    try:
        run = subprocess.run(command, capture_output=True, timeout=SECONDS, check=True)
        found = json.loads(run.stdout.splitlines()[-1])
    except (subprocess.SubprocessError, ValueError, IndexError):
        return ["the file cannot be read as a mesh; it is damaged, cut short or of another kind"]
    if not found["faces"]:
        return ["the mesh has no faces"]
    findings = []
    if not found["is_watertight"]:
        findings.append("the surface is not watertight")
    if not found["is_winding_consistent"]:
        findings.append("neighbouring faces are turned against each other")
    if not findings and not found["is_volume"]:
        findings.append("the surface encloses no volume: it is turned inside out or flat")
    euler = found["euler_number"]
    if not findings and (euler > 2 or euler % 2):
        findings.append(
            f"the Euler number is {euler}: 2 less twice its handles is that of a surface in one piece"
        )
    return findings
