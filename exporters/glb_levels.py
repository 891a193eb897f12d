"""Levels of detail in glTF: a mesh and a node for each, named by MSFT_lod on the finest level's node.

The levels share every vertex attribute with the finest and have only their own indices. A program that does
not know the extension shows the finest level alone: no scene names the others' nodes.
"""

from dataclasses import replace

import pygltflib as gltf

from assets.asset.asset import PlainAsset
from exporters.binary import Binary

EXTENSION = "MSFT_lod"
FINEST_COVERAGE = 0.2  # share of the screen from which the finest level is shown


def add_levels(document: gltf.GLTF2, asset: PlainAsset, binary: Binary) -> None:
    """Put the asset's coarser levels behind its mesh node, which is the document's last."""
    if not asset.levels:
        return
    finest, node = document.meshes[0], document.nodes[-1]
    ids = []
    for number, faces in enumerate(asset.levels, start=1):
        indices = binary.add_indices(faces, len(asset.vertices))
        primitive = replace(finest.primitives[0], indices=indices)
        name = f"{finest.name}_lod{number}"
        document.meshes.append(
            gltf.Mesh(name=name, primitives=[primitive], weights=finest.weights, extras=finest.extras)
        )
        ids.append(len(document.nodes))
        document.nodes.append(replace(node, name=name, mesh=number))
    node.extensions = {EXTENSION: {"ids": ids}}
    node.extras = {"MSFT_screencoverage": coverages(asset)}
    document.extensionsUsed = sorted({*(document.extensionsUsed or []), EXTENSION})


def coverages(asset: PlainAsset) -> list[float]:
    """For each level the share of the screen from which it is shown: faces for an area stay as many."""
    sizes = [len(asset.faces), *(len(level) for level in asset.levels)]
    return [*(round(FINEST_COVERAGE * size / sizes[0], 6) for size in sizes[:-1]), 0.0]
