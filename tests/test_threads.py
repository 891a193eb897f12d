import multiprocessing
import threading

import pytest
import torch

from avatargen.threads import spread


def test_results_come_in_order_and_torch_keeps_its_threads():
    before, met = torch.get_num_threads(), threading.Barrier(2, timeout=60)

    def work(piece: int) -> tuple[int, int]:
        met.wait()  # passes only where two pieces are worked on at once
        return piece, torch.get_num_threads()

    torch.set_num_threads(2)
    try:
        assert spread(work, range(6)) == [(piece, 1) for piece in range(6)]
        assert torch.get_num_threads() == 2
        torch.set_num_threads(1)
        assert spread(lambda piece: piece**2, [3, 4]) == [9, 16]
    finally:
        torch.set_num_threads(before)


def test_an_error_is_passed_on_and_torch_keeps_its_threads():
    def work(piece: int) -> int:
        raise ValueError(str(piece))

    before = torch.get_num_threads()
    torch.set_num_threads(2)
    begins_with: list[int] = []
    try:
        with pytest.raises(ValueError, match="0"):
            spread(work, range(3))
        assert torch.get_num_threads() == 2
        later = threading.Thread(target=lambda: begins_with.append(torch.get_num_threads()))
        later.start()
        later.join()
        assert begins_with == [2]
    finally:
        torch.set_num_threads(before)


def squares(answers: "multiprocessing.SimpleQueue[list[int]]") -> None:
    answers.put(spread(lambda piece: piece**2, [2, 3, 4]))


def test_a_forked_child_starts_threads_of_its_own():
    """Of its parent's, which are kept, it has none."""
    fork, before = multiprocessing.get_context("fork"), torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        assert spread(lambda piece: piece**2, [1, 2]) == [1, 4]
        answers = fork.SimpleQueue()
        child = fork.Process(target=squares, args=(answers,), daemon=True)
        child.start()
        child.join(timeout=60)
        assert child.exitcode == 0
        assert answers.get() == [4, 9, 16]
    finally:
        torch.set_num_threads(before)
