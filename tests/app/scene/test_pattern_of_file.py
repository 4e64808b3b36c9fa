"""A worn garment whose texture is its sewn pattern: taken as it is, drafted, draped, and compared with what flattening gives."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from bodies import mean_person
from command import Command
from scipy.spatial import cKDTree
from surface_meshes import quads_between

from warpflat.app.scene.outside_pattern import OutsideJob
from warpflat.garment.construction.as_cut import read_cut_pattern, worn_at
from warpflat.garment.construction.sewn_panels import read_sewn_panels
from warpflat.garment.draping.mesh_pieces import mesh_pieces
from warpflat.garment.mannequin.body_model import BodyModel, rotation
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.export.read_pattern import read_pattern
from warpflat.pattern.export.sewn_usd import write_sewn_usd

ROWS, COLUMNS = 9, 13
QUIET = ("--frames", "0", "--no-picture", "--quiet")


def skirt(wide: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A tube of two halves: points [m], quads, patterns [m], quads of the patterns. The back is cut `wide` times as wide as it is worn."""
    turn, height = np.linspace(0.0, np.pi, COLUMNS), np.linspace(0.0, 0.4, ROWS)
    radius = 0.15 + 0.1 * (0.4 - height)
    points, flat, quads, cut = [], [], [], []
    grid = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    faces = quads_between(grid)
    for half, start in enumerate((-0.5 * np.pi, 0.5 * np.pi)):
        angle = start + turn
        ring = np.stack([np.sin(angle), np.zeros(COLUMNS), np.cos(angle)], axis=1)
        points.append((radius[:, None, None] * ring + np.array([0.0, 1.0, 0.0]) * height[:, None, None]).reshape(-1, 3))
        # The arcs of a cone lie flat around its tip.
        away, share = radius * np.hypot(1.0, 0.1) / 0.1, 0.1 / np.hypot(1.0, 0.1)
        around = share * (turn - 0.5 * np.pi) * (wide if half else 1.0)
        place = away[:, None, None] * np.stack([np.sin(around), -np.cos(around)], axis=1)
        flat.append(place.reshape(-1, 2) + np.array([0.8 * half, 3.0]))
        quads.append(faces + half * grid.size)
        cut.append(faces + half * grid.size)
    points = np.concatenate(points)
    # Both halves share the points of their seams.
    index = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    return points[index[1]], index[2].ravel()[np.concatenate(quads)], np.concatenate(flat), np.concatenate(cut)


def write_obj(path: Path, unit: float = 0.01, *, wide: float = 1.0, change: Any = None, move: Any = None) -> Path:
    points, quads, flat, cut = skirt(wide)
    points = points if move is None else move(points)
    places = flat / unit
    places = places if change is None else change(places)
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points] + [f"vt {u:.9g} {v:.9g}" for u, v in places]
    for half in range(2):
        rows.append(f"g {('front', 'back')[half]}")
        both = zip(np.array_split(quads, 2)[half] + 1, np.array_split(cut, 2)[half] + 1, strict=True)
        rows += ["f " + " ".join(f"{v}/{t}" for v, t in zip(face, corner, strict=True)) for face, corner in both]
    path.write_text("\n".join([*rows, ""]))
    return path


def edge_lengths(pattern: Pattern) -> dict[str, list[float]]:
    return {piece.name: sorted(1e3 * edge.length for edge in piece.edges) for piece in pattern.pieces[pattern.sample]}


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.001])
def test_a_pattern_that_is_the_texture_is_drafted_as_it_is_and_compared(command: Command, unit: float):
    write_obj(Path("skirt.obj"), unit)
    done = command("flatten", "skirt.obj", "--units", "m", "--pattern", "uv", "--out", "out", *QUIET[:-1])
    assert done.code == 0
    metrics = json.loads(Path("out/metrics.json").read_text())
    taken = metrics["pattern_of_file"]
    assert taken["unit"] == {1.0: "m", 0.01: "cm", 0.001: "mm"}[unit]
    assert taken["area_ratio"] == pytest.approx(1.0, abs=0.01)
    # A cone can lie flat: flattening meets its pattern as near as its chords are to their arcs.
    assert 0.0 < taken["mean_mm"] < taken["p95_mm"] < 2.0
    assert (
        f"flattening lies {taken['mean_mm']:.2f} mm from it on average, 95 % within {taken['p95_mm']:.2f} mm"
        in done.out
    )
    assert len(metrics["seams"]) == 2
    hem = 1e3 * np.pi * 0.19
    for ending in ("pattern.json", "skirt.dxf", "skirt.svg"):
        read = read_pattern(Path("out") / ending)
        assert [piece.name for piece in read.pieces[read.sample]] == ["front"]  # which serves for the back, turned over
        assert edge_lengths(read)["front"][-1] == pytest.approx(hem, abs=0.1)
    assert Path("out/pattern.pdf").exists()


