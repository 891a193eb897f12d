"""A synthetic data set: many pictures of each wardrobe person, in random poses, light and views.

    OUT/dataset.json          labels, see `avatargen.data.labels`
    OUT/images/00012/03.png   on white         OUT/masks/...   coverage
    OUT/depth/...             distance along the ray in steps of 0.1 mm, 16 bit: for evaluation only
    OUT/people/00012.json     labels of one finished person; a killed run goes on behind these
    OUT/synth.json            the settings; a folder never holds pictures of two

Person i and all that happens to it is a function of (seed, i): any number of processes make the same files.
"""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from avatargen.atomic import write_atomically
from avatargen.body.model import canonical_body
from avatargen.data.folder import in_processes, png
from avatargen.data.labels import FILE_NAME, Labels, encode_labels, joined, read_labels
from avatargen.errors import InputError
from avatargen.run_folder import claim
from avatargen.wardrobe.attributes import LATENT_SIZE, People

SETTINGS_FILE = "synth.json"
FORMAT = 2  # raised when the same seed would give other pictures


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
    claim(out, SETTINGS_FILE, dataclasses.asdict(config), "data synth", made=["*"])
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


def make_all(out: Path, missing: list[int], config: SynthConfig, workers: int) -> Iterator[None]:
    """Make people in processes of their own, in any order; yields as each is done."""
    workers = min(workers, len(missing))
    if not missing:
        return
    if workers <= 1:
        maker = PersonMaker(config)
        for person in missing:
            yield maker.make(out, person)
        return
    jobs = [(out, person) for person in missing]
    yield from in_processes(workers, (start_worker, (config,)), make_in_worker, jobs)


WORKER: list["PersonMaker"] = []  # the one of this process


def start_worker(config: SynthConfig) -> None:
    torch.set_num_threads(1)
    WORKER.append(PersonMaker(config))


def make_in_worker(out: Path, person: int) -> None:
    WORKER[0].make(out, person)


class PersonMaker:
    """Makes all files of one person after another."""

    def __init__(self, config: SynthConfig) -> None:
        from avatargen.avatar import training_body
        from avatargen.data.mesh import Tailor

        self.config = config
        self.tailor = Tailor(canonical_body(training_body()), config.cell)

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
