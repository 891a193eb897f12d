"""From the dense surface to the faces asked for, laid on the field.

    simplify to a quarter more -> turn edges, place vertices
    simplify to the number     -> turn edges | place vertices

The first round lays the faces on the field, so that the second simplification weighs them by where the field
is and not by the steps of a grid: an eighth off the error. All but the last step is
final but for the places of vertices, which that slides by half a millimetre as a rule: charts need not wait
for it.
"""

from assets.field import Field
from assets.mesh.surface import Surface, find_defects
from assets.simplify.fit import fit
from assets.simplify.flip import flip
from assets.simplify.simplify import SimplifyConfig, simplify

SURPLUS = 1.25  # of the faces asked for, in the first round


def reduce(dense: Surface, sdf: Field, faces: int) -> Surface:
    """The surface at the faces asked for, near the zero level of `sdf`, creases included.

    Raises:
        GeometryError: no method reached the number of faces with a closed manifold surface.
        FieldError: the field is NaN or infinite.
    """
    more = simplify(dense, SimplifyConfig(target_faces=round(SURPLUS * faces)))
    laid = fit(flip(more, sdf), sdf)
    simple = simplify(more if find_defects(laid) else laid, SimplifyConfig(target_faces=faces))
    turned = flip(simple, sdf)
    return simple if find_defects(turned) else turned


def settle(surface: Surface, sdf: Field) -> Surface:
    """The same faces with their vertices placed once more, where that leaves them sound.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    settled = fit(surface, sdf)
    return surface if find_defects(settled) else settled