def test_sides_that_were_cut_unlike_are_eased(tmp_path: Path):
    long = write_obj(tmp_path / "skirt.obj", wide=1.1)
    pattern = read_cut_pattern(long, units="m", name="skirt").pattern
    assert {piece.name for piece in pattern.pieces[""]} == {"front", "back"}
    assert [seam.ease for seam in pattern.seams] == [0.0, 0.0]
    turned = write_obj(
        tmp_path / "long.obj",
        change=lambda places: np.where(np.arange(len(places))[:, None] < ROWS * COLUMNS, places, places * 1.03),
    )
    pattern = read_cut_pattern(turned, units="m", name="skirt").pattern
    assert [seam.ease for seam in pattern.seams] == pytest.approx([0.03, 0.03], abs=1e-6)
    assert {seam.sides[1][0].piece for seam in pattern.seams} == {"back"}


def test_a_worn_mesh_is_draped_by_its_pattern_from_where_it_is_worn(command: Command):
    write_obj(Path("skirt.obj"))
    listed = command("drape", "skirt.obj", "--units", "m", "--edges")
    assert listed.code == 0
    assert "front.to back: " in listed.out
    job = OutsideJob.read(Path("skirt.obj"), units="m", body="EU 38")
    worn = skirt()[0]
    border = worn[(worn[:, 1] < 1e-9) | (worn[:, 1] > 0.4 - 1e-9)]
    places = np.concatenate(
        [job.lifts[piece.name](edge.points) for piece in job.pattern.pieces[""] for edge in piece.edges]
    )
    assert max(np.linalg.norm(places - vertex, axis=1).min() for vertex in border) < 1e-4


def test_a_worn_mesh_lies_on_the_scan_that_stands_where_it_does(tmp_path: Path):
    """The scan is in cm, turned, aside and below, its legs apart; a garment beside it starts as on any other body."""
    model = BodyModel.load()
    skin = model.vertices(mean_person(model))
    turn = rotation(np.array([[0.0, 0.6, 0.0]]))[0]
    aside = np.array([0.4, -1.2, 0.7])
    trimesh.Trimesh(100.0 * (skin @ turn + aside), model.triangles, process=False).export(tmp_path / "scan.obj")
    hip = np.array([0.0, skin[:, 1].min() + 0.75, 0.0])
    for beside in (np.zeros(3), np.array([1.0, 0.0, 0.0])):
        file = write_obj(
            tmp_path / "worn.obj", move=lambda points, beside=beside: (points + hip + beside) @ turn + aside
        )
        job = OutsideJob.read(file, units="m", body=str(tmp_path / "scan.obj"))
        places, raw = (
            np.concatenate([lifts[piece.name](edge.points) for piece in job.pattern.pieces[""] for edge in piece.edges])
            for lifts in (job.lifts, OutsideJob.read(file, units="m").lifts)
        )
        assert job.body is not None
        assert job.body.scan is not None
        if beside.any():
            np.testing.assert_array_equal(places, raw)
            continue
        near, was = cKDTree(job.body.scan[0]).query(places)[0], cKDTree(skin @ turn + aside).query(raw)[0]
        np.testing.assert_allclose(near, was, atol=1e-5)
        assert "the mannequin keeps the scan's pose" in job.body.notes
        assert np.ptp(places, axis=0) == pytest.approx(np.ptp(skirt()[0], axis=0), abs=5e-3)


def test_what_is_written_as_style3d_has_it_is_read_back(tmp_path: Path):
    points, quads, flat, cut = skirt()
    half = len(quads) // 2
    pieces = {"front": slice(0, half), "back": slice(half, 2 * half)}
    write_sewn_usd(tmp_path / "worn.usdc", points, quads.astype(np.int32), flat, cut.astype(np.int32), pieces)
    pattern = read_cut_pattern(tmp_path / "worn.usdc", units=None, name="worn").pattern
    source = read_cut_pattern(write_obj(tmp_path / "skirt.obj"), units="m", name="skirt").pattern
    assert {seam.name for seam in pattern.seams} == {seam.name for seam in source.seams}
    assert len(pattern.seams) == 2
    for name, lengths in edge_lengths(source).items():
        assert edge_lengths(pattern)[name] == pytest.approx(lengths, abs=0.01)


