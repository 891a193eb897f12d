"""Shared by every test: shape hints are checked at run time, torch keeps to two threads, judges are found.

The import hook must be in place before any of our packages is imported, so it stands above everything else.
"""

from jaxtyping import install_import_hook

hook = install_import_hook(["avatargen", "assets", "exporters"], "beartype.beartype")

import os  # noqa: E402 (the hook comes first)
import shutil  # noqa: E402
from pathlib import Path  # noqa: E402

import pytest  # noqa: E402
import torch  # noqa: E402

torch.set_num_threads(2)

PROJECT = Path(__file__).parents[1]
JUDGES = PROJECT / "tests" / "judges"


def missing(judge: str) -> None:
    """Skip for want of a judge; where CI is set a missing judge is a failure."""
    reason = f"{judge} is not installed; run `make judges`"
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def khronos() -> list[str]:
    """The command that, given a .glb, prints Khronos' verdict as JSON."""
    node = shutil.which("node") or shutil.which("node", path=PROJECT / ".venv" / "bin")
    if node is None or not (JUDGES / "node_modules" / "gltf-validator").is_dir():
        missing("Khronos' gltf-validator")
    return [str(node), str(JUDGES / "khronos.cjs")]


@pytest.fixture(scope="session")
def blender() -> list[str]:
    """The command that, given a GLB, poses and a folder, imports and poses it in Blender."""
    python = PROJECT / ".venv-blender" / "bin" / "python"
    if not python.exists():
        missing("Blender (bpy in .venv-blender)")
    return [str(python), str(JUDGES / "blender_check.py")]
