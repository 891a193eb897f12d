"""From the dense surface to the faces asked for, near the field.

    simplify to a quarter more -> turn edges (flip), place vertices (fit)      reduce
    cut handles, simplify to the number -> turn edges (flip)                   reduce
                                                      -> place vertices (fit)  refit

The first round puts the faces on the field. So the second simplification weighs them by where the field is,
and not by the steps of a grid: an eighth off the error. `refit` slides vertices by half a millimetre as a
rule, and changes nothing else, so charts need not wait for it. Handles are cut in between, where the
surface is small and the second round can still use the faces.
"""

from assets.field import Field
from assets.mesh.handles import without_handles
from assets.mesh.importance import Importance, evenly
from assets.mesh.surface import Surface, count_pieces, find_defects
from assets.simplify.fit import fit
from assets.simplify.flip import flip
from assets.simplify.simplify import SimplifyConfig, simplify

SURPLUS = 1.25  # times the faces asked for are kept in the first round


def reduce(
    dense: Surface, sdf: Field, faces: int, importance: Importance = evenly, longest: float = 0.0
) -> Surface:
    """The surface at the number of faces asked for, near the zero level of `sdf` (metres), creases included;
    nearer where more counts; without the handles that a loop of at most `longest` metres goes around.

    Raises:
        GeometryError: no method reached the number of faces with a closed manifold surface.
        FieldError: the field is NaN or infinite.
    """
    more = simplify(dense, SimplifyConfig(target_faces=round(SURPLUS * faces)), importance)
    laid, pieces = fit(flip(more, sdf), sdf), count_pieces(dense)
    better = more if find_defects(laid, pieces=pieces) else laid
    cut, _ = without_handles(better, longest)
    simple = simplify(cut, SimplifyConfig(target_faces=faces), importance)
    turned = flip(simple, sdf)
    return simple if find_defects(turned, pieces=pieces) else turned


def refit(surface: Surface, sdf: Field) -> Surface:
    """The same faces with their vertices placed once more; the surface itself where that would spoil it.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    moved = fit(surface, sdf)
    return surface if find_defects(moved, pieces=count_pieces(surface)) else moved