def test_curves_keep_their_lengths_through_a_coarse_mesh(tmp_path: Path):
    """A collar of two half rings, whose neck of 60 mm radius has chords of 10 mm: 0.2 mm shorter than it in all."""
    turn = np.linspace(0.0, np.pi, 2001)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    pieces, seams = {}, []
    for name, sign in (("front", 1.0), ("back", -1.0)):
        inner, outer = sign * 0.06 * ring[::-1], sign * 0.16 * ring
        rows = {
            "outside": outer,
            "left": np.array([outer[-1], inner[0]]),
            "neck": inner,
            "right": np.array([inner[-1], outer[0]]),
        }
        pieces[name] = Piece(name=name, edges=[Edge(name=edge, points=points) for edge, points in rows.items()])
    for title, one, other in (("one", "left", "right"), ("two", "right", "left")):
        sides = (SeamSide(piece="front", edge=one),), (SeamSide(piece="back", edge=other, reversed=True),)
        seams.append(Seam(name=title, sides=sides))
    _, meshes, welds = mesh_pieces(pieces, seams, 0.01)
    first = len(meshes["front"].points)
    flat = np.concatenate([meshes["front"].points, meshes["back"].points])
    sewn = np.arange(len(flat))
    for weld in (weld for seam in welds for weld in seam):
        places = dict(weld)
        sewn[first + places["back"]] = places["front"]
    used, number = np.unique(sewn, return_inverse=True)
    cut = np.concatenate([meshes["front"].triangles, meshes["back"].triangles + first])
    cut = np.column_stack([cut, np.full(len(cut), -1)]).astype(np.int32)
    points = np.column_stack([flat[used], np.zeros(len(used))])
    count = len(meshes["front"].triangles)
    faces = np.where(cut >= 0, number[cut], -1).astype(np.int32)
    rows = {"front": slice(0, count), "back": slice(count, len(cut))}
    write_sewn_usd(tmp_path / "worn.usdc", points, faces, flat, cut, rows)
    read = read_cut_pattern(tmp_path / "worn.usdc", units=None, name="worn").pattern
    assert len(read.seams) == 2
    for lengths in edge_lengths(read).values():
        assert lengths == pytest.approx([100.0, 100.0, 60.0 * np.pi, 160.0 * np.pi], abs=0.01)


REFUSED = {
    "no texture": r"no texture coordinates",
    "normalised": r"no pattern of true size: in \w+, the nearest unit, it has \d\.\d\d times the area",
    "over itself": r"island 'back' of its texture lies over itself",
}


@pytest.mark.parametrize(("kind", "message"), REFUSED.items(), ids=REFUSED)
def test_a_texture_that_is_no_sewn_pattern_is_refused_in_one_line(command: Command, kind: str, message: str):
    def laid(places: np.ndarray) -> np.ndarray:
        if kind == "normalised":
            return places * 0.0037
        if kind == "over itself":
            folded = places.copy()
            folded[ROWS * COLUMNS + 4 * COLUMNS + 6] += [7.0, 0.0]
            return folded
        return places

    file = write_obj(Path("skirt.obj"), change=laid)
    if kind == "no texture":
        file.write_text(re.sub(r"/\d+", "", re.sub(r"(?m)^vt .*\n", "", file.read_text())))
    told = command("flatten", "skirt.obj", "--units", "m", "--pattern", "uv", "--out", "out", *QUIET).refusal
    assert told.startswith("skirt.obj: ")
    assert re.search(message, told)
    assert not Path("out").exists()


def test_islands_may_be_stacked(tmp_path: Path):
    """Layers of CLO lie on each other in its plane."""

    def stacked(places: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(places))[:, None] < ROWS * COLUMNS, places, places - [80.0, 0.0])

    apart, together = (
        read_cut_pattern(write_obj(tmp_path / name, change=change), units="m", name="skirt").pattern
        for name, change in (("apart.obj", None), ("stacked.obj", stacked))
    )
    for name, lengths in edge_lengths(apart).items():
        assert edge_lengths(together)[name] == pytest.approx(lengths, abs=1e-3)
    assert [seam.sides for seam in together.seams] == [seam.sides for seam in apart.seams]


