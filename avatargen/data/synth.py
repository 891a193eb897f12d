"""A synthetic data set: many pictures of each wardrobe person, in random poses, light and views.

    OUT/dataset.json          labels, see `avatargen.data.labels`
    OUT/images/00012/03.png   on white         OUT/masks/...   coverage
    OUT/depth/...             distance along the ray in steps of 0.1 mm, 16 bit: for evaluation only
    OUT/people/00012.json     labels of one finished person; a killed run goes on behind these
    OUT/synth.json            the settings; a folder never holds pictures of two

Person i and all that happens to it is a function of (seed, i): any number of processes make the same files.
"""

import dataclasses
import io
import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from avatargen.atomic import write_atomically
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.data.labels import FILE_NAME, Labels, encode_labels, joined, read_labels
from avatargen.errors import InputError
from avatargen.wardrobe.attributes import LATENT_SIZE, People

SETTINGS_FILE = "synth.json"
FORMAT = 1  # raised when the same seed would give other pictures


@dataclass(frozen=True, kw_only=True)
class SynthConfig:
    """What pictures there are. Runs that differ in any of these do not mix."""

    size: int = 128  # pixels a side
    views: int = 8  # pictures of each person, every one in a pose, light and view of its own
    seed: int = 0
    cell: float = 0.018  # metres; fineness of the people: a pixel of 128
    format: int = FORMAT

    def __post_init__(self) -> None:
        if not 8 <= self.size <= 2048 or not 1 <= self.views <= 1000 or not 0.004 <= self.cell <= 0.03:
            raise InputError(
                f"data synth: size {self.size}, views {self.views}, cell {self.cell}; "
                "choose 8..2048 pixels, 1..1000 views and 0.004..0.03 m"
            )


def synthesize(
    out: Path,
    people: int,
    config: SynthConfig,
    workers: int,
    report: Callable[[int, int], None],
) -> Labels:
    """Make what is missing of the first `people` people in `out`; returns the labels of all their pictures.

    `report` is told how many people are done, of how many.

    Raises:
        InputError: the folder holds something else, or cannot be written.
    """
    claim(out, config)
    missing = [i for i in range(people) if not record(out, i).exists()]
    done = people - len(missing)
    report(done, people)
    for _ in make_all(out, missing, config, workers):
        done += 1
        report(done, people)
    labels = joined([read_labels(record(out, i)) for i in range(people)])
    write_atomically(out / FILE_NAME, encode_labels(labels))
    return labels


def record(out: Path, person: int) -> Path:
    return out / "people" / f"{person:05d}.json"


def claim(out: Path, config: SynthConfig) -> None:
    """Make the folder this run's, or see that it is.

    Raises:
        InputError: it holds other files, or pictures of other settings.
    """
    settings = dataclasses.asdict(config)
    try:
        out.mkdir(parents=True, exist_ok=True)
        if (out / SETTINGS_FILE).exists():
            found = json.loads((out / SETTINGS_FILE).read_bytes())
        elif any(not entry.name.startswith(".") for entry in out.iterdir()):
            raise InputError(f"data synth: {out} holds other files; name an empty or a new folder")
        else:
            found = settings
            write_atomically(out / SETTINGS_FILE, json.dumps(settings).encode())
    except (OSError, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"data synth: cannot use {out} ({error}); name another folder") from error
    if found != settings:
        raise InputError(
            f"data synth: {out} was made with {found}, now {settings} is wanted; name another folder"
        )


def make_all(out: Path, missing: list[int], config: SynthConfig, workers: int) -> Iterator[None]:
    """Make people in processes of their own, in any order; yields as each is done."""
    workers = min(workers, len(missing))
    if workers <= 1:
        maker = PersonMaker(config)
        for person in missing:
            yield maker.make(out, person)
        return
    with (
        single_threaded(),
        ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=start_worker, initargs=(config,)
        ) as pool,
    ):
        for future in as_completed([pool.submit(make_in_worker, out, person) for person in missing]):
            yield future.result()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started meanwhile use one thread each: a process a core is faster than threads that share."""
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        yield
    finally:
        del os.environ["OMP_NUM_THREADS"]
        if before is not None:
            os.environ["OMP_NUM_THREADS"] = before


WORKER: list["PersonMaker"] = []  # the one of this process


def start_worker(config: SynthConfig) -> None:
    torch.set_num_threads(1)
    WORKER.append(PersonMaker(config))


def make_in_worker(out: Path, person: int) -> None:
    WORKER[0].make(out, person)


class PersonMaker:
    """Makes all files of one person after another."""

    def __init__(self, config: SynthConfig) -> None:
        from avatargen.avatar import shipped
        from avatargen.data.mesh import Tailor

        self.config = config
        self.tailor = Tailor(canonical_body(load_body(shipped("body.npz"))), config.cell)

    def make(self, out: Path, person: int) -> None:
        """Pictures, masks and depth, and last of all the record that says they are whole."""
        names = [f"{person:05d}/{view:02d}.png" for view in range(self.config.views)]
        folders = {kind: out / kind for kind in ("images", "masks", "depth")}
        for folder in folders.values():
            (folder / f"{person:05d}").mkdir(parents=True, exist_ok=True)
        labels, files = self.picture_all(person, names)
        for (kind, name), data in files.items():
            (folders[kind] / name).write_bytes(data)  # a torn one is in no record, and made again
        record(out, person).parent.mkdir(exist_ok=True)
        write_atomically(record(out, person), encode_labels(labels))

    def picture_all(self, person: int, names: list[str]) -> tuple[Labels, dict[tuple[str, str], bytes]]:
        """Every view of a person: labels, and the files by kind and name."""
        from avatargen.data.mesh import pose_mesh
        from avatargen.data.poses import random_pose
        from avatargen.data.raycast import orbit_camera, random_light, shoot

        rng = np.random.default_rng([self.config.seed, person])
        z = torch.from_numpy(rng.standard_normal((1, LATENT_SIZE), dtype=np.float32))
        mesh = self.tailor.mesh(People(z))
        body = self.tailor.body.source
        cameras, poses, files = [], [], {}
        for name in names:
            poses.append(random_pose(body.joint_names, rng))
            vertices = pose_mesh(mesh, body, poses[-1])
            middle = float(vertices[:, 1].min() + vertices[:, 1].max()) / 2
            camera = orbit_camera(middle, rng)
            cameras.append(camera.vector[0].numpy())
            shot = shoot(vertices, mesh.faces, mesh.colors, camera, random_light(rng), self.config.size)
            files[("images", name)] = png(shot.image)
            files[("masks", name)] = png(shot.mask)
            files[("depth", name)] = png(shot.depth)
        labels = Labels(
            names=tuple(f"images/{name}" for name in names),
            camera=np.stack(cameras),
            pose=np.stack(poses),
            betas=np.repeat(mesh.betas[None], len(names), axis=0),
        )
        return labels, files


def png(pixels: np.ndarray) -> bytes:
    """PNG of [S S 3] or [S S] in 8 bits, or [S S] in 16; quick rather than small."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="png", compress_level=1)
    return stream.getvalue()
