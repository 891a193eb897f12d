"""What is wrong with a .vrm file beyond its glTF: VRM 1.0's own rules on bones, pose and permissions."""

import json
from pathlib import Path
from typing import Any

from exporters.vrm import LICENCE_URL, REQUIRED_BONES

NOT_VRM = "the file is no VRM 1.0; it is damaged, cut short or of another kind"


def check_vrm(path: str | Path) -> list[str]:
    """Every finding about the file, none if it is sound. Never raises for what a file holds."""
    try:
        document = read_document(Path(path).read_bytes())
        found = document["extensions"]["VRMC_vrm"]
        return [*meta_findings(found["meta"]), *bone_findings(found["humanoid"]["humanBones"], document)]
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, RecursionError):
        return [NOT_VRM]


def read_document(data: bytes) -> Any:
    """A .glb's JSON. Raises ValueError where there is none."""
    if data[:4] != b"glTF" or data[16:20] != b"JSON":
        raise ValueError
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


def meta_findings(meta: dict[str, Any]) -> list[str]:
    """A name, an author and the licence that VRM 1.0 names."""
    findings = []
    if not meta.get("name"):
        findings.append("meta: the model has no name")
    if not meta.get("authors"):
        findings.append("meta: the model has no author")
    if meta.get("licenseUrl") != LICENCE_URL:
        findings.append(f"meta: licenseUrl is {meta.get('licenseUrl')!r}; VRM 1.0 wants {LICENCE_URL}")
    return findings


def bone_findings(bones: dict[str, Any], document: dict[str, Any]) -> list[str]:
    """The bones that VRM requires, each a node of its own, of the size it has."""
    findings = [f"humanoid: the bone {bone} is missing" for bone in REQUIRED_BONES if bone not in bones]
    nodes = [bone["node"] for bone in bones.values()]
    if len(set(nodes)) < len(nodes):
        findings.append("humanoid: two bones are the same node")
    for name, node in zip(bones, nodes, strict=True):
        if not 0 <= node < len(document["nodes"]):
            findings.append(f"humanoid: the bone {name} is node {node}, which is not there")
        elif min(document["nodes"][node].get("scale", [1.0])) <= 0:
            findings.append(f"humanoid: the bone {name} is scaled by 0 or less")
    return findings
