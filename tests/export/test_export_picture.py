from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from export_meshes import cut_up_the_middle, dome, grid, mixed, surface

from warpflat.export import PicturePiece, write_picture
from warpflat.export.colours import SMALLEST_SCALE, energy_colours, energy_scale, weighted_percentile
from warpflat.export.geometry import corner_average, face_areas, outline_edges
from warpflat.export.labels import LabelRoom, Spot, along_line, beyond_ends
from warpflat.export.raster import interpolate, rasterise, reduce_samples
from warpflat.surface.topology import border_edges, triangulate


def piece_of(shape, density=None, **options) -> PicturePiece:
    count = len(shape.faces)
    given = {
        "name": shape.name,
        "surface": shape,
        "faces": shape.faces,
        "positions": shape.vertices[:, :2],
        "face_energy_density": np.linspace(0.0, 1.0, count) if density is None else density,
        "lines": shape.lines,
    }
    return PicturePiece(**(given | options))


def pixels_of(path: Path) -> np.ndarray:
    from matplotlib.image import imread

    return imread(path)[..., :3]


def near(pixels: np.ndarray, colour: np.ndarray, tolerance: float = 0.02) -> int:
    return int((np.abs(pixels - colour).max(axis=-1) < tolerance).sum())


def test_picture_shows_both_views_in_the_colours_of_the_scale(tmp_path: Path) -> None:
    shape = dome(9)
    write_picture(tmp_path / "a.png", [piece_of(shape, datum="centre front", captions={"fabric": "poplin"})], scale=1.0)
    pixels = pixels_of(tmp_path / "a.png")
    height, width, _ = pixels.shape
    assert width == 1875
    assert 700 < height < 1300
    assert len(np.unique((pixels * 255).astype(int) @ (1 << 16, 1 << 8, 1))) > 1000
    pattern = pixels[:, width // 2 : int(0.87 * width)]
    for density in np.linspace(0.0, 1.0, 64)[::9]:
        # A face is about 80 pixels wide; lines and the mesh take some of it.
        assert near(pattern, energy_colours(density, 1.0)) > 2000
    body = pixels[:, : width // 2]
    assert (body.min(axis=-1) < 0.9).sum() > 100_000
    assert near(pixels, np.ones(3)) > 0.4 * height * width


def test_pieces_are_rows_and_share_the_scale(tmp_path: Path) -> None:
    whole, half = piece_of(dome(5), np.full(16, 1.0)), piece_of(dome(5, "half"), np.full(16, 0.5))
    write_picture(tmp_path / "two.png", [whole, half])
    two = pixels_of(tmp_path / "two.png")
    upper, lower = np.split(two[:, : int(0.87 * two.shape[1])], [two.shape[0] // 2])
    assert near(upper, energy_colours(1.0, 1.0)) > 50_000
    assert near(lower, energy_colours(0.5, 1.0)) > 50_000
    assert near(upper, energy_colours(0.5, 1.0)) < 500


def test_all_kinds_of_pieces_can_be_drawn(tmp_path: Path) -> None:
    index, quads = grid(41, 3)
    x, y = np.meshgrid(np.linspace(0.0, 1.5, 41), np.linspace(0.0, 0.04, 3))
    bent = np.stack([0.3 * np.sin(x / 0.3), y, 0.3 * np.cos(x / 0.3)], axis=-1).reshape(-1, 3)
    strip = surface(bent, quads, "strip", fold=index[:, 20], edge=index[0])
    flat_strip = np.stack([x, y], axis=-1).reshape(-1, 2)
    quad = surface(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]) * 2e-3, np.array([[0, 1, 2, 3]], np.int32))
    whole = dome(9)
    faces, to_surface, crack = cut_up_the_middle(whole, 9, 4)
    ground = surface(whole.vertices[:, [0, 2, 1]], whole.faces[:, ::-1].copy(), "ground")
    holed = surface(
        whole.vertices, np.delete(whole.faces, [20, 21, 28], axis=0), "holed", across=whole.lines["bust line"]
    )
    pieces = [
        piece_of(strip, positions=flat_strip, datum="fold"),
        piece_of(quad, np.zeros(1)),
        piece_of(mixed(), np.array([1.0, 2.0, 1e9])),
        piece_of(
            whole, faces=faces, positions=whole.vertices[to_surface, :2], lines={"dart $x_1": crack}, datum="none"
        ),
        piece_of(ground, positions=ground.vertices[:, [0, 2]]),
        piece_of(holed, datum="across"),
    ]
    write_picture(tmp_path / "a.png", pieces)
    assert (pixels_of(tmp_path / "a.png").min(axis=-1) < 0.9).mean() > 0.05


def test_a_picture_needs_a_piece(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one"):
        write_picture(tmp_path / "a.png", [])


def test_scale_is_robust_by_area_and_readable() -> None:
    assert energy_scale([1.0, 1.0, 100.0], [1.0, 1.0, 0.01]) == 1.0
    assert energy_scale([1.0, 100.0], [1.0, 1.0]) == 100.0
    assert energy_scale([0.21], [1.0]) == 0.25
    assert energy_scale([0.85], [1.0]) == 1.0
    assert energy_scale([0.0, 1e-12], [1.0, 1.0]) == SMALLEST_SCALE
    assert energy_scale([], []) == SMALLEST_SCALE
    assert weighted_percentile([3.0, 1.0, 2.0], [1.0, 1.0, 2.0], 0.5) == 2.0


def test_colours_darken_with_energy() -> None:
    lightness = energy_colours(np.linspace(0.0, 1.0, 50), 1.0) @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness) < 0).all()
    np.testing.assert_array_equal(energy_colours([5.0], 1.0), energy_colours([1.0], 1.0))


def test_raster_covers_each_sample_once_and_keeps_the_nearest() -> None:
    # A square as two triangles, wound either way, and a nearer small triangle on top of it.
    points = np.array(
        [
            [2, 2, 0],
            [12, 2, 0],
            [12, 12, 0],
            [2, 12, 0],
            [4, 4, 1],
            [8, 4, 1],
            [4, 8, 1],
            [3, 3, -5],
            [9, 3, -5],
            [3, 9, -5],
        ],
        dtype=np.float64,
    )
    triangles = np.array([[4, 5, 6], [0, 1, 2], [0, 3, 2], [7, 8, 9], [0, 0, 1]], dtype=np.int32)
    samples = rasterise(points, triangles, (14, 15))
    assert samples.triangle.shape == (14, 15)
    inside = samples.triangle[2:12, 2:12]
    assert (inside >= 0).all()
    assert (samples.triangle >= 0).sum() == 100
    assert set(np.unique(inside)) == {0, 1, 2}
    row, column = np.mgrid[:14, :15] + 0.5
    small = (row > 4) & (column > 4) & (row + column < 12)
    assert (samples.triangle[small] == 0).all()
    assert (samples.triangle == 0).sum() == (small | (row + column == 12) & (row > 4) & (column > 4)).sum()


def test_raster_agrees_with_barycentric_coordinates() -> None:
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-5, 45, (30, 2)), rng.random(30)])
    triangles = rng.permutation(30).reshape(10, 3).astype(np.int32)
    samples = rasterise(points, triangles, (40, 40))
    expected, depth = np.full((40, 40), -1), np.full((40, 40), -np.inf)
    centres = np.stack(np.meshgrid(np.arange(40) + 0.5, np.arange(40) + 0.5), axis=-1)
    for index, corners in enumerate(triangles):
        a, b, c = points[corners]
        weights = np.linalg.solve(
            np.vstack([np.array([a, b, c]).T[:2], np.ones(3)]), np.dstack([centres, np.ones((40, 40))]).reshape(-1, 3).T
        )
        z = (np.array([a[2], b[2], c[2]]) @ weights).reshape(40, 40)
        nearer = (weights.min(axis=0) >= 0).reshape(40, 40) & (z > depth)
        expected[nearer], depth[nearer] = index, z[nearer]
    nearest = samples.triangle == expected
    assert nearest.mean() > 0.999
    seen = samples.triangle >= 0
    values = interpolate(samples.triangle[seen], centres[seen], points, triangles, points)
    np.testing.assert_allclose(values[:, :2], centres[seen], atol=1e-9)
    np.testing.assert_allclose(values[:, 2], samples.depth[seen], atol=1e-9)
    np.testing.assert_allclose(samples.depth[nearest], depth[nearest], atol=1e-9)


