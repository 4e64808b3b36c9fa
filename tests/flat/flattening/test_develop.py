"""The first layout: profiles, geodesics, the map that cannot fold, and the datum."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from surface_meshes import quads_between

from warpflat.core.errors import InputError
from warpflat.flat.flattening.datum import choose_datum
from warpflat.flat.flattening.develop import develop, flat_layout, geodesic_layout, profile_layout
from warpflat.flat.flattening.harmonic_layout import harmonic_layout
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.half_edges import mesh_edges
from warpflat.flat.surface.injective import winds_twice
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.band import line_along_band
from warpflat.flat.surface.paths.lines import line_from_indices
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.triangles import triangulate
from warpflat.flat.surface.untangle import signed_cell_areas, untangle

FloatArray = NDArray[np.float64]


def mirrored(surface: Surface, positions: FloatArray) -> int:
    return int((signed_cell_areas(make_cells(surface).corner, positions) <= 0).sum())


def edge_errors(surface: Surface, positions: FloatArray) -> FloatArray:
    edges = mesh_edges(surface.faces)
    in_space = np.linalg.norm(np.diff(surface.vertices[edges], axis=1)[:, 0], axis=1)
    return np.abs(np.linalg.norm(np.diff(positions[edges], axis=1)[:, 0], axis=1) / in_space - 1.0)


def disk(count: int, height, *, seed: int = 0, noise: float = 0.0) -> Surface:
    """Random triangles over the unit disc, at z = height(x, y)."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(seed)
    inner = rng.uniform(-1, 1, (count, 2))
    inner = inner[np.linalg.norm(inner, axis=1) < 0.93]
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.concatenate([inner, np.column_stack([np.cos(turn), np.sin(turn)])])
    z = height(points[:, 0], points[:, 1]) + noise * rng.normal(size=len(points))
    return make_surface(np.column_stack([points, z]), Delaunay(points).simplices)


def ring(inner: float, outer: float, *, height: float = 0.0, around: int = 24, across: int = 5) -> Surface:
    """A closed band of quads between two circles, the inner one so much higher."""
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    share = np.linspace(0, 1, across)
    radius = outer + (inner - outer) * share
    x, y = radius[:, None] * np.cos(turn), radius[:, None] * np.sin(turn)
    points = np.stack([x, y, np.broadcast_to(height * share[:, None], x.shape)], axis=-1).reshape(-1, 3)
    i = np.arange(around * across).reshape(across, around)
    right = np.roll(i, -1, axis=1)
    return make_surface(points, np.stack([i[:-1], right[:-1], right[1:], i[1:]], axis=-1).reshape(-1, 4))


# --- flat pieces


