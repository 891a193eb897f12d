"""From the dense surface to the faces asked for, laid on the field.

    simplify -> remove slivers -> turn edges, place vertices -> turn edges | place vertices

What the first four leave is final but for its vertices, which the last moves by less than a tenth of a
millimetre as a rule: charts and weights need not wait for it.
"""

from assets.field import Field
from assets.fit import fit
from assets.flip import flip
from assets.simplify import SimplifyConfig, simplify
from assets.slivers import remove_slivers
from assets.surface import Surface, find_defects


def reduce(dense: Surface, sdf: Field, faces: int) -> Surface:
    """The surface at the faces asked for, without slivers and near the zero level of `sdf`, creases included,
    where that leaves it sound.

    Raises:
        GeometryError: no method reached the number of faces with a closed manifold surface.
        FieldError: the field is NaN or infinite.
    """
    simple = simplify(dense, SimplifyConfig(target_faces=faces))
    turned = flip(fit(flip(remove_slivers(simple), sdf), sdf), sdf)
    return simple if find_defects(turned) else turned


def settle(surface: Surface, sdf: Field) -> Surface:
    """The same faces with their vertices placed once more, which takes 4 % off the error, where that leaves
    them sound. Raises FieldError where the field is NaN or infinite."""
    settled = fit(surface, sdf)
    return surface if find_defects(settled) else settled