def test_raster_takes_many_triangles_in_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = dome(33)
    points = (shape.vertices + np.array([0.25, 0.25, 0.0])) * (120.0, 120.0, 1.0)
    triangles, _ = triangulate(shape.faces)
    whole = rasterise(points, triangles, (60, 60))
    monkeypatch.setattr("warpflat.export.raster._SPANS_AT_ONCE", 100)
    parts = rasterise(points, triangles, (60, 60))
    np.testing.assert_array_equal(whole.triangle, parts.triangle)
    assert (whole.triangle >= 0).all()


def test_samples_are_averaged_over_what_is_covered() -> None:
    colours = np.zeros((2, 4, 3))
    colours[:, :2] = 1.0
    covered = np.array([[True, False, True, True], [False, False, True, True]])
    pixels = reduce_samples(colours, covered, 2)
    np.testing.assert_allclose(pixels, [[[1, 1, 1, 0.25], [0, 0, 0, 1]]])


def test_outline_is_the_border_with_holes_and_cracks() -> None:
    whole = dome(9)
    faces, _, _ = cut_up_the_middle(whole, 9, 4)
    for mesh in (whole.faces, faces, np.delete(whole.faces, [20, 21], axis=0), mixed().faces, whole.faces[:0]):
        expected = np.sort(border_edges(mesh), axis=1)
        assert {tuple(edge) for edge in outline_edges(mesh)} == {tuple(edge) for edge in expected}
    assert len(outline_edges(faces)) == 32 + 8


