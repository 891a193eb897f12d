"""Packed data sets: the same pictures as from files of their own, whole or refused."""

import errno
import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from safetensors.numpy import load_file

from avatargen.commands.main import main
from avatargen.data import pack as packing
from avatargen.data.dataset import KINDS, Pictures, open_pictures
from avatargen.data.labels import Labels, encode_labels
from avatargen.data.pack import pack, pack_in_place, smaller_depth
from avatargen.data.packed import PACK_NAME
from avatargen.errors import InputError

COUNT, SIZE = 9, 20


def silent(done: int, of: int) -> None:
    pass


def write_set(
    folder: Path, names: Sequence[str], *, kinds: Sequence[str] = ("images", "masks", "depth")
) -> None:
    """Noise, the same for a name wherever it is."""
    for name in names:
        rng = np.random.default_rng(list(name.encode()))
        seen = rng.random((SIZE, SIZE)) < 0.7
        pixels = {
            "images": rng.integers(256, size=(SIZE, SIZE, 3), dtype=np.uint8),
            "masks": rng.integers(256, size=(SIZE, SIZE), dtype=np.uint8),
            "depth": rng.integers(65536, size=(SIZE, SIZE), dtype=np.uint16) * seen,
        }
        for kind in kinds:
            path = folder / kind / name
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(pixels[kind].astype(np.uint16 if kind == "depth" else np.uint8)).save(path)
    rng = np.random.default_rng(0)
    labels = Labels(
        names=tuple(f"images/{name}" for name in names),
        camera=rng.normal(size=(len(names), 25)).astype(np.float32),
        pose=rng.normal(size=(len(names), 24, 3)).astype(np.float32),
        betas=rng.normal(size=(len(names), 10)).astype(np.float32),
        weights=rng.uniform(0.5, 2, len(names)).astype(np.float32),
    )
    (folder / "dataset.json").write_bytes(encode_labels(labels, prepared_from="eva3d"))


NAMES = [f"{i // 3:05d}/{i % 3:02d} \n.png" for i in range(COUNT)]  # any name that a file may have


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_set(tmp_path / "files", NAMES)
    return tmp_path / "files"


def assert_equal(one: Pictures, other: Pictures, kinds: Sequence[str] = KINDS) -> None:
    """By every way to read them."""
    assert len(one) == len(other) and one.labels.names == other.labels.names
    every = torch.arange(len(one))
    shuffled = torch.tensor([5, 0, 5, 6, 3])
    for indices in (every, shuffled):
        pixels = one.pixels(indices)
        assert pixels.dtype == torch.uint8 and torch.equal(pixels, other.pixels(indices))
        assert torch.equal(pixels.float() / 255, torch.stack([one.image(int(i)) for i in indices]))
        assert all(torch.equal(a, b) for a, b in zip(one.row(indices), other.row(indices), strict=True))
    for i in range(len(one)):
        assert torch.equal(one.image(i), other.image(i))
        assert "masks" not in kinds or torch.equal(one.mask(i), other.mask(i))
        assert "depth" not in kinds or torch.equal(one.depth(i), other.depth(i))
    draw = [one.choose((4, 50), torch.Generator().manual_seed(1)) for one in (one, other)]
    assert torch.equal(*draw)


