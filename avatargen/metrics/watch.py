"""Metrics of a model while it learns: few pictures, always of the same people at the same labels.

They tell one snapshot of a run from another. The pictures compared with are those learned from, and joints
are estimated by the built-in regression, so the numbers are none for a table: `avatargen eval` measures
those.
"""

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.metrics.evaluate import measure
from avatargen.metrics.joints import ridge_judge
from avatargen.metrics.judges import BUILT_IN, Judges
from avatargen.metrics.report import measured
from avatargen.metrics.shown import ShowConfig, choose_labels, show
from avatargen.metrics.truth import gather_truth
from avatargen.training.best_snapshot import Watch
from avatargen.training.picture_model import PictureModel

REFERENCES = 400  # pictures on which the estimate of joints is fitted


def watch(pictures: Pictures, body: Body, count: int, raw_size: int) -> Watch:
    """Measure by `count` pictures of a model, half of them also from another side.

    `raw_size` is that of the model's depth. What is true of the pictures is found here, once.

    Raises:
        InputError: too few pictures, or a broken one.
    """
    config = ShowConfig(pictures=count, turned=count // 2, reposed=0)
    judges = Judges(features=(BUILT_IN,), joints=ridge_judge(pictures, body, REFERENCES))
    truth = gather_truth(pictures, pictures, body, choose_labels(pictures, config), judges, raw_size)

    def numbers(model: PictureModel) -> dict[str, float]:
        found = measured(measure(show(model, pictures, config), truth, judges))
        return {name: number.value for name, number in found.items()}

    return Watch(pictures=count, measure=numbers)
