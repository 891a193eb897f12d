"""kill -9 at any moment of a run, again and again: then the same files as of a run that was left alone."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn.utils import parameters_to_vector

from avatargen.data.dataset import open_pictures
from avatargen.data.pack import pack
from avatargen.training.adversarial import train
from avatargen.training.avatar_model import avatar_model
from avatargen.training.best_snapshot import DECIDES, Watch
from tests.small_run import BODY, CONFIG, SIZE, accelerator, make_data

LONGER = replace(CONFIG, images=32)  # 16 steps, 8 snapshots


def run(data: Path, out: Path) -> None:
    """Train alone, or as one of the processes that the environment tells of."""
    torch.set_num_threads(1)
    watch = Watch(
        pictures=20, measure=lambda model: {DECIDES: float(parameters_to_vector(model.parameters()).sum())}
    )
    pictures, model = open_pictures(data, SIZE), avatar_model(LONGER, BODY)
    machine = accelerator()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    train(LONGER, model, pictures, BODY, out, machine, lambda line: None, watch=watch)


def start(processes: int, port: int, data: Path, out: Path) -> list[subprocess.Popen[bytes]]:
    """Processes that have loaded what they need, and go on."""
    code = "import sys; from tests.test_kills import *; run(*map(Path, sys.argv[1:]))"
    command = [sys.executable, "-c", code]
    environment = dict(os.environ)
    if processes > 1:
        environment |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port), "WORLD_SIZE": str(processes)}
        environment |= {"ACCELERATE_USE_CPU": "true", "GLOO_SOCKET_IFNAME": "lo"}
    started = [
        subprocess.Popen(
            [*command, str(data), str(out)],
            env=environment | ({"RANK": str(rank), "LOCAL_RANK": str(rank)} if processes > 1 else {}),
            stdout=subprocess.PIPE,
        )
        for rank in range(processes)
    ]
    for process in started:
        assert process.stdout is not None
        with process.stdout:
            assert process.stdout.readline() == b"ready\n"
    return started


def files(out: Path) -> dict[str, bytes]:
    """All that a run leaves, but its curves, which tell when they were drawn, and its state."""
    found = (path for path in out.rglob("*") if path.is_file() and "tensorboard" not in path.parts)
    return {str(path.relative_to(out)): path.read_bytes() for path in found if path.name != "state.pt"}


def tensors(content: object) -> list[object]:
    if isinstance(content, dict):
        return [inner for name in sorted(content, key=str) for inner in (name, *tensors(content[name]))]
    if isinstance(content, list | tuple):
        return [inner for each in content for inner in tensors(each)]
    return [content.numpy().tobytes() if isinstance(content, torch.Tensor) else content]


@pytest.mark.parametrize(("processes", "kills"), [(1, 3), (2, 1)])
def test_a_run_killed_at_random_moments_ends_as_one_left_alone(tmp_path: Path, processes: int, kills: int):
    """On packed pictures."""
    data = tmp_path / "packed"
    make_data(tmp_path / "data")
    pack(tmp_path / "data", data, size=None, depth=False, report=lambda done, of: None)
    whole, killed, port = tmp_path / "whole", tmp_path / "killed", 29650 + 20 * processes
    alone, lasted = start(processes, port, data, whole), -time.monotonic()
    assert [process.wait(timeout=300) for process in alone] == [0] * processes
    lasted += time.monotonic()
    rng, codes = np.random.default_rng(processes), []
    for attempt in range(kills):
        running = start(processes, port + 1 + attempt, data, killed)
        time.sleep(rng.uniform(0, 0.35) * lasted)
        for process in running:
            process.kill()
        codes += [process.wait() for process in running]
    assert codes == [-signal.SIGKILL] * processes * kills
    last = start(processes, port + 9, data, killed)
    assert [process.wait(timeout=300) for process in last] == [0] * processes

    assert files(killed) == files(whole)
    states = [torch.load(out / "state.pt", weights_only=True) for out in (whole, killed)]
    assert tensors(states[0]) == tensors(states[1])