def turned(surface: Surface, *, seed: int, offset: float = 0.0) -> Surface:
    """Anywhere in space."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.random(random_state=seed).as_matrix()
    return make_surface(surface.vertices @ rotation.T + offset, surface.faces)


@pytest.mark.parametrize("seed", range(4))
def test_a_flat_piece_gives_itself(seed: int):
    """A narrow ring, whose faces the geodesic layout mirrors, and any triangles; told the same from rounded coordinates."""
    for whole in (ring(0.185, 0.2, around=96, across=9), disk(150, lambda x, y: 0.0 * x, seed=seed)):
        surface = turned(whole, seed=seed, offset=0.5)
        datum = choose_datum(surface)[0]
        development = develop(surface, datum)
        assert (development.method, development.notes) == ("flat", ())
        assert mirrored(surface, development.positions) == 0
        assert edge_errors(surface, development.positions).max() < 1e-12
        chord = np.diff(development.positions[datum[[0, -1]]], axis=0)[0]
        assert abs(chord[0]) < 1e-12 < chord[1]
        rough = make_surface(surface.vertices.astype(np.float32).astype(float), surface.faces)
        assert develop(rough, datum).method == "flat"


def test_a_flat_sheet_folded_over_is_not_taken_as_it_lies():
    """Half of its faces would be mirrored."""
    x, y = np.meshgrid(np.linspace(-0.3, 0.4, 8), np.linspace(0, 0.4, 5))
    i = np.arange(x.size).reshape(x.shape)
    quads = quads_between(i)
    surface = make_surface(np.stack([np.abs(x), y, 0.0 * x], axis=-1).reshape(-1, 3), quads)
    development = develop(surface, i[:, 0].astype(np.int32))
    assert development.method == "profiles"
    assert edge_errors(surface, development.positions).max() < 1e-12


def test_a_piece_a_little_bent_is_not_flat():
    surface = disk(150, lambda x, y: 1e-3 * x * y)
    assert flat_layout(surface, choose_datum(surface)[0]) is None


# --- profiles


@pytest.mark.parametrize("line", ["column", "row", "first column", "last row"])
@pytest.mark.parametrize("reverse", [False, True], ids=["up", "down"])
@pytest.mark.parametrize("turned", [False, True], ids=["face up", "face down"])
def test_profiles_run_out_from_any_row_or_column_of_a_grid(line: str, reverse: bool, turned: bool):
    """And give the same, however the grid is numbered."""
    whole = make_shape("bodice", resolution=9)
    grid = np.arange(81).reshape(9, 9)
    datum = {"column": grid[:, 3], "row": grid[5], "first column": grid[:, 0], "last row": grid[-1]}[line]
    number = np.random.default_rng(3).permutation(81).astype(np.int32)
    vertices = np.empty_like(whole.vertices)
    vertices[number] = whole.vertices
    faces = number[whole.faces[np.random.default_rng(4).permutation(64)]]
    datum = datum[:: -1 if reverse else 1].astype(np.int32)
    plain = profile_layout(make_surface(whole.vertices, whole.faces[:, :: -1 if turned else 1]), datum)
    surface = make_surface(vertices, faces[:, :: -1 if turned else 1])
    positions = profile_layout(surface, number[datum])
    assert plain is not None
    assert positions is not None
    assert np.linalg.norm(plain[datum[0]]) == 0.0
    assert mirrored(surface, positions) == 0
    np.testing.assert_array_equal(positions[number], plain)


def test_profiles_run_out_from_the_datum_at_their_arc_lengths():
    surface = make_shape("bodice", resolution=9)
    positions = profile_layout(surface, surface.lines["centre"])
    assert positions is not None
    p, flat = surface.vertices.reshape(9, 9, 3), positions.reshape(9, 9, 2)
    steps = np.linalg.norm(np.diff(p[:, 4], axis=0), axis=1)
    np.testing.assert_allclose(flat[:, 4, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(flat[:, 4, 1], np.concatenate([[0.0], np.cumsum(steps)]), rtol=1e-12)
    for row in range(9):
        np.testing.assert_allclose(flat[row, :, 1], flat[row, 4, 1], rtol=1e-12)
        np.testing.assert_allclose(
            np.diff(flat[row, :, 0]), np.linalg.norm(np.diff(p[row], axis=0), axis=1), rtol=1e-12
        )


def test_profiles_may_end_at_different_places():
    """An armhole: the upper profiles are shorter."""
    surface = make_shape("bodice", resolution=9)
    column = np.arange(64) % 8
    row = np.arange(64) // 8
    keep = (row < 4) | ((column >= 2) & (column < 6)) | ((row == 4) & (column >= 1))
    ragged = make_surface(surface.vertices, surface.faces[keep], lines={"centre": surface.lines["centre"]})
    positions = profile_layout(ragged, ragged.lines["centre"])
    assert positions is not None
    whole = profile_layout(surface, surface.lines["centre"])
    assert whole is not None
    np.testing.assert_allclose(positions, whole[ragged.input_index], rtol=1e-12)
    assert develop(ragged, ragged.lines["centre"]).method == "profiles"
    assert mirrored(ragged, positions) == 0


def test_profiles_go_on_past_holes():
    """What lies beyond the second hole is reached only along the row of the first."""
    surface = make_shape("bodice", resolution=9)
    holes = make_surface(surface.vertices, np.delete(surface.faces, [8 * 3 + 3, 8 * 4 + 1], axis=0))
    line = surface.lines["centre"]
    np.testing.assert_array_equal(profile_layout(holes, line), profile_layout(surface, line))


def test_profiles_around_a_tube_have_no_end():
    tube = ring(0.1, 0.1, height=0.3)
    assert profile_layout(tube, line_from_indices(tube, [24 * k for k in range(5)])) is None


def test_a_datum_at_the_side_or_an_upside_down_one_gives_the_same_piece():
    surface = make_shape("dome", resolution=9)
    for line in (surface.lines["left"], surface.lines["right"], surface.lines["centre"][::-1].copy()):
        development = develop(surface, line)
        assert development.method == "profiles"
        assert mirrored(surface, development.positions) == 0


@pytest.mark.parametrize("line", ["bent", "triangles"], ids=["a datum that turns a corner", "a mesh of triangles"])
def test_what_is_no_grid_has_no_profiles(line: str):
    surface = make_shape("dome", resolution=9, triangles=line == "triangles")
    datum = np.array([0, 1, 10, 19]) if line == "bent" else surface.lines["centre"]
    assert profile_layout(surface, np.asarray(datum, dtype=np.int32)) is None


# --- cracks


def opened(whole: Surface, path: NDArray[np.int32], **lines: NDArray[np.int32]) -> tuple[Surface, NDArray[np.int32]]:
    """The surface with a crack along a path, and for each vertex the one that it was."""
    made = cut_along(whole.faces, [path], vertex_count=len(whole.vertices))
    surface = make_surface(whole.vertices[made.vertex_origin], made.faces, lines=lines)
    return surface, made.vertex_origin[surface.input_index]


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("rows", [slice(0, 9), slice(5, 13)], ids=["from the border", "inside"])
def test_a_piece_with_a_crack_is_developed_as_if_it_had_none(triangles: bool, rows: slice):
    whole = make_shape("dome", resolution=17, triangles=triangles)
    centre = whole.lines["centre"]
    surface, origin = opened(whole, np.arange(17 * 17, dtype=np.int32).reshape(17, 17)[rows, 5], centre=centre)
    assert len(surface.vertices) > len(whole.vertices)
    development, before = develop(surface, surface.lines["centre"]), develop(whole, centre)
    assert development.method == before.method == ("geodesic" if triangles else "profiles")
    assert mirrored(surface, development.positions) == 0
    np.testing.assert_allclose(development.positions, before.positions[origin], atol=1e-12)
    assert "closed" in development.notes[0]


def test_a_tube_cut_open_is_not_closed_again():
    whole = ring(0.1, 0.1, height=0.3)
    column = np.arange(24 * 5, dtype=np.int32).reshape(5, 24)
    surface, _ = opened(whole, column[:, 3], front=column[:, 15])
    development = develop(surface, surface.lines["front"])
    assert development.notes == ()
    assert mirrored(surface, development.positions) == 0
    np.testing.assert_allclose(edge_errors(surface, development.positions), 0.0, atol=1e-12)


# --- geodesics


@pytest.mark.parametrize("shape", ["cylinder", "cone", "strip"])
def test_geodesics_lay_developable_triangles_out_exactly(shape: str):
    angle = {"angle": 60.0} if shape == "cone" else {}
    surface = make_shape(shape, resolution=17, triangles=True, **angle)
    positions = geodesic_layout(surface, surface.lines["centre"])
    # the cone's upper border is hollow: ways to places beyond the datum's end would lead through the air
    reached = positions[:, 1] < (0.7 * positions[:, 1].max() if shape == "cone" else np.inf)
    inside = reached[mesh_edges(surface.faces)].all(axis=1)
    assert inside.mean() > 0.6
    assert edge_errors(surface, positions)[inside].max() < 1e-6


def test_the_development_of_triangles_is_by_geodesics():
    surface = make_shape("dome", resolution=17, triangles=True)
    development = develop(surface, surface.lines["centre"])
    assert development.method == "geodesic"
    np.testing.assert_array_equal(development.positions, geodesic_layout(surface, surface.lines["centre"]))
    assert not development.mended


def test_a_large_layout_is_smoothed_by_coarser_meshes_before_it_is_given_up(monkeypatch: pytest.MonkeyPatch):
    surface = make_shape("dome", resolution=81, triangles=True)
    datum = surface.lines["centre"]
    exact = geodesic_layout(surface, datum)
    edge = np.linalg.norm(exact[1] - exact[0])
    noisy = exact + 0.25 * edge * np.random.default_rng(0).normal(size=exact.shape)
    assert 100 < crushed_faces(surface, noisy) < 0.1 * len(surface.faces)
    monkeypatch.setattr("warpflat.flat.flattening.develop.geodesic_layout", lambda *_: noisy)
    # that the faces themselves cannot be turned back
    monkeypatch.setattr(
        "warpflat.flat.flattening.develop.untangle",
        lambda surface, flat, **given: (flat, 1) if flat is noisy else untangle(surface, flat, **given),
    )
    development = develop(surface, datum)
    assert development.method == "geodesic"
    assert "smoothed by a coarser mesh" in development.notes[-1]
    assert crushed_faces(surface, development.positions) == 0
    assert np.linalg.norm(development.positions - exact, axis=1).max() < 2 * edge
    monkeypatch.setattr("warpflat.flat.flattening.develop._LARGE", len(surface.vertices))
    assert develop(surface, datum).method == "harmonic"


# --- the map that cannot fold


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["bowl", "noise", "steep"])
def test_the_harmonic_map_has_no_mirrored_cell(kind: str, seed: int):
    heights = {
        "bowl": lambda x, y: 2.0 * (x**2 + y**2),
        "noise": lambda x, y: 0 * x,
        "steep": lambda x, y: 1.5 * np.sin(4 * x) * np.cos(5 * y),
    }
    surface = disk(300, heights[kind], seed=seed, noise=0.3 if kind == "noise" else 0.0)
    positions = harmonic_layout(surface)
    assert mirrored(surface, positions) == 0
    p = surface.vertices[triangulate(surface.faces)[0]]
    area = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()
    size = np.linalg.norm(positions, axis=1).max()
    assert np.pi * size**2 == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
def test_more_than_a_hemisphere_is_laid_out_without_a_mirrored_cell(triangles: bool):
    surface = make_shape("hemisphere", opening=115.0, resolution=17, triangles=triangles)
    development = develop(surface, surface.lines["centre"])
    assert mirrored(surface, development.positions) == 0
    chord = development.positions[surface.lines["centre"][[0, -1]]]
    assert chord[1, 1] > chord[0, 1]


@pytest.mark.parametrize("seed", range(6))
def test_whatever_the_mesh_the_first_layout_is_unfolded_and_says_how_it_came_about(seed: int):
    surface = disk(250, lambda x, y: 1.2 * np.sin(3 * x + seed) * np.cos(2 * y), seed=seed, noise=0.05)
    datum = choose_datum(surface)[0]
    development = develop(surface, datum)
    assert mirrored(surface, development.positions) == 0
    assert np.isfinite(development.positions).all()
    folded = crushed_faces(surface, geodesic_layout(surface, datum))
    assert (development.notes == ()) == (folded == 0)
    # of 400 faces more than five are too many
    assert development.mended == (folded > 5)


def crushed_faces(surface: Surface, positions: FloatArray) -> int:
    cells = make_cells(surface)
    crushed = signed_cell_areas(cells.corner, positions) * cells.weight <= 0.01 * cells.area
    return len(np.unique(cells.face[crushed]))


def test_a_layout_that_winds_twice_is_not_taken_for_unfolded():
    """A ruled ramp, the shape of a spiral stair of more than a turn, has every cell the right way up all the same."""
    turns, columns = np.linspace(0, 1.3 * 2 * np.pi, 41), np.linspace(0.2, 1.0, 5)
    x, y = columns[None] * np.cos(turns)[:, None], columns[None] * np.sin(turns)[:, None]
    z = np.broadcast_to(0.02 * turns[:, None], x.shape)
    i = np.arange(x.size).reshape(x.shape)
    quads = quads_between(i)
    surface = make_surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), quads, lines={"inside": i[:, 0]})
    development = develop(surface, surface.lines["inside"])
    assert mirrored(surface, development.positions) == 0


def fan(turns: float, *, closed: bool) -> tuple[Surface, FloatArray]:
    """Twelve triangles around vertex 0, and a layout in which they go around it so many times."""
    rim = 2 * np.pi * np.arange(12 if closed else 13) / 12
    points = np.column_stack([np.cos(rim), np.sin(rim), 0.2 * np.cos(3 * rim)])
    if not closed:
        points[-1] += [0.0, -0.1, 0.5]
    k = np.arange(1, len(rim) + 1)
    faces = np.column_stack([np.zeros_like(k), k, np.roll(k, -1)])[: 12 if closed else -1]
    surface = make_surface(np.vstack([[[0.0, 0.0, 0.1]], points]), faces)
    return surface, np.vstack([[[0.0, 0.0]], np.column_stack([np.cos(turns * rim + 0.1), np.sin(turns * rim + 0.1)])])


@pytest.mark.parametrize(
    ("turns", "closed", "twice"),
    [(1, True, False), (2, True, True), (0.9, False, False), (1.05, False, True), (2.4, False, True)],
)
def test_faces_that_go_around_a_vertex_by_more_than_a_turn_are_found(turns: float, closed: bool, twice: bool):
    surface, positions = fan(turns, closed=closed)
    assert mirrored(surface, positions) == 0
    assert winds_twice(surface, make_cells(surface), positions) == twice


# --- rings and tubes


def test_a_flat_ring_is_laid_out():
    surface = ring(0.1, 0.3)
    for given in (choose_datum(surface)[0], line_from_indices(surface, [0, 24, 48, 72, 96])):
        development = develop(surface, given)
        assert mirrored(surface, development.positions) == 0


def test_a_shallow_ring_is_laid_out_and_a_tube_is_refused_with_what_to_do():
    surface = ring(0.1, 0.3, height=0.05)
    assert mirrored(surface, develop(surface, choose_datum(surface)[0]).positions) == 0
    tube = ring(0.29, 0.3, height=0.5, across=9)
    with pytest.raises(
        InputError, match=r"closed tube .* cm long, runs around it at vertex \d+\): cut it open"
    ) as told:
        develop(tube, line_from_indices(tube, [24 * k for k in range(9)]))
    assert "\n" not in str(told.value)


# --- the datum


def test_the_datum_runs_up_the_long_axis_through_the_middle():
    surface = make_shape("strip", resolution=33)
    np.testing.assert_array_equal(choose_datum(surface)[0], surface.lines["centre"])
    surface = make_shape("cylinder", resolution=17, height=0.8)
    np.testing.assert_array_equal(choose_datum(surface)[0], surface.lines["centre"])


@pytest.mark.parametrize("columns", [2, 3, 4, 9, 10, 11])
@pytest.mark.parametrize("cells", ["quads", "triangles"])
@pytest.mark.parametrize("bent", [False, True], ids=["flat", "bent"])
def test_the_datum_of_a_rectangle_is_parallel_to_its_sides(columns: int, cells: str, bent: bool):
    """However many columns: with an even number the middle lies halfway between two."""
    x, y = np.meshgrid(np.linspace(0, 0.27, columns), np.linspace(0, 0.4, 15))
    if bent:
        points = np.stack([0.3 * np.sin(x / 0.3), y, 0.3 * np.cos(x / 0.3)], axis=-1)
    else:
        points = np.stack([x, y, 0.0 * x], axis=-1)
    quads = quads_between(x.shape)
    faces = quads if cells == "quads" else quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    line = choose_datum(make_surface(points.reshape(-1, 3), faces))[0]
    column = line % columns
    assert len(line) == 15
    assert (column == column[0]).all()
    assert column[0] in {(columns - 1) // 2, columns // 2}


@pytest.mark.parametrize("name", ["dome", "saddle", "bodice", "hemisphere"])
def test_pieces_about_as_wide_as_long_hang_down(name: str):
    surface = make_shape(name, resolution=17)
    line = surface.vertices[choose_datum(surface)[0]]
    assert line[-1, 1] > line[0, 1]
    assert np.ptp(line[:, 1]) > 0.8 * np.ptp(surface.vertices[:, 1])
    assert np.ptp(line[:, 0]) < 0.2 * np.ptp(surface.vertices[:, 0])


def leaning(surface: Surface, line: NDArray[np.int32], axis: NDArray[np.float64]) -> float:
    """Degrees between the chord of a line and an axis."""
    chord = surface.vertices[line[-1]] - surface.vertices[line[0]]
    return float(np.degrees(np.arccos(np.clip(chord @ axis / np.linalg.norm(chord), -1.0, 1.0))))


@pytest.mark.parametrize(
    ("turned", "leans", "told"),
    [
        (0, 0, "upright through the middle, the piece being about as wide as long"),
        (8, 8, "upright through the middle, the piece being about as wide as long"),
        (20, 0, "along the long axis through the middle, the more upright of two about as long"),
        (70, 90, "along the short axis through the middle, the more upright of two about as long"),
        (83, 83, "upright through the middle, the piece being about as wide as long"),
    ],
)
def test_a_piece_about_as_wide_as_long_that_lies_askew_keeps_to_its_nearer_axis(turned: int, leans: int, told: str):
    x, y = np.meshgrid(np.linspace(-0.15, 0.15, 31), np.linspace(-0.175, 0.175, 36))
    angle = np.radians(turned)
    along = np.array([np.sin(angle), np.cos(angle), 0.0])
    points = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3) @ np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], along, [0.0, 0.0, 1.0]]
    )
    quads = quads_between(x.shape)
    surface = make_surface(points, quads)
    line, said = choose_datum(surface)
    assert said == told
    assert leaning(surface, line, along) == pytest.approx(leans, abs=2.5)


def test_the_choice_does_not_depend_on_the_numbering_or_the_place():
    surface = make_shape("bodice", resolution=17, triangles=True)
    line = choose_datum(surface)[0]
    np.testing.assert_array_equal(line, choose_datum(surface)[0])
    order = np.random.default_rng(3).permutation(len(surface.vertices))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    faces = np.where(surface.faces >= 0, place[surface.faces], -1)
    shuffled = make_surface(surface.vertices[order] + [0.3, -2.0, 1.0], faces)
    np.testing.assert_array_equal(order[choose_datum(shuffled)[0]], line)


def band(
    inner: float,
    outer: float,
    turn: float,
    *,
    rows: int,
    height: float = 0.0,
    columns: int = 60,
    triangles: bool = False,
) -> Surface:
    """A band around the y axis through an angle, the outer border so much lower; vertex `rows + 1` times column plus row."""
    angle, share = np.meshgrid(np.linspace(0, turn, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    radius = inner + (outer - inner) * share
    points = np.stack([radius * np.cos(angle), -height * share, radius * np.sin(angle)], axis=-1).reshape(-1, 3)
    quads = quads_between((columns + 1, rows + 1), turned=True)
    return make_surface(points, quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3) if triangles else quads)


@pytest.mark.parametrize("triangles", [False, True], ids=["quads", "triangles"])
@pytest.mark.parametrize("turn", [240, 300, 355])
@pytest.mark.parametrize(("inner", "height"), [(0.12, 0.05), (0.10, 0.0)], ids=["waistband", "neck facing"])
def test_the_datum_of_a_curled_band_runs_through_its_middle_from_end_to_end(inner, height, turn, triangles):
    surface = band(inner, 0.14, np.radians(turn), rows=4, height=height, triangles=triangles)
    line = choose_datum(surface)[0]
    middle = np.arange(61) * 5 + 2
    assert np.array_equal(line, middle) or np.array_equal(line, middle[::-1])
    development = develop(surface, line)
    assert development.method == ("flat" if height == 0 else "geodesic" if triangles else "profiles")
    assert development.notes == ()


def test_the_datum_of_a_strip_one_face_wide_runs_along_one_side():
    """It has no middle, and a line from corner to corner would cross it somewhere."""
    surface = band(0.1, 0.105, np.radians(340), rows=1)
    line = choose_datum(surface)[0]
    assert len(line) == 61
    assert len(set((line % 2).tolist())) == 1
    layout = profile_layout(surface, line)
    assert layout is not None
    assert mirrored(surface, layout) == 0


def test_the_datum_of_a_band_of_any_triangles_and_with_holes_ends_at_its_ends():
    whole = band(0.10, 0.14, np.radians(320), rows=6, columns=120)
    for surface in (
        make_surface(whole.vertices, np.delete(whole.faces, [6 * 10 + 2, 6 * 60 + 3], axis=0)),
        scattered_band(0.10, 0.14, np.radians(320), seed=2),
    ):
        line = surface.vertices[choose_datum(surface)[0]]
        angle = np.sort(np.arctan2(line[[0, -1], 2], line[[0, -1], 0]) % (2 * np.pi))
        np.testing.assert_allclose(angle, [0.0, np.radians(320)], atol=1e-9)
        radius = np.hypot(line[:, 0], line[:, 2])
        assert radius.min() > 0.105
        assert radius.max() < 0.135


def scattered_band(inner: float, outer: float, turn: float, *, seed: int) -> Surface:
    """A flat band of random triangles."""
    from scipy.spatial import Delaunay

    length, width = turn * (inner + outer) / 2, outer - inner
    rng = np.random.default_rng(seed)
    edges = np.linspace(0, 1, 81), np.linspace(0, 1, 6)
    sides = [np.column_stack([edges[0], np.full(81, row)]) for row in (0.0, 1.0)]
    ends = [np.column_stack([np.full(4, column), edges[1][1:-1]]) for column in (0.0, 1.0)]
    share = np.concatenate([rng.uniform(0.03, 0.97, (500, 2)), *sides, *ends])
    radius, angle = inner + width * share[:, 1], turn * share[:, 0]
    points = np.column_stack([radius * np.cos(angle), np.zeros(len(share)), radius * np.sin(angle)])
    return make_surface(points, Delaunay(share * [length, width]).simplices)


@pytest.mark.parametrize(("strap", "height"), [(3, 35), (2, 45)], ids=["front", "bib"])
def test_a_front_with_a_deep_neckline_keeps_its_short_centre_line(strap: int, height: int):
    """No band, however long the way from strap to strap."""
    cells = [(i, j) for i in range(24) for j in range(height) if j < 12 or i < strap or i >= 24 - strap]
    number: dict[tuple[int, int], int] = {}
    faces = [
        [number.setdefault(at, len(number)) for at in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
        for i, j in cells
    ]
    surface = make_surface(np.array([(0.02 * i, 0.02 * j, 0.0) for i, j in number]), np.array(faces))
    line = surface.vertices[choose_datum(surface)[0]]
    np.testing.assert_allclose(line[:, 0], 0.24, atol=1e-12)
    assert len(line) == 13


def test_a_ring_has_no_ends_and_no_such_line():
    surface = ring(0.18, 0.2, around=48, across=3)
    assert line_along_band(surface, np.array([0, 48, 96], dtype=np.int32)) is None


@pytest.mark.parametrize("seed", range(4))
def test_any_piece_has_a_datum_along_its_edges(seed: int):
    surface = disk(150, lambda x, y: x * y, seed=seed)
    line = choose_datum(surface)[0]
    assert len(line) >= 2
    assert len(np.unique(line)) == len(line)
    edges = {tuple(edge) for edge in mesh_edges(surface.faces).tolist()}
    assert all((min(a, b), max(a, b)) in edges for a, b in zip(line[:-1].tolist(), line[1:].tolist(), strict=True))
