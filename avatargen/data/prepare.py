"""A data set of photographs: people cut out, aligned and labelled in our convention.

    OUT/dataset.json          labels and how often each picture is shown, see `avatargen.data.labels`
    OUT/images/NAME.png       the person on white     OUT/masks/NAME.png   coverage
    OUT/images/NAME_mirrored.png                      the same turned left to right
    OUT/skipped.jsonl         photographs that are not used, each with the reason
    OUT/parts/00012.json      labels of some finished photographs; a killed run goes on behind these
    OUT/prepare.json          the settings; a folder never holds pictures of two

Photograph i and all that happens to it depend on nothing else: any number of processes make the same files.
"""

import dataclasses
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from avatargen.atomic import write_atomically, write_together
from avatargen.avatar import training_body
from avatargen.body.model import Body, canonical_body
from avatargen.data.balance import view_weights
from avatargen.data.conventions import Convention
from avatargen.data.estimates import pickle_of, rows_in_json, rows_in_pickles, with_poses
from avatargen.data.folder import in_processes
from avatargen.data.keypoints import read_keypoints
from avatargen.data.labels import FILE_NAME, Labels, encode_labels
from avatargen.data.names import SUFFIXES, given_to
from avatargen.data.photograph import Photograph, Segment, Settings, Studio
from avatargen.data.pickles import Row
from avatargen.errors import InputError
from avatargen.generator.config import body_hash
from avatargen.run_folder import claim, digest, digest_files

SETTINGS_FILE = "prepare.json"
FORMAT = 2  # raised when the same photographs would give other pictures
PART = 16  # photographs between records
MIRRORED = "_mirrored"


@dataclass(frozen=True, kw_only=True)
class Sources:
    """Where photographs and what is known of them lie. Without masks, `images` must have an alpha channel or
    a segmentation be given; without keypoints, the labels' joints stand in for them.

    Raises InputError where something of it is missing.
    """

    images: Path
    labels: Path
    body: Path | None = None  # that was fitted; None: the shipped one, as training sees it
    masks: Path | None = None
    keypoints: Path | None = None
    smpl: Path | None = None  # poses for cameras alone, see `avatargen.data.estimates`

    def __post_init__(self) -> None:
        for name, path in vars(self).items():
            folder = name in ("images", "masks")
            if path is not None and not (path.is_dir() if folder else path.exists()):
                kind = "folder" if folder else "file or folder" if name in ("labels", "keypoints") else "file"
                raise InputError(f"data prepare: found no {kind} {path}; check --{name}")


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What came of it."""

    labels: Labels
    photographs: int
    skipped: tuple[tuple[str, str], ...]  # name and reason

    def reasons(self) -> dict[str, int]:
        """How many were skipped, by the first word or two of the reason."""
        return dict(Counter(reason.split(":")[0] for _, reason in self.skipped).most_common())


def prepare(
    sources: Sources,
    out: Path,
    settings: Settings,
    workers: int,
    report: Callable[[int, int], None],
    segment: Segment | None = None,
) -> Summary:
    """Prepare what is missing in `out`. `report` is told how many photographs are done, of how many.

    `segment` takes [H W 3] sRGB in 8 bits and returns the person's coverage [H W], 8 bits or 0..1 or truth
    values; with several workers it must be a function that other processes can import.

    Raises:
        InputError: sources or the folder cannot be used, or no photograph can.
    """
    files = list_photographs(sources.images, mirror=settings.mirror)
    photographs = describe(files, sources, settings.convention)
    found = fingerprint(sources, settings, photographs, segment)
    claim(out, SETTINGS_FILE, found, "data prepare", made=["*"])
    parts = [photographs[i : i + PART] for i in range(0, len(photographs), PART)]
    missing = [i for i in range(len(parts)) if not record(out, i).exists()]
    done = sum(len(part) for i, part in enumerate(parts) if i not in set(missing))
    report(done, len(photographs))
    workers = min(workers, len(missing))
    body = training_body(sources.body)
    start = (out, body, settings, sources, segment)
    jobs = [(i, parts[i]) for i in missing]
    for finished in run_all(workers, start, jobs):
        done += finished
        report(done, len(photographs))
    return finish(out, len(parts), len(photographs), settings, body_hash(canonical_body(body)))


def list_photographs(folder: Path, *, mirror: bool) -> list[Path]:
    """Pictures in a folder and those below it, in order of their names.

    Raises:
        InputError: there are none, or two would get the same name.
    """
    files = sorted(file for file in folder.rglob("*") if file.suffix.lower() in SUFFIXES)
    if not files:
        raise InputError(f"data prepare: {folder} holds no pictures ({', '.join(SUFFIXES)}); check the path")
    names = Counter(name_of(file, folder) for file in files)
    if mirror:
        names += Counter(name_of(file, folder) + MIRRORED for file in files)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise InputError(f"data prepare: two pictures would be named {twice[0]}; rename one")
    return files


def name_of(file: Path, folder: Path) -> str:
    return file.relative_to(folder).with_suffix("").as_posix()


def describe(files: list[Path], sources: Sources, convention: Convention) -> list[Photograph]:
    """What is known of each photograph; pickles are read later, by whoever makes its part.

    Raises:
        InputError: labels or keypoints cannot be read at all.
    """
    names = [name_of(file, sources.images) for file in files]
    rows: dict[str, Row] = {}
    if convention != "eva3d":
        rows = rows_in_json(sources.labels)
        if sources.smpl is not None:
            rows = with_poses(rows, sources.smpl)
    rows = given_to(names, rows, "labels")
    people = None
    if sources.keypoints is not None:
        people = given_to(names, read_keypoints(sources.keypoints), "keypoints")
    return [
        Photograph(
            name=name,
            file=file,
            mask=sources.masks / f"{name}.png" if sources.masks else None,
            row=rows.get(name, "label: there is none"),
            people=None if people is None else people.get(name, "keypoints: there are none by this name"),
        )
        for name, file in zip(names, files, strict=True)
    ]


def fingerprint(
    sources: Sources, settings: Settings, photographs: list[Photograph], segment: Segment | None
) -> dict[str, Any]:
    """All that a run depends on, as it is written beside it: files by their contents, wherever they lie."""
    labels, masks = sources.labels, [one.mask for one in photographs if one.mask is not None]
    if settings.convention == "eva3d":
        labels = digest_files(labels, [pickle_of(labels, one.name) for one in photographs])
    else:
        labels = digest(labels)
    return {
        **dataclasses.asdict(settings),
        "images": digest_files(sources.images, [one.file for one in photographs]),
        "images_folder": sources.images.resolve().name,  # labels may name it
        "labels": labels,
        "masks": digest_files(sources.masks, masks) if sources.masks else None,
        "body": sources.body and digest(sources.body),
        "keypoints": sources.keypoints and digest(sources.keypoints),
        "smpl": sources.smpl and digest(sources.smpl),
        "segment": segment and source_of(segment),
        "format": FORMAT,
    }


def source_of(segment: Segment) -> str:
    """A segmentation's name and the contents of the file that it stands in."""
    name = getattr(segment, "__qualname__", type(segment).__qualname__)
    file = getattr(sys.modules.get(segment.__module__), "__file__", None)
    return f"{segment.__module__}:{name} {file and digest(Path(file))}"


