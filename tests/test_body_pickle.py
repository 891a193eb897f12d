"""SMPL's pickles: they load, and what hostile ones ask for does not run."""

import io
import os
import pickle
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from avatargen.body import pickle as converter
from avatargen.body.load import load_body
from avatargen.errors import InputError
from tests.bodies import smpl_like_arrays


@pytest.fixture
def chumpy() -> Iterator[type]:
    """A stand-in for the library SMPL's files were written with."""

    class Ch:
        def __init__(self, x: np.ndarray) -> None:
            self.x = x
            self._dirty_vars = set()

    Ch.__module__, Ch.__qualname__ = "chumpy.ch", "Ch"
    package, module = types.ModuleType("chumpy"), types.ModuleType("chumpy.ch")
    setattr(module, "Ch", Ch)  # noqa: B010
    sys.modules.update({"chumpy": package, "chumpy.ch": module})
    yield Ch
    del sys.modules["chumpy"], sys.modules["chumpy.ch"]


@pytest.mark.parametrize("protocol", [0, 2, 4, 5])
def test_an_smpl_like_pickle_loads(tmp_path: Path, chumpy: type, protocol: int):
    arrays = smpl_like_arrays()
    content = arrays | {
        "J_regressor": csc_matrix(arrays["J_regressor"]),
        "shapedirs": chumpy(arrays["shapedirs"]),
        "bs_style": "lbs",
        "J": np.zeros((24, 3)),
    }
    if protocol == 0:  # text: keep it small
        content["posedirs"] = np.zeros((6890, 3, 207), dtype=np.int8)
    (tmp_path / "smpl.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
    body = load_body(tmp_path / "smpl.pkl")

    assert body.v_template.shape == (6890, 3)
    assert np.allclose(body.J_regressor, arrays["J_regressor"])
    assert np.allclose(body.shapedirs, arrays["shapedirs"])
    assert body.posedirs is not None


def test_python_2_text_loads(tmp_path: Path):
    """Python 2 wrote bytes as text; Latin-1 keeps them."""
    array = np.linspace(0, 1, 12).reshape(4, 3)
    text = (
        b"(dp0\nS'v_template'\np1\ncnumpy.core.multiarray\n_reconstruct\np2\n(cnumpy\nndarray\np3\n(I0\ntS'b'\n"
        b"tRp4\n(I1\n(I4\nI3\ntcnumpy\ndtype\np5\n(S'f8'\nI0\nI1\ntR(I3\nS'<'\nNNNI-1\nI-1\nI0\ntbI00\nS"
        + repr(array.tobytes().decode("latin1")).encode("latin1")
        + b"\ntbs."
    )
    (tmp_path / "old.pkl").write_bytes(text)
    assert np.array_equal(
        converter.convert_pickle(tmp_path / "old.pkl", converter.KEYS, "body")["v_template"], array
    )


class Calls:
    """Pickles to a call."""

    def __init__(self, function: object, *arguments: object) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> tuple:
        return self.call


def payloads(proof: Path) -> dict[str, bytes]:
    """Pickles that try to create the file `proof`."""
    shell = f"touch {proof}"
    python = f"open({str(proof)!r}, 'w').close()"
    getattr_chain = (  # builtins.getattr(builtins, 'eval')(...), by opcodes
        b"cbuiltins\ngetattr\n(cbuiltins\n__dict__\nS'get'\ntR(S'eval'\ntR(S"
        + repr(python).encode()
        + b"\ntR."
    )
    dotted = b"\x80\x04\x8c\x05numpy\x8c\x14ndarray.__class__.mro\x93."
    state = b"cnumpy\ndtype\n(dS'__reduce__'\ncos\nsystem\nsb(S" + repr(shell).encode() + b"\ntR."
    through_numpy = pickle.dumps(np.array([Calls(os.system, shell)], dtype=object))
    extension = b"\x80\x02\x82\x01."
    return {
        "system": pickle.dumps(Calls(os.system, shell)),
        "system, protocol 0": pickle.dumps(Calls(os.system, shell), protocol=0),
        "eval": pickle.dumps(Calls(eval, python)),
        "exec": pickle.dumps(Calls(exec, python), protocol=2),
        "getattr chain": getattr_chain,
        "dotted name": dotted,
        "build": state,
        "inside an object array": through_numpy,
        "extension registry": extension,
        "in a mapping": pickle.dumps(smpl_like_arrays(posedirs=False) | {"J": Calls(os.system, shell)}),
        "persistent id": b"Pos.system\n.",
        "runpy": b"crunpy\n_run_code\n(S" + repr(python).encode() + b"\n(dtR.",
        "numpy's own loader": b"cnumpy\nload\n(S'x'\ntR.",
        "encode to another codec": b"c_codecs\nencode\n(Vx\nS'zip'\ntR.",
        "rebuild a real class": b"ccopy_reg\n_reconstructor\n(cnumpy\nndarray\nc__builtin__\nobject\nNtR.",
    }


@pytest.mark.parametrize("name", payloads(Path("proof")))
def test_hostile_pickles_do_not_run(tmp_path: Path, name: str):
    proof = tmp_path / "proof"
    path = tmp_path / "hostile.pkl"
    path.write_bytes(payloads(proof)[name])
    with pytest.raises((pickle.UnpicklingError, TypeError, ValueError, AttributeError)):
        converter.read_pickle(path)
    assert not proof.exists()


def test_the_payloads_would_run_in_a_plain_unpickler(tmp_path: Path):
    """Proof that the test above tests something."""
    proof = tmp_path / "proof"
    pickle.load(io.BytesIO(payloads(proof)["eval"]))  # noqa: S301
    assert proof.exists()


def test_a_hostile_pickle_ends_in_one_line(tmp_path: Path):
    proof = tmp_path / "proof"
    (tmp_path / "hostile.pkl").write_bytes(payloads(proof)["system"])
    with pytest.raises(InputError, match=r"posix\.system|nt\.system") as caught:
        load_body(tmp_path / "hostile.pkl")
    assert "\n" not in str(caught.value)
    assert not proof.exists()


def test_memory_and_missing_files(tmp_path: Path):
    """A pickle of a few bytes that asks for a huge array ends at the limit, not in a full machine."""
    (tmp_path / "huge.pkl").write_bytes(b"\x80\x04\x95\xff\xff\xff\xff\xff\xff\xff\x0f.")
    (tmp_path / "bytes.pkl").write_bytes(b"\x80\x04\x8e\xff\xff\xff\xff\x0f\x00\x00\x00.")
    (tmp_path / "text.pkl").write_bytes(b"no pickle at all")
    for name in ("huge", "bytes", "text"):
        with pytest.raises(InputError, match="was not read"):
            load_body(tmp_path / f"{name}.pkl")
    with pytest.raises(InputError, match="cannot read"):
        load_body(tmp_path / "none.pkl")
