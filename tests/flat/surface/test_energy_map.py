"""Where the energy lies: totals that add up, and a peak that is found and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.energy_map import energy_report, place_in_words, smooth_to_vertices
from warpflat.flat.surface.mesh import Surface


def sheet(n: int = 11, *, triangles: bool = False, lines: dict[str, list[int]] | None = None) -> Surface:
    """n by n vertices over 0.1 m by 0.1 m in the XY plane, vertex = row * n + column."""
    y, x = np.meshgrid(np.linspace(0, 0.1, n), np.linspace(0, 0.1, n), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    index = np.arange(n * n).reshape(n, n)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.column_stack([a, b, c, d])
    if triangles:
        none = np.full(len(a), -1)
        faces = np.concatenate([np.column_stack([a, b, c, none]), np.column_stack([a, c, d, none])])
    return Surface(
        vertices=vertices,
        faces=faces.astype(np.int32),
        lines={name: np.array(line, dtype=np.int32) for name, line in (lines or {}).items()},
    )


def vertex_areas(surface: Surface) -> np.ndarray:
    """By hand: a triangle's or quad's area in equal parts to its corners."""
    areas = np.zeros(len(surface.vertices))
    for face in surface.faces:
        corner = face[face >= 0]
        x, y = surface.vertices[corner][:, :2].T
        area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
        areas[corner] += area / len(corner)
    return areas


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("length", [0.0, 0.004, 0.05])
def test_smoothing_conserves_energy_and_a_constant(triangles, length):
    surface = sheet(triangles=triangles)
    rng = np.random.default_rng(1)
    density = rng.exponential(size=len(surface.faces))
    face_area = 0.01 / len(surface.faces)
    smooth = smooth_to_vertices(surface, density, smoothing_length=length)
    assert smooth @ vertex_areas(surface) == pytest.approx(density.sum() * face_area, rel=1e-12)
    assert smooth.min() >= 0
    constant = smooth_to_vertices(surface, np.full(len(density), 3.0), smoothing_length=length)
    np.testing.assert_allclose(constant, 3.0, rtol=1e-12)


def test_smoothing_spreads_a_spike_over_the_given_length_whatever_the_mesh():
    spreads = []
    for n, triangles in ((41, False), (81, False), (61, True)):
        surface = sheet(n, triangles=triangles)
        centre = surface.vertices[surface.faces].mean(axis=1) if not triangles else None
        if centre is None:
            centre = surface.vertices[surface.faces[:, :3]].mean(axis=1)
        hit = int(np.argmin(np.linalg.norm(centre - [0.05, 0.05, 0], axis=1)))
        density = np.zeros(len(surface.faces))
        density[hit] = 1.0
        energy = smooth_to_vertices(surface, density, smoothing_length=0.005) * vertex_areas(surface)
        offset = surface.vertices - centre[hit]
        spreads.append(np.sqrt((energy * offset[:, 0] ** 2).sum() / energy.sum()))
    np.testing.assert_allclose(spreads, 0.005, rtol=0.08)


def test_a_sliver_does_not_make_the_peak_once_smoothed():
    surface = sheet(triangles=True)
    vertices = surface.vertices.copy()
    vertices[60] = vertices[61] + [-1e-7, 1e-9, 0.0]
    thin = Surface(vertices=vertices, faces=surface.faces)
    corner = vertices[thin.faces[:, :3]]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    density = 1.0 + 4.0 * np.exp(-np.sum((corner.mean(axis=1) - [0.02, 0.02, 0]) ** 2, axis=1) / 0.01**2)
    density[np.argsort(area)[:2]] = 1000.0
    smooth = smooth_to_vertices(thin, density, smoothing_length=0.01)
    assert np.isfinite(smooth).all()
    assert np.linalg.norm(vertices[np.argmax(smooth)] - [0.02, 0.02, 0]) < 0.012


def test_a_vertex_without_faces_and_a_face_without_area_have_no_density():
    surface = sheet(3)
    vertices = np.concatenate([surface.vertices, [[1.0, 1.0, 1.0]]])
    faces = np.concatenate([surface.faces, [[0, 0, 0, -1]]]).astype(np.int32)
    odd = Surface(vertices=vertices, faces=faces)
    for length in (0.0, 0.01):
        smooth = smooth_to_vertices(odd, [1.0, 1.0, 1.0, 1.0, 7.0], smoothing_length=length)
        np.testing.assert_allclose(smooth[:9], 1.0)
        assert smooth[9] == 0.0


def test_regions_add_up_to_the_total():
    surface = sheet()
    energy = np.random.default_rng(3).exponential(size=100)
    upper = np.arange(100) >= 50
    bricks = energy_report(surface, energy, regions={"upper": upper, "lower": ~upper, "none": upper & ~upper})["bricks"]
    assert bricks["upper"] == pytest.approx(energy[50:].sum())
    assert bricks["upper"] + bricks["lower"] == pytest.approx(energy.sum())
    assert bricks["none"] == 0.0


def test_a_line_has_its_mean_and_its_highest_density():
    surface = sheet(lines={"level": list(range(55, 66)), "point": [60]})
    # Linear from face to face, and so at the vertices inside.
    density = 2.0 + 30.0 * surface.vertices[surface.faces, 0].mean(axis=1)
    lines = energy_report(surface, density * 1e-4)["lines"]
    at_vertices = np.clip(2.0 + 30.0 * surface.vertices[55:66, 0], 2.15, 4.85)
    assert lines["level"]["length_m"] == pytest.approx(0.1)
    assert lines["level"]["mean_j_per_m2"] == pytest.approx((0.5 * (at_vertices[1:] + at_vertices[:-1])).mean())
    assert lines["level"]["peak_j_per_m2"] == pytest.approx(4.85)
    assert lines["point"] == pytest.approx({"length_m": 0.0, "mean_j_per_m2": 3.5, "peak_j_per_m2": 3.5})


def test_a_place_in_words():
    surface = sheet(
        lines={"bust line": list(range(44, 55)), "princess line": list(range(3, 121, 11)), "hem": list(range(11))}
    )
    assert place_in_words(surface, 6 * 11 + 5) == "20 mm above bust line, 20 mm from princess line"
    assert place_in_words(surface, 4 * 11 + 5) == "on bust line, 20 mm from princess line"
    assert "20 mm below bust line" in place_in_words(surface, 2 * 11 + 2)
    assert place_in_words(sheet(), 24) == "vertex 24 at (0.020, 0.020, 0.000) m"
    # Of a file with further vertices, which no face has, it is the file's.
    read = replace(sheet(), input_vertices=np.zeros((124, 3)), input_index=np.arange(3, 124, dtype=np.int32))
    assert place_in_words(read, 24) == "vertex 27 at (0.020, 0.020, 0.000) m"


def test_the_peak_is_where_most_energy_lies():
    surface = sheet(lines={"middle": list(range(55, 66))})
    centre = surface.vertices[surface.faces].mean(axis=1)
    density = np.exp(-np.sum((centre - [0.05, 0.05, 0.0]) ** 2, axis=1) / 0.02**2)
    report = energy_report(surface, density * 1e-4)
    assert report["peak"] == "on middle"
    assert report["peak_j_per_m2"] == report["lines"]["middle"]["peak_j_per_m2"]
    assert report["peak_j_per_m2"] == pytest.approx(smooth_to_vertices(surface, density)[60])


def test_an_energy_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="face 0 is not finite"):
        energy_report(sheet(), np.r_[np.nan, np.zeros(99)])
