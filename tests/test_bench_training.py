"""The training's benchmark: phases add up to the step, and counts are those of the networks."""

from dataclasses import replace

import pytest
import torch
from torch import nn

from avatargen.commands.bench.training import PHASES, measure_training, training_table
from avatargen.commands.bench.training_cost import Counting, cost_table, step_cost
from tests.small_run import BODY, CONFIG


def test_the_phases_of_a_step_add_up_to_it():
    row = measure_training("debug", CONFIG, BODY, torch.device("cpu"), steps=1, warm=1)
    assert set(row.phases) == {name for name, _, _ in PHASES} | {"rest"}
    assert row.pictures_a_second == pytest.approx(CONFIG.batch / row.seconds)
    assert all(
        row.phases[name] > 0 for name in ("posing", "field", "backward", "optimisers", "discriminator")
    )
    assert row.phases["R1"] == 0 and row.gigabytes == 0
    assert training_table([row]).count("\n") == 7


def test_operations_and_bytes_are_counted_one_by_one():
    layer = nn.Linear(8, 16, device="meta")
    with Counting() as counting:
        y = layer(torch.empty(4, 8, device="meta"))
        y.view(2, 32)  # costs nothing
    assert counting.flops == 2 * 4 * 8 * 16
    assert counting.bytes == 4 * (4 * 8 + 8 * 16 + 16 + 4 * 16)


def test_a_larger_batch_costs_more_and_half_at_once_as_much_again_for_pictures():
    one, two = (step_cost("debug", replace(CONFIG, batch=batch), BODY) for batch in (2, 4))
    parts = step_cost("debug", replace(CONFIG, batch=4, at_once=2), BODY)
    assert 1.8 < two.teraflops / one.teraflops < 2.2 and two.calls < 1.1 * one.calls
    assert 1.05 < parts.teraflops / two.teraflops < 1.6
    assert cost_table([one, two]).count("\n") == 4