@pytest.mark.parametrize("batch", [1, 4, 100])
@pytest.mark.parametrize("size", [SIZE, SIZE // 2, 5])
def test_packed_pictures_are_those_of_the_files(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int, size: int
):
    monkeypatch.setattr(packing, "BATCH", batch)
    told = []
    pack(folder, tmp_path / "out", size=None, depth=True, report=lambda done, of: told.append((done, of)))
    assert told[-1] == (COUNT, COUNT)
    files, packed = open_pictures(folder, size), open_pictures(tmp_path / "out", size)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["dataset.json", PACK_NAME]
    assert (tmp_path / "out/dataset.json").read_bytes() == (folder / "dataset.json").read_bytes()
    assert_equal(files, packed)
    assert_equal(files.part(slice(2, COUNT)), packed.part(slice(2, COUNT)))


def test_a_smaller_pack_is_what_smaller_pictures_are(folder: Path, tmp_path: Path):
    pack(folder, tmp_path / "out", size=10, depth=True, report=silent)
    files, packed = open_pictures(folder, 10), open_pictures(tmp_path / "out", 10)
    assert_equal(files, packed, ("images", "masks"))
    for i in range(COUNT):
        whole, small = files.depth(i).double().numpy(), packed.depth(i).double().numpy()
        for y, x in np.ndindex(10, 10):
            block = whole[2 * y : 2 * y + 2, 2 * x : 2 * x + 2]
            seen = block[block > 0]
            wanted = seen.mean() if len(seen) >= 2 else 0
            assert abs(small[y, x] - wanted) < 0.6e-4


def test_any_reader_of_the_format_reads_the_file(folder: Path, tmp_path: Path):
    pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    arrays, files = load_file(tmp_path / "out" / PACK_NAME), open_pictures(folder, SIZE)
    every = torch.arange(COUNT)
    assert np.array_equal(arrays["images"].transpose(0, 3, 1, 2), files.pixels(every).numpy())
    assert np.array_equal(arrays["masks"], files.read("masks", range(COUNT)))
    assert np.array_equal(arrays["depth"], np.stack([files.depth_steps(i) for i in range(COUNT)]))


def test_what_a_set_lacks_and_depth_unasked_are_left_out(tmp_path: Path):
    write_set(tmp_path / "files", NAMES[:8], kinds=["images", "depth"])
    pack(tmp_path / "files", tmp_path / "out", size=None, depth=False, report=silent)
    pictures = open_pictures(tmp_path / "out", SIZE)
    assert [pictures.holds(kind) for kind in ("images", "masks", "depth")] == [True, False, False]
    length = (tmp_path / "out" / PACK_NAME).stat().st_size
    assert 8 * SIZE * SIZE * 3 < length < 8 * SIZE * SIZE * 3 + 1000
    with pytest.raises(InputError, match="holds no depth"):
        pictures.depth(0)
    shutil.rmtree(tmp_path / "files/depth")
    with pytest.raises(InputError, match="no depth"):
        pack(tmp_path / "files", tmp_path / "out", size=None, depth=True, report=silent)


def test_contents_tell_sets_and_parts_apart(folder: Path, tmp_path: Path):
    pack(folder, tmp_path / "out", size=None, depth=False, report=silent)
    shutil.copytree(tmp_path / "out", tmp_path / "elsewhere")
    found = open_pictures(tmp_path / "out", SIZE).contents()
    assert open_pictures(tmp_path / "elsewhere", 1).contents() == found
    assert open_pictures(tmp_path / "out", SIZE).part(slice(4)).contents() != found
    (tmp_path / "elsewhere/dataset.json").write_bytes((folder / "dataset.json").read_bytes() + b"\n")
    assert open_pictures(tmp_path / "elsewhere", 1).contents() != found


def change_header(path: Path, change: Callable[[dict], object]) -> None:
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    change(header)
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[8 + length :])


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "too long": lambda path: path.write_bytes(path.read_bytes() + b"\0"),
    "empty": lambda path: path.write_bytes(b""),
    "no header": lambda path: path.write_bytes(path.read_bytes()[:100]),
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 9),
    "weights": lambda path: change_header(path, lambda head: head["__metadata__"].pop("format")),
    "no images": lambda path: change_header(path, lambda head: head.pop("images")),
    "other kind": lambda path: change_header(path, lambda head: head.update(more=head["images"])),
    "other type": lambda path: change_header(path, lambda head: head["images"].update(dtype="F32")),
    "flat": lambda path: change_header(path, lambda head: head["images"].update(shape=[9 * 20, 20, 3])),
    "fractions": lambda path: change_header(path, lambda head: head["images"].update(shape=[9.0, 20, 20, 3])),
    "offsets": lambda path: change_header(path, lambda head: head["masks"].update(data_offsets=[0, 1])),
    "beyond": lambda path: change_header(
        path, lambda head: head["masks"].update(data_offsets=[2**40, 2**40 + COUNT * SIZE * SIZE])
    ),
    "names": lambda path: change_header(path, lambda head: head["__metadata__"].update(names='["a"]')),
    "a list": lambda path: path.write_bytes((2).to_bytes(8, "little") + b"[]"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_named_in_a_sentence(folder: Path, tmp_path: Path, damage: str):
    pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    DAMAGES[damage](tmp_path / "out" / PACK_NAME)
    with pytest.raises(InputError, match=rf"data: .*{PACK_NAME} .*anew") as found:
        open_pictures(tmp_path / "out", SIZE)
    assert "\n" not in str(found.value)


def test_a_flipped_bit_is_found_before_training(folder: Path, tmp_path: Path):
    pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    data = bytearray((tmp_path / "out" / PACK_NAME).read_bytes())
    data[-7] ^= 16
    (tmp_path / "out" / PACK_NAME).write_bytes(data)
    with pytest.raises(InputError, match=r"masks in .* damaged"):
        open_pictures(tmp_path / "out", SIZE).contents()


def test_labels_of_other_pictures_are_refused(folder: Path, tmp_path: Path):
    pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    write_set(tmp_path / "other", ["1.png", "2.png"])
    shutil.copy(tmp_path / "other/dataset.json", tmp_path / "out/dataset.json")
    with pytest.raises(InputError, match=r"holds no images/1\.png"):
        open_pictures(tmp_path / "out", SIZE)
    with pytest.raises(InputError, match="multiple of 12"):
        pack(folder, tmp_path / "third", size=12, depth=False, report=silent)
    assert list((tmp_path / "third").iterdir()) == []


def test_labels_in_another_order_find_their_pictures(folder: Path, tmp_path: Path):
    pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    write_set(folder, NAMES[::-2])
    shutil.copy(folder / "dataset.json", tmp_path / "out/dataset.json")
    a, b = open_pictures(folder, SIZE), open_pictures(tmp_path / "out", SIZE)
    assert torch.equal(a.pixels(torch.arange(5)), b.pixels(torch.arange(5)))


def test_nothing_is_half_written(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A disk that fills up, and a broken picture, leave an earlier pack as it was."""
    pack(folder, tmp_path / "out", size=None, depth=False, report=silent)
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    (folder / "images" / NAMES[-1]).write_bytes(b"torn")
    with pytest.raises(InputError, match="no whole picture"):
        pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    write_set(folder, NAMES)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(packing, "write_pack", full)
    with pytest.raises(InputError, match="No space left"):
        pack(folder, tmp_path / "out", size=None, depth=True, report=silent)
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    with pytest.raises(InputError, match="holds other files"):
        pack(tmp_path / "out", folder, size=None, depth=False, report=silent)


def test_a_folder_packed_in_place_grows(folder: Path):
    """What is packed stays so; new files beside it are read until they are packed too."""
    write_set(folder, NAMES[:5])
    whole = folder.with_name("whole")
    write_set(whole, NAMES)
    pack_in_place(folder, silent)
    assert sorted(path.name for path in folder.iterdir()) == ["dataset.json", PACK_NAME]
    write_set(folder, NAMES[5:])
    shutil.copy(whole / "dataset.json", folder)
    assert_equal(open_pictures(folder, SIZE), open_pictures(whole, SIZE))
    for _ in range(2):  # the second time there is nothing to do
        pack_in_place(folder, silent)
        assert sorted(path.name for path in folder.iterdir()) == ["dataset.json", PACK_NAME]
        assert_equal(open_pictures(folder, SIZE), open_pictures(whole, SIZE))


def test_depth_of_half_a_pixel_counts():
    depth = np.zeros((4, 4), dtype=np.uint16)
    depth[0, :2] = 100, 301
    depth[2, 2] = 7
    assert smaller_depth(depth, 2).tolist() == [[200, 0], [0, 0]]
    assert np.array_equal(smaller_depth(depth, 4), depth)


def test_the_command_packs_and_says_so(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "out"
    assert main(["data", "pack", str(folder), "--size", "10", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == f"{out / PACK_NAME}\n" and "9 pictures of 10 pixels a side, 0.0 MB" in said.err
    assert main(["data", "pack", str(tmp_path / "none"), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "dataset.json" in error
