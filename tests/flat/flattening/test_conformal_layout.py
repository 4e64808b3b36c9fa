"""A least-squares conformal layout, from which contact starts."""

import numpy as np
import pytest

from warpflat.flat.flattening.conformal_layout import conformal_layout
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.injective import is_injective
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape


@pytest.mark.parametrize("triangles", [False, True])
def test_what_can_be_unrolled_keeps_its_lengths(triangles: bool) -> None:
    surface = make_shape("cylinder", resolution=17, triangles=triangles)
    layout = conformal_layout(surface)
    a, b = np.concatenate([surface.faces[:, :2], surface.faces[:, 1:3]]).T
    lengths, flat = (np.linalg.norm(p[a] - p[b], axis=1) for p in (surface.vertices, layout))
    np.testing.assert_allclose(flat, lengths, rtol=1e-3)
    assert is_injective(surface, layout)


def test_the_places_of_the_border_that_are_farthest_apart_lie_level() -> None:
    dome = make_shape("dome", resolution=9)
    layout = conformal_layout(make_surface(dome.vertices * [3.0, 1.0, 0.0] + np.array([0.3, 0.0, 0.0]), dome.faces))
    # The ends of one of the two diagonals.
    assert np.abs(layout[[80, 72], 1] - layout[[0, 8], 1]).min() < 1e-9


def test_angles_and_area_of_a_dome_are_kept() -> None:
    surface = make_shape("dome", resolution=33, triangles=True)
    layout = conformal_layout(surface)
    assert is_injective(surface, layout)
    angles = []
    for points in (surface.vertices, layout):
        u, v = (points[surface.faces[:, k]] - points[surface.faces[:, 0]] for k in (1, 2))
        cosine = (u * v).sum(axis=1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
        angles.append(np.degrees(np.arccos(cosine)))
    assert np.abs(angles[1] - angles[0]).mean() < 2.0
    first, second = (layout[surface.faces[:, k]] - layout[surface.faces[:, 0]] for k in (1, 2))
    area = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    assert (area > 0.0).all()
    assert area.sum() == pytest.approx(make_cells(surface).area.sum())
