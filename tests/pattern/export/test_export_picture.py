from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from export_meshes import cut_up_the_middle, dome, grid, mixed, surface
from matplotlib.patches import Polygon

from warpflat.core.sums import weighted_percentile
from warpflat.flat.surface.triangles import triangulate
from warpflat.pattern.drafting.placement import (
    LabelRoom,
    Spot,
    leader_line,
    space_out,
    spots_along,
    spots_beside,
    spots_beyond_ends,
)
from warpflat.pattern.export.colours import SMALLEST_SCALE, VertexColours, energy_colours, energy_scale
from warpflat.pattern.export.dressed import Body, crop_body
from warpflat.pattern.export.figure import GREY, Pen, new_figure, write_figure
from warpflat.pattern.export.geometry import face_areas
from warpflat.pattern.export.letters import all_letters, is_drawn, note_on_names, titles
from warpflat.pattern.export.packing import pack_boxes, pack_rows
from warpflat.pattern.export.picture import DraftedOutline, PicturePiece, draw_figure, write_picture
from warpflat.pattern.export.raster import BACK, LIGHT, Samples, rasterise, shade


def find_piece(shape, density=None, **options) -> PicturePiece:
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
    write_picture(
        tmp_path / "a.png", [find_piece(shape, datum="centre front", captions={"fabric": "poplin"})], scale=1.0
    )
    pixels = pixels_of(tmp_path / "a.png")
    height, width, _ = pixels.shape
    assert width == 1875
    assert 700 < height < 1300
    assert len(np.unique((pixels * 255).astype(int) @ (1 << 16, 1 << 8, 1))) > 1000
    # Below the colour bar.
    pattern = pixels[100:, width // 2 :]
    for density in np.linspace(0.0, 1.0, 64)[::9]:
        # A face is about 80 pixels wide; lines and the mesh take some of it.
        assert near(pattern, energy_colours(density, 1.0)) > 2000
    body = pixels[:, : width // 2]
    assert (body.min(axis=-1) < 0.9).sum() > 100_000
    assert near(pixels, np.ones(3)) < 0.5 * height * width


def test_a_garment_is_shown_on_its_body_from_three_sides(tmp_path: Path) -> None:
    shape = dome(9)
    rng = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    ring = np.stack([0.3 * np.cos(rng), np.zeros(40), 0.3 * np.sin(rng)], axis=1)
    vertices = np.concatenate([ring + np.array([0.0, y, 0.0]) for y in np.linspace(-0.6, 0.6, 30)])
    index = np.arange(40 * 30).reshape(30, 40)
    around = np.roll(index, -1, axis=1)
    faces = np.stack([index[:-1], index[1:], around[1:], around[:-1]], axis=-1).reshape(-1, 4).astype(np.int32)
    worn = find_piece(shape, np.full(64, 0.5))
    write_picture(tmp_path / "worn.png", [worn], scale=1.0, body=Body(vertices=vertices, faces=faces))
    pixels = pixels_of(tmp_path / "worn.png")
    hue = pixels[100:, :, 0] - pixels[100:, :, 2]
    worn_rows = np.flatnonzero((hue > 0.25).any(axis=1))
    # The pattern follows below: there is a gap of words between.
    gap = worn_rows[np.flatnonzero(np.diff(worn_rows) > 30)]
    assert len(gap) == 1
    front, side, back = np.array_split(hue[: gap[0] + 1], 3, axis=1)
    # The cloth lies on the front: half as much of it shows from the side, nothing from behind.
    assert (front > 0.25).sum() > 30_000
    assert 0 < (side > 0.25).sum() < 0.7 * (front > 0.25).sum()
    assert (back > 0.25).sum() == 0
    pattern = hue[gap[0] + 30 :] > 0.25
    assert pattern.sum() > 200_000
    assert near(pixels, np.ones(3)) < 0.5 * pixels[..., 0].size


def test_a_body_ends_in_a_plane_beside_the_garment() -> None:
    shape = dome(9)
    reach = float(np.abs(shape.vertices[:, 0]).max())
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    x = np.linspace(-4.0 * reach, 4.0 * reach, 33)
    arm = np.stack([np.repeat(x, 12), 0.1 * np.cos(np.tile(around, 33)), 0.1 * np.sin(np.tile(around, 33))], axis=1)
    index = np.arange(33 * 12).reshape(33, 12)
    after = np.roll(index, -1, axis=1)
    faces = np.stack([index[:-1], index[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4).astype(np.int32)
    triangles, vertices = crop_body(Body(vertices=arm, faces=faces), shape.vertices)
    used = vertices[np.unique(triangles)]
    ends = np.array([shape.vertices[:, 0].min() - 0.06, shape.vertices[:, 0].max() + 0.06])
    np.testing.assert_allclose([used[:, 0].min(), used[:, 0].max()], ends)
    # Closed, and wound one way: its volume is that of the prism between.
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    assert abs(volume) == pytest.approx(6.0 * 0.1**2 * np.sin(np.pi / 6.0) * np.ptp(ends))


def test_boxes_are_packed_without_overlap_and_use_what_lies_under_short_ones() -> None:
    sizes = [(2.0, 5.0), (2.0, 2.0), (2.0, 3.0), (3.9, 1.0), (6.0, 1.0)]
    places, wide, tall = pack_boxes(sizes, 6.0)
    assert (wide, tall) == (6.0, 6.0)
    assert places[:3] == [(0.0, 0.0), (2.0, 0.0), (4.0, 0.0)]
    assert places[3] == (2.0, 3.0)
    rng = np.random.default_rng(3)
    sizes = [(float(w), float(h)) for w, h in rng.uniform(0.2, 3.0, (40, 2))]
    rows, _, foot = pack_rows(sizes, 7.0)
    assert [top for _, top in rows] == sorted(top for _, top in rows)
    assert all(left > 0.0 for (left, top), (_, before) in zip(rows[1:], rows, strict=False) if top == before)
    places, wide, tall = pack_boxes(sizes, 7.0)
    assert tall < foot
    low = np.array(places)
    high = low + np.array(sizes)
    assert high[:, 0].max() == wide <= 7.0
    assert high[:, 1].max() == tall
    apart = (low[:, None] >= high[None] - 1e-9) | (high[:, None] <= low[None] + 1e-9)
    assert (apart.any(axis=-1) | np.eye(40, dtype=bool)).all()
    assert np.prod(sizes, axis=1).sum() > 0.6 * wide * tall


def test_a_name_that_no_font_can_write_is_a_number_in_pictures(tmp_path: Path) -> None:
    nameless = ("\U000f0000", "\U000f0001")
    for file, names in (("a.png", ("front", *nameless)), ("b.png", ("front", "piece", "piece 2"))):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            write_picture(tmp_path / file, [find_piece(dome(5), name=name) for name in names])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert titles(["piece", *nameless], is_drawn) == {"piece": "piece", nameless[0]: "piece 2", nameless[1]: "piece 3"}
    assert note_on_names(["front", "devant é", "Ωмега"]) == ()
    assert "'\\U000f0000' is 'piece'" in note_on_names(nameless)[0]


def test_fonts_for_other_scripts_are_used_where_they_are_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "DejaVu Serif" not in matplotlib.rcParams["font.family"]
    monkeypatch.setattr("warpflat.pattern.export.letters._FONTS_OF_OTHER_SCRIPTS", ("Not Installed", "DejaVu Serif"))
    with all_letters():
        assert matplotlib.rcParams["font.family"] == [*matplotlib.rcParamsDefault["font.family"], "DejaVu Serif"]


def test_pieces_are_rows_and_share_the_scale(tmp_path: Path) -> None:
    whole, half = find_piece(dome(5), np.full(16, 1.0)), find_piece(dome(5, "half"), np.full(16, 0.5))
    write_picture(tmp_path / "two.png", [whole, half])
    two = pixels_of(tmp_path / "two.png")
    upper, lower = np.split(two[100:], [(two.shape[0] - 100) // 2])
    assert near(upper, energy_colours(1.0, 1.0)) > 50_000
    assert near(lower, energy_colours(0.5, 1.0)) > 50_000
    assert near(upper, energy_colours(0.5, 1.0)) < 500


def test_narrow_pieces_stand_side_by_side(tmp_path: Path) -> None:
    tall = dome(5)
    tall = surface(tall.vertices * [0.15, 1.0, 0.15], tall.faces, "tall")
    left, right = (find_piece(tall, np.full(16, d), positions=tall.vertices[:, :2]) for d in (1.0, 0.5))
    write_picture(tmp_path / "one.png", [left], scale=1.0)
    write_picture(tmp_path / "two.png", [left, right], scale=1.0)
    one, two = pixels_of(tmp_path / "one.png"), pixels_of(tmp_path / "two.png")
    # The name of one that is alone stands beside the colour bar.
    assert len(two) <= len(one) + 70
    halves = np.array_split(two[100:], 2, axis=1)
    for half, density in zip(halves, (1.0, 0.5), strict=True):
        assert near(half, energy_colours(density, 1.0)) > 20_000
        assert near(half, energy_colours(1.5 - density, 1.0)) < 500


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
        find_piece(strip, positions=flat_strip, datum="fold"),
        find_piece(quad, np.zeros(1)),
        find_piece(mixed(), np.array([1.0, 2.0, 1e9])),
        find_piece(
            whole, faces=faces, positions=whole.vertices[to_surface, :2], lines={"dart $x_1": crack}, datum="none"
        ),
        find_piece(ground, positions=ground.vertices[:, [0, 2]]),
        find_piece(holed, datum="across"),
    ]
    write_picture(tmp_path / "a.png", pieces)
    assert (pixels_of(tmp_path / "a.png").min(axis=-1) < 0.9).mean() > 0.05


def test_drafted_pieces_stand_below_the_others_with_their_longer_side_across(tmp_path: Path) -> None:
    pieces = [find_piece(dome(9))]
    band = np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 3.0], [0.0, 3.0]])
    collar = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.08], [0.0, 0.08]])
    drafted = [DraftedOutline(name="neck band", points=band), DraftedOutline(name="collar, 2 times", points=collar)]
    write_picture(tmp_path / "without.png", pieces)
    figure = draw_figure(pieces, drafted=drafted)
    write_figure(tmp_path / "with.png", figure)
    without, whole = pixels_of(tmp_path / "without.png"), pixels_of(tmp_path / "with.png")
    more = whole.shape[0] - without.shape[0]
    assert more > 60
    assert whole.shape[1] == without.shape[1]
    words = {text.get_text() for text in figure.axes[0].texts}
    assert {"neck band", "collar, 2 times"} <= words
    worn = draw_figure(pieces, drafted=drafted, body=Body(vertices=dome(9).vertices, faces=dome(9).faces))
    assert "not shown on the body: neck band, collar" in {text.get_text() for text in worn.axes[0].texts}
    drafted = [replace(drafted[0], worn=[dome(9)]), drafted[1]]
    worn = draw_figure(pieces, drafted=drafted, body=Body(vertices=dome(9).vertices, faces=dome(9).faces))
    said = "grey: drafted for its edges, laid by its seams; not shown on the body: collar"
    assert said in {text.get_text() for text in worn.axes[0].texts}
    # What is as long as three metres is drawn smaller, within the page; its outline is closed.
    shapes = [patch.get_xy() for patch in figure.axes[0].patches if isinstance(patch, Polygon) and patch.zorder == 3]
    assert np.ptp(shapes[0][:, 0]) < figure.get_size_inches()[0]
    assert np.ptp(shapes[0][:, 0]) / np.ptp(shapes[1][:, 0]) == pytest.approx(10.0)
    assert all(shape[:, 1].min() > 0.0 for shape in shapes)


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
    np.testing.assert_allclose(samples.depth_at(*np.nonzero(nearest)), depth[nearest], atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
def test_no_sample_falls_between_two_triangles(angle: float) -> None:
    shape = dome(33)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = np.column_stack([30.0 + 240.0 * shape.vertices[:, :2] @ turn.T, shape.vertices[:, 2]])
    triangles, _ = triangulate(shape.faces)
    samples = rasterise(points, triangles, (60, 60))
    centres = np.stack(np.meshgrid(np.arange(60) + 0.5, np.arange(60) + 0.5), axis=-1)
    low, high = shape.vertices[:, :2].min(axis=0), shape.vertices[:, :2].max(axis=0)
    flat = (centres - 30.0) @ turn / 240.0
    inside = ((flat > low + 1e-9) & (flat < high - 1e-9)).all(axis=-1)
    assert inside.sum() > 2500
    assert (samples.triangle[inside] >= 0).all()
    beyond = ((flat < low - 1e-9) | (flat > high + 1e-9)).any(axis=-1)
    assert (samples.triangle[beyond] == -1).all()


def test_triangles_off_the_image_or_without_a_place_cover_nothing() -> None:
    points = np.array(
        [
            [-9, -9, 0],
            [-1, -9, 0],
            [-9, -1, 0],
            [1e12, 0, 0],
            [1e12, 9, 0],
            [2e12, 4, 0],
            [np.nan, 1, 0],
            [5, np.inf, 0],
        ],
        dtype=np.float64,
    )
    triangles = np.array([[0, 1, 2], [3, 4, 5], [0, 4, 6], [1, 2, 7]], dtype=np.int32)
    samples = rasterise(points, triangles, (10, 10))
    assert (samples.triangle == -1).all()
    assert (samples.depth_at(*np.mgrid[:10, :10]) == -np.inf).all()


def lit_mesh() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points over a 40 by 40 image, triangles, and unit normals at the points, half of which look away."""
    x, y = (values.ravel() for values in np.meshgrid(np.linspace(-1.0, 41.0, 5), np.linspace(-1.0, 41.0, 5)))
    index, quads = grid(5, 5)
    triangles, _ = triangulate(quads)
    normals = np.random.default_rng(2).standard_normal((len(x), 3)) * 0.3 + (0.0, 0.0, 1.0)
    normals[index[:, 3:]] *= (1.0, 1.0, -1.0)
    return np.column_stack([x, y, 0.01 * x]), triangles, normals / np.linalg.norm(normals, axis=1)[:, None]


def test_light_falls_by_the_blended_normal_and_the_reverse_is_greyed() -> None:
    points, triangles, normals = lit_mesh()
    samples = rasterise(points, triangles, (40, 40))
    face = np.arange(len(triangles), dtype=np.int32)
    colours = np.random.default_rng(3).random((len(triangles), 3))
    light, back = np.array(LIGHT) / np.linalg.norm(LIGHT), BACK
    pixels = shade(samples, 1, points, triangles, colours, face=face, normals=normals)
    assert (pixels[..., 3] == 255).all()
    for row, column in np.random.default_rng(4).integers(0, 40, (200, 2)):
        triangle = samples.triangle[row, column]
        corners = points[triangles[triangle]]
        share = np.linalg.solve(np.vstack([corners[:, :2].T, np.ones(3)]), [column + 0.5, row + 0.5, 1.0])
        normal = share @ normals[triangles[triangle]]
        towards = float(normal @ light) / np.linalg.norm(normal)
        if normal[2] < 0.0:
            wanted = (0.25 * colours[triangle] + 0.75 * np.array(back)) * (0.62 + 0.25 * max(-towards, 0.0))
        else:
            wanted = colours[triangle] * (0.55 + 0.50 * max(towards, 0.0))
        np.testing.assert_allclose(pixels[row, column, :3], 255.0 * np.clip(wanted, 0.0, 1.0), atol=0.6)
    assert {bool(n) for n in normals[triangles].mean(axis=1)[samples.triangle, 2].ravel() < 0.0} == {True, False}


def test_a_triangle_lit_by_its_own_normal_has_one_colour() -> None:
    points, triangles, _ = lit_mesh()
    samples = rasterise(points, triangles, (40, 40))
    own = np.tile([0.0, 0.0, 3.0], (len(triangles), 1))
    face = np.zeros(len(triangles), dtype=np.int32)
    colour = np.array([[0.2, 0.4, 0.6]])
    pixels = shade(samples, 2, points, triangles, colour, face=face, normals=own, at_vertices=False)
    assert pixels.shape == (20, 20, 4)
    shade_of = np.round(255.0 * colour[0] * (0.55 + 0.50 * LIGHT[2] / np.linalg.norm(LIGHT)))
    np.testing.assert_array_equal(pixels.reshape(-1, 4), np.tile([*shade_of, 255], (400, 1)))


def test_samples_are_averaged_over_what_is_covered() -> None:
    front = np.full((4, 4), -1, dtype=np.int64)
    front[:2] = [[0, -1, 1, 1], [-1, -1, 1, 1]]
    front[2:] = [[0, 1, -1, -1], [0, 1, -1, -1]]
    samples = Samples(front=front, back=0.0, step=1.0)
    corners = np.zeros((3, 3)), np.array([[0, 1, 2], [0, 1, 2]], dtype=np.int32)
    colours = np.array([[0.2, 0.4, 0.6], [1.0, 0.0, 0.0]])
    pixels = shade(samples, 2, *corners, colours, face=np.array([0, 1], dtype=np.int32))
    mixed_up = [[[51, 102, 153, 64], [255, 0, 0, 255]], [[153, 51, 77, 255], [0, 0, 0, 0]]]
    np.testing.assert_allclose(pixels.astype(int), mixed_up, atol=1)


@pytest.mark.parametrize("shape", [(1, 1), (70, 33), (32, 5)])
def test_a_png_holds_the_pixels_its_resolution_and_who_wrote_it(tmp_path: Path, shape: tuple[int, int]) -> None:
    from PIL import Image

    rng = np.random.default_rng(6)
    given = rng.integers(0, 256, (*shape, 4), dtype=np.uint8)
    given[..., 3] = 255
    figure = new_figure(shape[1] / 150, shape[0] / 150)
    figure.figimage(given, resize=True)
    write_figure(tmp_path / "a.png", figure)
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "RGB"
        assert image.info["dpi"] == pytest.approx((150, 150), abs=0.1)
        assert image.info["Software"] == "warpflat"
        np.testing.assert_array_equal(np.asarray(image), given[..., :3])


def test_areas_and_averages_survive_slivers() -> None:
    shape = mixed()
    np.testing.assert_allclose(face_areas(shape.vertices[:, :2], shape.faces), np.array([1.0, 0.5, 0.5]) / 9.0)
    corners = np.array([[0, 1, 3, -1], [1, 3, 4, -1]], np.int32)
    average = VertexColours(corners, np.zeros(2), 5).mean(np.array([1.0, 3.0]))
    np.testing.assert_allclose(average, [1.0, 2.0, 0.0, 2.0, 3.0])


def test_labels_do_not_overlap() -> None:
    room = LabelRoom()
    page = (0.0, 0.0, 4.0, 3.0)
    room.take_box(0.0, 0.0, 4.0, 0.5)
    line = np.array([[0.5, 1.0], [3.5, 1.0]])
    taken = []
    for _ in range(20):
        spot = room.place([*spots_along(line, 0.8, 0.1), *spots_beyond_ends(line, 0.8, 0.1)], 0.8, 0.1, page)
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
    crossing = [np.array([[1.0, 0.0], [1.0, 2.0]])]
    spots = [Spot(x=1.0, y=1.0, angle=0.0), Spot(x=2.0, y=1.0, angle=0.0)]
    room = LabelRoom()
    assert room.place(spots, 0.5, 0.1, (0, 0, 3, 2), crossing) == spots[1]
    assert room.place(spots, 0.5, 0.1, (0, 0, 3, 2), crossing) == spots[0]
    assert room.place(spots, 0.5, 0.1, (0, 0, 3, 2), crossing) is None


def test_a_label_follows_its_line() -> None:
    steep = np.array([[0.0, 0.0], [0.0, 2.0]])
    first = next(spots_along(steep, 0.5, 0.1))
    assert first.angle == pytest.approx(np.pi / 2)
    assert abs(first.x) == pytest.approx(0.1)
    assert first.y == pytest.approx(1.0)
    assert list(spots_along(steep[:, ::-1] * 0.2, 0.5, 0.1)) == []


def test_a_leader_runs_over_nothing_that_is_taken() -> None:
    page = (0.0, 0.0, 3.0, 2.0)
    led = [Spot(x=1.5, y=1.0, angle=0.0, leader=(0.2, 1.0)), Spot(x=1.5, y=1.5, angle=0.0, leader=(0.2, 1.0))]
    wall = np.array([[0.8, 0.5], [0.8, 1.1]])
    assert LabelRoom().place(led, 0.5, 0.1, page) == led[0]
    room = LabelRoom()
    room.take_line(wall, 0.05)
    assert room.place(led, 0.5, 0.1, page) == led[1]
    # A text does not stand on it, either.
    assert room.place([Spot(x=0.8, y=0.8, angle=0.0)], 0.5, 0.1, page) is None
    ends = leader_line(led[0], 0.5)
    assert ends is not None
    np.testing.assert_allclose(ends, [[0.2, 1.0], [1.21, 1.0]])


def test_spots_beside_a_point_are_led_to_it_unless_they_touch_it() -> None:
    for side in (1.0, -1.0):
        spots = list(spots_beside([(1.0, 2.0)], 0.6, [side], level=2.0))
        assert spots[0].leader is None
        assert sum(spot.leader is None for spot in spots) == 1
        assert all(side * (spot.x - 1.0) > 0.379 for spot in spots)
    assert next(spots_beside([(1.0, 2.0)], 0.6, [1.0], level=2.3)).leader == (1.0, 2.0)
    points = [(1.0, 2.0), (3.0, 4.0)]
    spots = list(spots_beside(points, 0.6, [1.0, -1.0]))
    assert {spot.leader for spot in spots} == set(points)
    # Of all points in turn, the nearest first.
    lengths = [np.hypot(spot.x - spot.leader[0], spot.y - spot.leader[1]) for spot in spots if spot.leader is not None]
    assert lengths[:4] == pytest.approx([0.38] * 4)
    assert np.mean(lengths[:100]) < np.mean(lengths[-100:])


@pytest.mark.parametrize(
    ("wanted", "places"),
    [
        ([5.0, 3.0, 1.0], [5.0, 3.0, 1.0]),
        ([5.0, 5.0, 1.0], [5.5, 4.5, 1.0]),
        ([3.0, 3.0, 3.0, 2.9], [4.475, 3.475, 2.475, 1.475]),
        ([9.8, 9.8, 0.1], [10.0, 9.0, 0.1]),
        ([0.1, 0.0], [1.0, 0.0]),
        ([], []),
    ],
)
def test_names_one_below_the_other_stay_as_near_as_they_can(wanted: list[float], places: list[float]) -> None:
    np.testing.assert_allclose(space_out(wanted, 1.0, 0.0, 10.0), places)


def test_names_across_a_narrow_piece_stand_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows, quads = grid(4, 40)
    x, y = np.meshgrid(np.linspace(0.0, 0.05, 4), np.linspace(0.0, 0.5, 40))
    strip = surface(np.stack([x, y, 0.02 * np.cos(40.0 * x)], axis=-1).reshape(-1, 3), quads, "strip")
    lines = {f"a name as long as this, {k}": rows[at] for k, at in enumerate((4, 12, 13, 14, 30))}
    written: list[tuple[str, float, float]] = []
    write = Pen.write

    def told(self, x, y, text, size, **options) -> None:
        if text in lines and options["rotation"] == 0:
            written.append((text, x, y))
        assert "not labelled" not in text or options["color"] != GREY
        write(self, x, y, text, size, **options)

    monkeypatch.setattr(Pen, "write", told)
    write_picture(tmp_path / "strip.png", [find_piece(strip, lines=lines, surface_lines=lines)])
    assert sorted(text for text, _, _ in written) == sorted([*lines, *lines])
    for view in (written[:5], written[5:]):
        by_height = sorted(view, key=lambda label: label[2])
        # In the order of their lines, each on the same side, with room between.
        assert [text for text, _, _ in by_height] == list(lines)
        assert np.ptp([x for _, x, _ in view]) < 0.6
        assert np.diff([y for _, _, y in by_height]).min() > 0.1


def test_cloth_without_strain_has_no_scale_of_colours(tmp_path: Path) -> None:
    shape = dome(9)
    write_picture(tmp_path / "none.png", [find_piece(shape, np.full(64, 1e-9))])
    write_picture(tmp_path / "some.png", [find_piece(shape, np.full(64, 1.0))])
    none, some = (pixels_of(tmp_path / f"{name}.png")[:80] for name in ("none", "some"))
    red = energy_colours(0.6, 1.0)
    assert near(none, red) == 0
    assert near(some, red) > 200


def test_a_page_of_hundreds_of_pieces_has_fewer_pixels_per_inch() -> None:
    pen = Pen(12.0, 4.0)
    assert pen.dpi == 150.0
    pen.resize(12.0, 300.0)
    assert np.prod(pen.figure.get_size_inches() * pen.figure.dpi) == pytest.approx(2.4e7)
    pen.resize(12.0, 8.0)
    assert pen.figure.dpi == 150.0
