import numpy as np
import pytest
from shapes import BOX, PERSON_BOX, person, torus

from assets.isosurface.adaptive import trace_adaptively
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.measure import surface_error
from assets.mesh.surface import find_defects, smallest_angles
from assets.simplify.reduce import reduce, refit
from assets.simplify.simplify import SimplifyConfig, simplify


@pytest.mark.parametrize(
    ("sdf", "box", "share", "thin"), [(torus(), BOX, 0.65, 1e-3), (person(), PERSON_BOX, 0.9, 0.2)]
)
@pytest.mark.parametrize("faces", [600, 3000])
def test_a_reduced_surface_lies_nearer_to_the_field_than_a_simplified_one(sdf, box, share, thin, faces):
    dense = trace_adaptively(sdf, box, ExtractConfig(resolution=128), faces).surface
    simple = simplify(dense, SimplifyConfig(target_faces=faces))
    turned = reduce(dense, sdf, faces)
    refitted = refit(turned, sdf)

    assert 0.97 * faces <= len(turned.faces) <= faces
    assert np.array_equal(refitted.faces, turned.faces)
    error = surface_error(refitted, sdf)
    assert error.mean_mm < share * surface_error(simple, sdf).mean_mm
    assert error.mean_mm < surface_error(turned, sdf).mean_mm
    for surface in (turned, refitted):
        assert not find_defects(surface)
    assert (smallest_angles(refitted) < 5).mean() <= thin  # needles are nearest to straight limbs


def test_a_surface_with_few_faces_keeps_them():
    dense = extract(torus(), BOX, ExtractConfig(resolution=16))
    assert len(dense.faces) < 2000
    kept = reduce(dense, torus(), 4000)
    assert len(kept.faces) >= 0.97 * len(dense.faces)
    assert not find_defects(kept)