def record(out: Path, part: int) -> Path:
    return out / "parts" / f"{part:05d}.json"


class Worker:
    """Makes all files of one part after another."""

    def __init__(
        self, out: Path, body: Body, settings: Settings, sources: Sources, segment: Segment | None
    ) -> None:
        self.out, self.settings, self.sources = out, settings, sources
        convention = "ag3d" if sources.smpl is not None else settings.convention
        self.studio = Studio(body, dataclasses.replace(settings, convention=convention), segment)

    def make(self, part: int, photographs: Sequence[Photograph]) -> int:
        """Pictures and masks, and last of all the record that says they are whole; how many were asked."""
        if self.settings.convention == "eva3d":
            rows = rows_in_pickles(self.sources.labels, [one.name for one in photographs])
            photographs = [
                dataclasses.replace(one, row=row) for one, row in zip(photographs, rows, strict=True)
            ]
        labels, skipped = [], []
        for photograph in photographs:
            try:
                taken = self.studio.take(photograph)
            except InputError as error:
                skipped.append([photograph.name, str(error)])
                continue
            for name, picture in zip((photograph.name, photograph.name + MIRRORED), taken, strict=False):
                for kind, data in (("images", picture.image), ("masks", picture.mask)):
                    path = self.out / kind / f"{name}.png"
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(data)  # a torn one is in no record, and made again
                label = picture.label
                row = [label.camera.tolist(), label.pose.tolist(), label.betas.tolist()]
                labels.append([f"images/{name}.png", *row])
        record(self.out, part).parent.mkdir(exist_ok=True)
        write_atomically(record(self.out, part), json.dumps({"labels": labels, "skipped": skipped}).encode())
        return len(photographs)


WORKER: list[Worker] = []  # the one of this process


def start_worker(*arguments: Any) -> None:
    WORKER.append(Worker(*arguments))


def make_in_worker(part: int, photographs: Sequence[Photograph]) -> int:
    return WORKER[0].make(part, photographs)


def run_all(workers: int, start: tuple[Any, ...], jobs: list[tuple[int, list[Photograph]]]) -> Iterator[int]:
    """Make the parts, here or in processes; yields how many photographs each held."""
    if workers <= 1:
        worker = Worker(*start)
        for job in jobs:
            yield worker.make(*job)
        return
    yield from in_processes(workers, (start_worker, start), make_in_worker, jobs)


def finish(out: Path, parts: int, photographs: int, settings: Settings, body: str) -> Summary:
    """Write the labels of all parts, and what was skipped.

    Raises:
        InputError: everything was.
    """
    records = [json.loads(record(out, i).read_bytes()) for i in range(parts)]
    rows = [row for one in records for row in one["labels"]]
    skipped = tuple((name, reason) for one in records for name, reason in one["skipped"])
    lines = "".join(json.dumps({"name": name, "reason": reason}) + "\n" for name, reason in skipped)
    if not rows:
        write_atomically(out / "skipped.jsonl", lines.encode())
        common, count = Counter(reason for _, reason in skipped).most_common(1)[0]
        raise InputError(
            f"data prepare: none of {photographs} photographs can be used; {count} for this: {common}"
        )
    names, camera, pose, betas = zip(*rows, strict=True)
    camera = np.array(camera, dtype=np.float32)
    labels = Labels(
        names=names,
        camera=camera,
        pose=np.array(pose, dtype=np.float32),
        betas=np.array(betas, dtype=np.float32),
        weights=view_weights(camera) if settings.balance else None,
        body=body,
    )
    text = encode_labels(labels, prepared_from=settings.convention)
    write_together([(out / "skipped.jsonl", lines.encode()), (out / FILE_NAME, text)])
    return Summary(labels=labels, photographs=photographs, skipped=skipped)
