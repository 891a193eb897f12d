import threading

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
