"""blender_film.py FILE.glb OUT_FOLDER [--clip walk ...] [--frames 6] [--size 320] [--degrees 60] [--face]

See a clip, of the whole person or of the face alone.

Renders evenly spaced moments of each animation, seen from `degrees` around the person (0: front), and joins
them into OUT_FOLDER/film.png, a row for each clip.
"""

import argparse
from pathlib import Path

import bpy
import numpy as np
from blender_render import join
from blender_scene import FPS, deformed_vertices, import_rigged, look_at, play, prepare_render, render


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("glb")
    parser.add_argument("out", type=Path)
    parser.add_argument("--clip", nargs="+", help="names of animations (default: all)")
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--size", type=int, default=320)
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--degrees", type=float, default=60.0)
    parser.add_argument("--face", action="store_true")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    imported = import_rigged(given.glb)
    prepare_render(given.size, given.samples)
    rows: list[list[Path]] = []
    for clip in given.clip or sorted(action.name for action in bpy.data.actions):
        length = bpy.data.actions[clip].frame_range[1] / FPS
        rows.append([])
        for index, seconds in enumerate(np.linspace(0, length, given.frames, endpoint=False)):
            play(imported, clip, float(seconds))
            vertices = deformed_vertices(imported)
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            centre = np.array([(low[0] + high[0]) / 2, 0.95, (low[2] + high[2]) / 2])
            if given.face:
                centre[1] = high[1] - 0.15
            look_at(centre, height=0.34 if given.face else 2.2, degrees=given.degrees)
            rows[-1].append(given.out / f"{clip}_{index:02d}.png")
            render(str(rows[-1][-1].resolve()))
    join(rows, given.out / "film.png")
    print(given.out / "film.png")


if __name__ == "__main__":
    main()
