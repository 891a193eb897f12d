"""A wardrobe made in code, laid out as MakeHuman's assets are: a tube around the torso, and, where asked,
skins, an iris and whatever else a person needs.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from avatargen.wardrobe.makehuman.hm08 import Hm08

AROUND, RINGS = 48, 16


def write_tube(folder: Path, hm08: Hm08) -> Path:
    """Put a tube around the torso into the folder, bound to three vertices of the base mesh a vertex."""
    home = folder / "clothes" / "tube"
    home.mkdir(parents=True)
    floor, tall = hm08.rest[:, 1].min(), np.ptp(hm08.rest[:, 1])
    angle = np.arange(AROUND) * 2 * np.pi / AROUND
    heights = floor + tall * np.linspace(0.52, 0.78, RINGS)
    points = np.array([[0.26 * np.sin(a), y, 0.02 + 0.22 * np.cos(a)] for y in heights for a in angle])
    torso = np.flatnonzero(np.abs(hm08.rest[:13380, 0]) < 0.2)
    lines = []
    for point in points:
        near = torso[np.argsort(((hm08.rest[torso] - point) ** 2).sum(axis=1))[:3]]
        offset = 10 * (point - hm08.rest[near].mean(axis=0))
        lines.append(
            " ".join(map(str, near))
            + " 0.33333333 0.33333333 0.33333334 "
            + " ".join(f"{n:.7f}" for n in offset)
        )
    corners = [
        [ring * AROUND + i, ring * AROUND + k, (ring + 1) * AROUND + k, (ring + 1) * AROUND + i]
        for ring in range(RINGS - 1)
        for i, k in zip(range(AROUND), np.roll(range(AROUND), -1), strict=True)
    ]
    obj = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in 10 * points]
    obj += [f"vt {(k % AROUND) / AROUND:.5f} {(k // AROUND) / (RINGS - 1):.5f}" for k in range(len(points))]
    obj += ["f " + " ".join(f"{v + 1}/{v + 1}" for v in quad) for quad in corners]
    (home / "tube.obj").write_text("\n".join(obj))
    text = "basemesh hm08\nname tube\ntag Female\nobj_file tube.obj\nmaterial tube.mhmat\nz_depth 40\n"
    text += "verts 0\n" + "\n".join(lines) + "\ndelete_verts\n4000 - 4010 4020\n"
    (home / "tube.mhclo").write_text(text)
    (home / "tube.mhmat").write_text("name tube\ndiffuseTexture tube.png\n")
    shade = np.tile(np.linspace(60, 200, 64, dtype=np.uint8)[:, None, None], (1, 64, 3))
    Image.fromarray(shade).save(home / "tube.png")
    return folder


def write_skins(folder: Path) -> Path:
    """Put plain skins and one iris into the folder: light and dark, for women and men."""
    skins, eyes = folder / "skins" / "textures", folder / "eyes" / "materials"
    skins.mkdir(parents=True)
    eyes.mkdir(parents=True)
    for tone, shade in (("light", 210), ("dark", 90)):
        for number, sex in enumerate(("female", "male")):
            texture = np.full((64, 64, 3), (shade, shade - 30, shade - 45), np.uint8)
            texture[:, ::2] -= np.uint8(10 * number)
            Image.fromarray(texture).save(skins / f"young_{tone}skinned_{sex}_diffuse.png")
    iris = np.full((64, 64, 4), (230, 230, 230, 255), np.uint8)
    iris[38:52, 12:26] = (30, 60, 120, 255)
    Image.fromarray(iris).save(eyes / "blue_eye.png")
    return folder
