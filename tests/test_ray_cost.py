"""Ray cost: more samples see more, the shell sees more with as many, and a table says so."""

from dataclasses import replace
from pathlib import Path

import torch

from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface
from avatargen.metrics import ray_cost
from avatargen.metrics.ray_cost import ray_costs, table
from avatargen.training.avatar_model import generator_config
from tests.small_run import BODY, CONFIG, make_data


def test_errors_fall_with_samples_and_with_the_shell(tmp_path: Path):
    data = make_data(tmp_path / "data")
    networks = generator_config(CONFIG, BODY, None)
    sharp = replace(networks, render=replace(networks.render, initial_alpha=0.004))
    torch.manual_seed(0)
    costs = ray_costs(AvatarGenerator(sharp), CanonicalSurface(BODY), data, 2)
    errors = {(cost.steps, cost.shell): cost.mask for cost in costs}

    assert set(errors) == {(steps, shell) for steps in ray_cost.STEPS for shell in (True, False)}
    assert errors[48, True] < 0.6 * errors[12, True]
    assert sum(errors[steps, True] for steps in ray_cost.STEPS) < 0.8 * sum(
        errors[steps, False] for steps in ray_cost.STEPS
    )
    assert all(cost.seconds > 0 for cost in costs)
    assert table(costs).count("\n") == 9