def test_areas_and_averages_survive_slivers() -> None:
    shape = mixed()
    np.testing.assert_allclose(face_areas(shape.vertices[:, :2], shape.faces), np.array([1.0, 0.5, 0.5]) / 9.0)
    average = corner_average(
        np.array([1.0, 3.0]), np.array([0.0, 0.0]), np.array([0, 0, 1], np.int32), np.array([0, 1, 1], np.int32), 3
    )
    np.testing.assert_allclose(average, [1.0, 2.0, 0.0])


def test_labels_do_not_overlap() -> None:
    room = LabelRoom()
    page = (0.0, 0.0, 4.0, 3.0)
    room.take_box(0.0, 0.0, 4.0, 0.5)
    line = np.array([[0.5, 1.0], [3.5, 1.0]])
    taken = []
    for _ in range(20):
        spot = room.place([*along_line(line, 0.8, 0.1), *beyond_ends(line, 0.8, 0.1)], 0.8, 0.1, page)
        if spot is None:
            break
        taken.append(spot)
    assert 4 <= len(taken) < 20
    for spot in taken:
        assert spot.y > 0.55
        for other in taken:
            if other is not spot and abs(other.y - spot.y) < 0.1:
                assert abs(other.x - spot.x) >= 0.8


def test_labels_avoid_other_lines_where_they_can() -> None:
    crossing = np.array([[1.0, 0.0], [1.0, 2.0]])
    spots = [Spot(x=1.0, y=1.0, angle=0.0), Spot(x=2.0, y=1.0, angle=0.0)]
    room = LabelRoom()
    assert room.place(spots, 0.5, 0.1, (0, 0, 3, 2), [crossing]) == spots[1]
    assert room.place(spots, 0.5, 0.1, (0, 0, 3, 2), [crossing]) == spots[0]
    assert room.place(spots, 0.5, 0.1, (0, 0, 3, 2), [crossing]) is None


def test_a_label_follows_its_line() -> None:
    steep = np.array([[0.0, 0.0], [0.0, 2.0]])
    first = next(along_line(steep, 0.5, 0.1))
    assert first.angle == pytest.approx(np.pi / 2)
    assert abs(first.x) == pytest.approx(0.1)
    assert first.y == pytest.approx(1.0)
    assert list(along_line(steep[:, ::-1] * 0.2, 0.5, 0.1)) == []
