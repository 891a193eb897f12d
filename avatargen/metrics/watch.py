"""Metrics of a model while it learns: few pictures, always of the same people at the same labels.

They tell one snapshot of a run from another. The pictures compared with are those learned from, and joints
are estimated by the built-in regression, so the numbers are none for a table: `avatargen eval` measures
those.
"""

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.metrics.evaluate import examine, set_exam
from avatargen.metrics.joints import ridge_judge
from avatargen.metrics.judges import BUILT_IN, Judges
from avatargen.metrics.shown import ShowConfig
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
    exam = set_exam(pictures, pictures, body, judges, config, raw_size)

    def measure(model: PictureModel) -> dict[str, float]:
        return {name: number.value for name, number in examine(model, exam).numbers.items()}

    return Watch(pictures=count, measure=measure)
