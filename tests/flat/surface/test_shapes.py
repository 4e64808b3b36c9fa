from __future__ import annotations

import math

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.shapes import SHAPES, make_shape


def line_length(surface, name: str) -> float:
    return float(np.linalg.norm(np.diff(surface.vertices[surface.lines[name]], axis=0), axis=1).sum())


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_is_one_sheet_seen_from_outside(name: str, triangles: bool):
    surface = make_shape(name, resolution=17, triangles=triangles)
    assert surface.name == name
    assert not surface.notes
    assert surface.is_quad.all() != triangles
    assert len(border_loops(surface.faces)) == 1
    corners = surface.vertices[surface.faces[:, :3]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = np.abs(corners[:, :, 0].mean(axis=1)) < 0.3 * np.ptp(surface.vertices[:, 0])
    assert (normals[middle & (corners[:, :, 2].mean(axis=1) > 0.0), 2] > 0.0).all()
    assert {"centre", "left", "right", "bottom", "top"} <= set(surface.lines)
    up = surface.vertices[surface.lines["centre"], 1]
    assert (np.diff(up) > 0.0).all()
    assert surface.vertices[surface.lines["left"], 0].mean() < surface.vertices[surface.lines["right"], 0].mean()


def test_the_spheres_are_spheres():
    np.testing.assert_allclose(np.linalg.norm(make_shape("dome").vertices, axis=1), 0.45)
    cap = make_shape("hemisphere", radius=0.3, opening=70.0)
    np.testing.assert_allclose(np.linalg.norm(cap.vertices, axis=1), 0.3)
    border = border_loops(cap.faces)[0]
    np.testing.assert_allclose(cap.vertices[border, 2], 0.3 * math.cos(math.radians(70.0)))


def test_the_bodice_has_the_published_waist_and_bust():
    vertices = make_shape("bodice", resolution=91).vertices
    at = {round(0.005 * row, 3): vertices[row * 91 : (row + 1) * 91] for row in range(91)}
    assert np.ptp(at[0.1][:, 0]) == pytest.approx(2 * 0.170 * 0.8, rel=1e-6)
    assert at[0.1][45, 2] == pytest.approx(0.115 * 0.8, rel=1e-6)
    reach = np.linalg.norm(at[0.28][:, [0, 2]], axis=1) - np.linalg.norm(at[0.0][:, [0, 2]], axis=1)
    assert reach[[29, 61]] == pytest.approx(reach.max(), rel=0.05)


def test_developable_shapes_have_their_known_measures():
    tube = make_shape("cylinder", radius=0.1, height=0.5, angle=90.0, resolution=129)
    assert line_length(tube, "bottom") == pytest.approx(0.1 * math.pi / 2, rel=1e-4)
    assert line_length(tube, "left") == pytest.approx(0.5)
    skirt = make_shape("cone", bottom=0.3, top=0.1, height=0.4, angle=180.0, resolution=129)
    assert line_length(skirt, "left") == pytest.approx(math.hypot(0.2, 0.4))
    assert line_length(skirt, "top") == pytest.approx(0.1 * math.pi, rel=1e-4)
    strip = make_shape("strip", amplitude=0.0, length=0.6, width=0.12)
    assert line_length(strip, "centre") == pytest.approx(0.6)
    assert line_length(strip, "top") == pytest.approx(0.12)
    saddle = make_shape("saddle", curvature=0.0)
    np.testing.assert_array_equal(saddle.vertices[:, 2], 0.0)


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("dmoe", {}, "unknown shape 'dmoe'; did you mean 'dome'"),
        ("dome", {"sise": 0.4}, "sise: unknown key 'sise' for shape 'dome'; did you mean 'size'"),
        ("dome", {"size": 0.7}, "radius = 0.45 m; must lie between"),
        ("dome", {"size": math.nan}, "size = nan; must lie between"),
        ("dome", {"resolution": 2}, "resolution = 2; must lie between 3 and 2048"),
        ("dome", {"resolution": 9.0}, "resolution: should be a whole number"),
        ("strip", {"resolution": 1}, "resolution = 1"),
        ("cone", {"top": 0.0}, "top = 0; must lie between"),
        ("cone", {"angle": 360}, "angle = 360; must lie between 1 and 359"),
        ("cylinder", {"radius": "big"}, "radius: should be a number, such as 0.15, got 'big'"),
        ("cylinder", {"triangles": 1}, "triangles: should be true or false"),
        ("hemisphere", {"opening": 150.0}, "opening = 150; must lie between 1 and 120"),
        ("saddle", {"curvature": -1.0}, "curvature = -1; must lie between"),
    ],
)
def test_wrong_parameters_are_refused(name: str, parameters: dict, message: str):
    with pytest.raises(InputError, match=message):
        make_shape(name, **parameters)


def test_parameters_may_be_numbers_of_numpy():
    made = make_shape("dome", resolution=np.int64(5), radius=np.float32(0.5))
    assert len(made.vertices) == 25
    with pytest.raises(InputError, match="resolution: should be a whole number"):
        make_shape("dome", resolution=np.float64(5.0))
    with pytest.raises(InputError, match="resolution: should be a whole number"):
        make_shape("dome", resolution=True)