@pytest.mark.parametrize(
    "more",
    [("--seams", "uv"), ("--component", "all"), ("--datum", "left"), ("--grain-angle", "45"), ("--bands", "straight")],
)
def test_a_pattern_as_it_is_is_not_changed(command: Command, more: tuple[str, ...]):
    write_obj(Path("skirt.obj"))
    told = command("flatten", "skirt.obj", "--units", "m", "--pattern", "uv", "--out", "out", *more, *QUIET).refusal
    assert "leave" in told


def test_a_piece_has_no_dot_in_its_name(tmp_path: Path):
    """As of Blender's second material: an edge is "piece.edge"."""
    file = write_obj(tmp_path / "skirt.obj", 0.01)
    file.write_text(file.read_text().replace("g front", "g Lining.001").replace("g back", "g Lining.002"))
    pattern = read_cut_pattern(file, units="m", name="skirt").pattern
    assert {piece.name for piece in pattern.pieces[""]} == {"Lining_001", "Lining_002"}


def test_names_of_islands_are_those_of_the_file(tmp_path: Path):
    panels = read_sewn_panels(write_obj(tmp_path / "skirt.obj"), units="m")
    assert [panel.surface.name for panel in panels] == ["front", "back"]
    assert [panel.unit for panel in panels] == ["cm", "cm"]
    np.testing.assert_allclose([panel.area / panel.worn_area for panel in panels], 1.0, atol=0.01)


def tube(
    axis: tuple[float, float], origin: tuple[float, float], radius: float, begin: float, end: float
) -> tuple[np.ndarray, np.ndarray]:
    """A part of a tube along an axis in the plane of x and y, from one angle around it to another: points and triangles, outward."""
    along = np.array([*axis, 0.0]) / np.hypot(*axis)
    side = np.array([along[1], -along[0], 0.0])
    angle, length = (each.ravel() for each in np.meshgrid(np.linspace(begin, end, 13), np.linspace(0.0, 0.2, 5)))
    ring = np.outer(np.cos(angle), [0.0, 0.0, 1.0]) + np.outer(np.sin(angle), side)
    points = np.array([*origin, 0.0]) + np.outer(length, along) + radius * ring
    quads = quads_between((5, 13), turned=True)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    a, b, c = points[triangles].transpose(1, 0, 2)
    outward = np.einsum("ta,ta->", np.cross(b - a, c - a), (a + b + c) / 3.0 - points.mean(axis=0))
    return points, triangles if outward > 0.0 else triangles[:, ::-1]


@pytest.mark.parametrize("drop", [0.0, 45.0, 85.0])
@pytest.mark.parametrize("parts", [1, 2])
def test_sleeves_are_told_from_where_they_are_worn(parts: int, drop: float):
    """Arms as in T, A and I; trunk and legs of halves, which go around no arm."""
    worn, seams = {}, list[Seam]()
    for half, begin in (("front", -0.5 * np.pi), ("back", 0.5 * np.pi)):
        worn[half] = tube((0.0, -1.0), (0.0, 1.4), 0.16, begin, begin + np.pi)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        way = sign * np.cos(np.radians(drop)), -np.sin(np.radians(drop))
        for k in range(parts):
            begin = 2.0 * np.pi * k / parts
            worn[f"{side} {k}"] = tube(way, (0.25 * sign, 1.35), 0.06, begin, begin + 2.0 * np.pi / parts)
        if parts == 2:
            ends = tuple((SeamSide(piece=f"{side} {k}", edge="edge_1"),) for k in range(2))
            seams.append(Seam(name=side, sides=ends))
        for half, begin in (("front", -0.5 * np.pi), ("back", 0.5 * np.pi)):
            worn[f"{side} leg {half}"] = tube((0.0, -1.0), (0.11 * sign, 0.8), 0.09, begin, begin + np.pi)
        ends = tuple((SeamSide(piece=f"{side} leg {half}", edge="edge_1"),) for half in ("front", "back"))
        seams.append(Seam(name=f"{side} leg", sides=ends))
    at = worn_at(worn, seams)
    for name in worn:
        if "leg" in name or name in ("front", "back"):
            assert at[name] == name.split()[-1]
        else:
            assert at[name] == f"{name.split()[0]} arm"
