"""Patterns from outside: read, made whole, meshed with meeting seams, placed around a body, lifted to a run's surface."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from bodies import body_of_size
from devices import DEVICE
from obj_files import write_obj
from polygons import corners_of, sewn
from polygons import polygon as polygon_from
from surface_meshes import quads_between

import warpflat
from warpflat.app.scene.outside_pattern import OutsideJob
from warpflat.core.errors import InputError
from warpflat.garment.draping.continue_pieces import continue_pieces
from warpflat.garment.draping.correct_pattern import relieve_pattern
from warpflat.garment.draping.drape_pattern import Placement, drape_pattern
from warpflat.garment.draping.lift import read_lift, whole_lifts
from warpflat.garment.draping.mesh_pieces import mesh_pieces
from warpflat.garment.draping.moved_pattern import moved_outlines
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.result import Drape
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.whole_pieces import whole_pieces
from warpflat.pattern.export.dxf import write_dxf
from warpflat.pattern.export.read_dxf import read_dxf
from warpflat.pattern.export.read_svg import read_svg
from warpflat.pattern.export.svg import write_svg

# Edges of a file are counted from 1.
polygon = partial(polygon_from, first=1)


def seam(name: str, first: str, second: str, ease: float = 0.0) -> Seam:
    return sewn(first, second, name, ease=ease)


def tube(width: float, height: float, **more: object) -> Pattern:
    """Two rectangles and their side seams."""
    pieces = [polygon(name, corners_of(width, height), **more) for name in ("front", "back")]
    seams = [seam("side left", "front.e2", "back.e4"), seam("side right", "back.e2", "front.e4")]
    return Pattern(name="tube", pieces={"": pieces}, seams=seams)


def darted(legs: str = "dart") -> Piece:
    corners = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.3), (0.22, 0.3), (0.2, 0.15), (0.18, 0.3), (0.0, 0.3)]
    piece = polygon("front", corners)
    edges = [Edge(name=e.name, points=e.points, kind=legs if e.name in ("e4", "e5") else "seam") for e in piece.edges]
    return Piece(name="front", edges=edges, darts=[Dart(name="bust", left="e4", right="e5")])


def test_both_sides_of_a_seam_get_the_same_points():
    """One side is eased by 10 % and has two edges, between which a dart is closed."""
    other = polygon("yoke", corners_of(0.33, 0.1))
    joined = seam("yoke", "yoke.e1", "front.e6 + front.e3", ease=0.36 / 0.33 - 1.0)
    pieces, seams, notes = whole_pieces([darted(), other, polygon("spare", [(0, 0), (1, 0), (0, 1)])], [joined])
    assert notes == ["left out, as no seam joins them: spare"]
    assert [s.name for s in seams] == ["yoke", "front.bust"]
    _, meshes, welds = mesh_pieces(pieces, seams, 0.02)
    front, yoke = meshes["front"], meshes["yoke"]
    corner = front.points[front.triangles]
    areas = 0.5 * np.linalg.det(corner[:, 1:] - corner[:, :1])
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(0.4 * 0.3 - 0.5 * 0.04 * 0.15, rel=1e-12)
    along = np.array([yoke.points[vertex][0] for (_, vertex), *_ in welds[0]])
    assert along[0] == 0.0
    assert along[-1] == 0.33
    # Where the edges of the second side meet, three vertices become one.
    middle = [joint for joint in welds[0] if len(joint) == 3]
    assert len(middle) == 1
    assert yoke.points[middle[0][0][1]][0] == pytest.approx(0.165)
    tip = welds[1][-1]
    assert {vertex for _, vertex in tip} == {front.edges["e4"][-1]}
    # The other edge of the right side: eased evenly.
    first = [front.points[joint[1][1]] for joint in welds[0] if joint[1][1] in front.edges["e6"]]
    np.testing.assert_allclose(np.array(first)[:, 0], along[: len(first)] * 0.36 / 0.33, atol=1e-9)


def test_halves_and_pairs_are_made_whole():
    half = polygon("front", [(0.0, 0.0), (0.2, 0.0), (0.15, 0.3), (0.0, 0.3)])
    half = Piece(
        name="front",
        edges=[*half.edges[:3], Edge(name="fold", points=half.edges[3].points, kind="fold")],
    )
    side = polygon("side", [(0.0, 0.0), (0.1, 0.0), (0.1, 0.3), (0.0, 0.31)], quantity=2)
    back = [
        Seam(
            name="back",
            sides=((SeamSide(piece="side", edge="e2"),), (SeamSide(piece="side", edge="e2", mirrored=True),)),
        )
    ]
    pieces, seams, _ = whole_pieces([half, side], [seam("side", "front.e2", "side.e4"), *back])
    assert set(pieces) == {"front", "side", "side mirrored"}
    assert [edge.name for edge in pieces["front"].edges] == [
        "e1",
        "e2",
        "e3",
        "e3 mirrored",
        "e2 mirrored",
        "e1 mirrored",
    ]
    texts = {s.name: tuple(f"{x} {x.reversed}" for x in s.stretches) for s in seams}
    assert texts == {
        "side": ("front.e2 False", "side.e4 True"),
        "back": ("side.e2 False", "side mirrored.e2 True"),
        "side mirrored": ("front.e2 mirrored True", "side mirrored.e4 False"),
    }


@pytest.mark.parametrize("ending", ["dxf", "svg"])
def test_a_file_of_the_package_names_its_seams(ending: str, tmp_path: Path):
    other = polygon("yoke", corners_of(0.33, 0.1))
    given = Pattern(
        name="trial", pieces={"": [darted(), other]},
        seams=[seam("yoke", "yoke.e1", "front.e6 + front.e3", ease=0.36 / 0.33 - 1.0)],
    )  # fmt: skip
    file = tmp_path / f"trial.{ending}"
    drafted = draft_garment(given)
    (write_dxf if ending == "dxf" else write_svg)(drafted, file)
    found = (read_dxf if ending == "dxf" else read_svg)(file)
    assert [s.sides for s in found.seams] == [s.sides for s in given.seams]
    assert found.seams[0].ease == pytest.approx(given.seams[0].ease, rel=1e-5)
    for piece in found.pieces[""]:
        lengths = {edge.name: edge.length for edge in piece.edges}
        asked = {
            edge.name: edge.length
            for edge in drafted.pieces[""][[p.name for p in given.pieces[""]].index(piece.name)].edges
        }
        assert lengths == pytest.approx(asked, abs=1e-5)
    assert [(dart.left, dart.right) for dart in found.piece("front", "").darts] == [("e4", "e5")]


def test_the_seams_of_another_programs_file_stand_in_a_table(tmp_path: Path):
    document = ezdxf.new("R12")
    for name, x in (("FRONT", 0.0), ("BACK", 600.0)):
        block = document.blocks.new(name)
        corners = [(x, 0), (x + 480, 0), (x + 480, 300), (x, 300)]
        block.add_polyline2d([(a - 10, b - 10) for a, b in corners[:1]] + [(x + 490, -10), (x + 490, 310), (x - 10, 310)],
                             close=True, dxfattribs={"layer": "1"})  # fmt: skip
        block.add_text(f"PIECE NAME: {name.lower()}", dxfattribs={"layer": "1"})
        document.modelspace().add_blockref(name, (0, 0))
    file = tmp_path / "other.dxf"
    document.saveas(file)
    with pytest.raises(
        InputError, match=r'names no seams; give --seams FILE with \[\[seams\]\] sides = \["front.edge_1", "back'
    ):
        OutsideJob.read(file, body="EU 38")
    table = tmp_path / "sewn.toml"
    table.write_text(
        'allowance_mm = 10\ntop = "waist"\n[[seams]]\nsides = ["front.edge_2", "back.edge_4"]\n'
        '[[seams]]\nsides = ["back.edge_2", "front.edge_4"]\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40.0\n'
    )
    job = OutsideJob.read(file, sewing=table)
    edges = {edge.name: edge.length for edge in job.pattern.piece("front", "").edges}
    assert edges == pytest.approx({"edge_1": 0.48, "edge_2": 0.3, "edge_3": 0.48, "edge_4": 0.3})
    table.write_text('[[seams]]\nsides = ["front.edge_2", "back.egde_4"]\n')
    with pytest.raises(InputError, match=r"back.*edge_4"):
        OutsideJob.read(file, sewing=table, body="EU 38")


@pytest.mark.parametrize(
    ("header", "text", "scale"), [(1, "", 0.0254), (5, "", 0.01), (0, "Units: English", 0.0254), (0, "", 1e-3)]
)
def test_cad_files_of_other_habits_are_read(header: int, text: str, scale: float, tmp_path: Path):
    """Boundaries of lines, an arc and a spline on a layer of their own, no names of pieces, several units, an arrow's block."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = header
    document.blocks.new("ARROW").add_lwpolyline([(0, 0), (1, 0), (0, 1)], close=True)
    width, high = 0.4 / scale, 0.3 / scale
    for name in ("A1", "A2"):
        block = document.blocks.new(name)
        on = {"layer": "CUT"}
        block.add_line((0, 0), (width, 0), dxfattribs=on)
        block.add_line((width, high), (width, 0), dxfattribs=on)
        block.add_spline(fit_points=[(width, high), (width / 2, 1.1 * high), (0, high)], dxfattribs=on)
        block.add_line((0, high), (0, 1e-7 * width), dxfattribs=on)
        block.add_line((width / 4, 0), (width / 4, high / 2), dxfattribs={"layer": "GRAIN"})
        block.add_circle((width / 2, high / 2), width / 50, dxfattribs={"layer": "HOLES"})
        document.modelspace().add_blockref(name, (0, 0))
    if text:
        document.modelspace().add_text(text)
    file = tmp_path / "cad.dxf"
    document.saveas(file)
    found = read_dxf(file)
    assert [piece.name for piece in found.pieces[""]] == ["A1", "A2"]
    for piece in found.pieces[""]:
        lengths = [edge.length for edge in piece.edges]
        assert len(lengths) == 4
        assert lengths[:2] == pytest.approx([0.4, 0.3], abs=1e-6)
        assert 0.4 < lengths[2] < 0.41


def test_an_open_outline_is_refused_beside_a_closed_one(tmp_path: Path):
    """It would be lost without a word; lines that belong to a piece or go around nothing are left alone."""
    document, corners = ezdxf.new("R2010"), [(0, 0), (500, 0), (470, 600), (30, 600)]
    document.header["$INSUNITS"] = 4
    space = document.modelspace()
    space.add_lwpolyline(corners, close=True)
    space.add_line((250, 100), (250, 500))
    space.add_lwpolyline([(100, 400), (100, 300), (200, 300), (200, 400)])
    space.add_line((-100, 0), (-100, 600))
    shifted = [(x + 700, y) for x, y in corners]
    for a, b in pairwise(shifted):
        space.add_line(a, b)
    file = tmp_path / "skirt.dxf"
    last = space.add_line(shifted[-1], shifted[0])
    document.saveas(file)
    assert len(read_dxf(file).pieces[""]) == 2
    last.dxf.end = (700, 4)
    document.saveas(file)
    with pytest.raises(InputError, match=r"an outline is open by 4.0 mm at \(700, [04]\) mm; join its ends"):
        read_dxf(file)
    paths = '<path id="a" d="M0,0 H500 V600 H0 {}"/><path id="b" d="M700,0 H1200 V600 H700 {}"/>'
    page = '<svg xmlns="http://www.w3.org/2000/svg" width="1300mm" viewBox="0 0 1300 700">{}</svg>'
    drawing = tmp_path / "skirt.svg"
    drawing.write_text(page.format(paths.format("Z", "Z")))
    assert [piece.name for piece in read_svg(drawing).pieces[""]] == ["a", "b"]
    drawing.write_text(page.format(paths.format("Z", "")))
    with pytest.raises(InputError, match=r"an outline is open by 600.0 mm"):
        read_svg(drawing)


def test_a_pattern_in_the_wrong_units_is_refused():
    body, fabric = body_of_size(30.0), warpflat.find_fabric("woven")
    with pytest.raises(InputError, match=r"the largest, is 0.5 by 0.2 mm; .* are its units right"):
        drape_pattern(tube(0.475e-3, 0.25e-3), body, fabric=fabric)
    with pytest.raises(InputError, match=r"goes 242 mm around the body, whose waist has 7\d\d mm: are its units right"):
        drape_pattern(tube(0.121, 0.064), body, fabric=fabric)


def test_a_tube_is_put_around_the_body():
    body = body_of_size(30.0)
    pattern = tube(0.475, 0.25)  # a little tight, so that it stays on the hips
    worn, _ = drape_pattern(
        pattern,
        body,
        fabric=warpflat.find_fabric("woven"),
        placement=Placement(spacing=0.03),
        options=DrapeOptions(max_steps=400),
        device=DEVICE,
    )
    measures = worn.measures()
    assert measures["compared_with"] == "body"
    assert measures["deepest_m"] < 1e-4
    # It encloses the trunk once, the front before it and the back behind it, and is not drawn.
    front, back = (worn.positions[worn.cloth.welded[rows]] for rows in worn.cloth.piece_vertices.values())
    assert front[:, 2].mean() > 0.03
    assert back[:, 2].mean() < -0.03
    assert abs(measures["strain_weft"]["p95"]) < 0.03
    with pytest.raises(InputError, match="has no seams"):
        drape_pattern(Pattern(name="rag", pieces={"": list(pattern.pieces[""])}), body, fabric=worn.cloth.fabric)
    with pytest.raises(InputError, match=r"has no designed surface; name a body"):
        drape_pattern(pattern, None, fabric=worn.cloth.fabric)


@pytest.mark.parametrize("lower", [0.0, 0.45])
def test_a_designed_surface_beside_the_body_is_no_start(lower: float):
    """As that of a garment in the axes of its own file, whose shoulders lie at this body's knees."""
    body = body_of_size(30.0)
    hip = body.levels()["hip"].height

    def lift(begin: float):
        def places(flat: np.ndarray) -> np.ndarray:
            angle = begin + np.pi * flat[:, 0] / 0.475
            return np.column_stack([0.175 * np.sin(angle), hip - 0.2 + flat[:, 1] - lower, 0.125 * np.cos(angle)])

        return places

    placement = Placement(spacing=0.03, lifts={"front": lift(-0.5 * np.pi), "back": lift(0.5 * np.pi)})
    worn, notes = drape_pattern(
        tube(0.475, 0.25),
        body,
        fabric=warpflat.find_fabric("woven"),
        placement=placement,
        options=DrapeOptions(max_steps=100),
        device=DEVICE,
    )
    assert [note for note in notes if "lies beside this body" in note] == notes
    assert len(notes) == (lower > 0.0)
    # Placed by its seams it starts at the waist.
    assert worn.positions[:, 1].max() > hip


def test_a_tube_that_nothing_holds_falls_off():
    body = body_of_size(30.0)
    with pytest.raises(InputError, match=r"falls off: nothing on the body holds the garment"):
        drape_pattern(
            tube(0.6, 0.25),
            body,
            fabric=warpflat.find_fabric("woven"),
            placement=Placement(spacing=0.04),
            device=DEVICE,
        )


def test_what_is_cut_turned_over_starts_beside_the_others_where_a_garment_stands_aside_and_leans():
    """A tube of a front and two equal backs, 30 cm off x = 0 and leaning by some degrees, as a file may have it."""
    radius, wide, tall = 0.1, 0.05 * np.pi, 0.2
    lean = np.radians(4.0)
    turn = np.array([[np.cos(lean), -np.sin(lean), 0.0], [np.sin(lean), np.cos(lean), 0.0], [0.0, 0.0, 1.0]])

    def lift(begin: float):
        def places(flat: np.ndarray) -> np.ndarray:
            angle = begin + flat[:, 0] / radius
            upright = np.column_stack([radius * np.sin(angle), flat[:, 1], radius * np.cos(angle)])
            return upright @ turn.T + [0.3, 0.1, 0.0]

        return places

    corners = [(0.0, 0.0), (wide, 0.0), (wide, tall), (0.0, tall)]
    pieces = [
        polygon("front", [(2 * x, y) for x, y in corners]),
        polygon("back", corners, quantity=2),
    ]
    turned = Seam(
        name="side right",
        sides=((SeamSide(piece="back", edge="e4", mirrored=True),), (SeamSide(piece="front", edge="e4"),)),
    )
    middle = Seam(
        name="middle",
        sides=((SeamSide(piece="back", edge="e2"),), (SeamSide(piece="back", edge="e2", mirrored=True),)),
    )
    pattern = Pattern(
        name="tube", pieces={"": pieces}, seams=[seam("side left", "front.e2", "back.e4"), turned, middle]
    )
    lifts = {"front": lift(-wide / radius), "back": lift(wide / radius)}
    worn, _ = drape_pattern(
        pattern, None, fabric=warpflat.find_fabric("woven"), placement=Placement(spacing=0.02, lifts=lifts),
        options=DrapeOptions(max_steps=100), device=DEVICE,
    )  # fmt: skip
    cloth = worn.cloth
    starts = {name: cloth.designed[cloth.welded[rows]] for name, rows in cloth.piece_vertices.items()}
    upright = {name: (points - [0.3, 0.1, 0.0]) @ turn for name, points in starts.items()}
    for points in upright.values():
        np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 2]), radius, atol=1e-5)
    assert upright["back"][:, 0].min() > -1e-5
    assert upright["back mirrored"][:, 0].max() < 1e-5


def test_a_half_is_lifted_to_both_sides_of_its_surface(tmp_path: Path):
    """A quarter of a cylinder, whose other quarter is its image."""
    radius = 0.1
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.157, 30), np.linspace(0.0, 0.2, 5)))
    space = np.column_stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)])
    faces = quads_between((5, 30))
    write_obj(tmp_path / "front.obj", (space, faces), texture=[np.stack([x, y], axis=1)], digits="")
    half = polygon("front", corners_of(0.157, 0.2))
    half = Piece(name="front", edges=[*half.edges[:3], Edge(name="fold", points=half.edges[3].points, kind="fold")])
    lifts = whole_lifts([half], {"front": read_lift(tmp_path / "front.obj")})
    points = np.array([[0.1, 0.13], [-0.1, 0.13], [-0.03, 0.02]])
    found = lifts["front"](points)
    asked = np.column_stack(
        [radius * np.sin(points[:, 0] / radius), points[:, 1], radius * np.cos(points[:, 0] / radius)]
    )
    np.testing.assert_allclose(found, asked, atol=5e-5)


@pytest.fixture(scope="module")
def narrow_tube() -> tuple[Pattern, Drape]:
    """A tube of 88 cm on a hip of 96 cm, in a cloth that gives 5 %."""
    narrow = tube(0.44, 0.2)
    draped, _ = drape_pattern(
        narrow, body_of_size(40.0), fabric=warpflat.find_fabric("woven"), device=DEVICE,
        placement=Placement(top="hip", spacing=0.04), options=DrapeOptions(max_steps=3000, tolerance=0.05),
    )  # fmt: skip
    return narrow, draped


def test_what_an_elastic_holds_stays_while_a_pattern_is_let_out(narrow_tube: tuple[Pattern, Drape]) -> None:
    draped = replace(narrow_tube[1], threaded=["front.e3", "back.e3"])
    found = relieve_pattern(draped, rounds=1)
    rows = np.concatenate([draped.cloth.lines[line] for line in draped.threaded])
    assert len(found.rounds) == 2
    np.testing.assert_allclose(found.after.positions[rows], draped.positions[rows], atol=1e-6)


def test_a_pattern_from_outside_is_let_out_where_it_is_stretched_too_far(narrow_tube: tuple[Pattern, Drape]) -> None:
    narrow, draped = narrow_tube
    assert draped.converged
    found = relieve_pattern(draped)
    assert found.rounds[0].strained > 0.1
    assert found.rounds[-1].strained < 0.02
    assert found.seam_difference() < 1e-3
    moved = moved_outlines(narrow, "", found.before.cloth, found.after.cloth)
    for name in ("front", "back"):
        before, after = (pattern.piece(name, "") for pattern in (narrow, moved))
        # It is wider where it was too narrow, by what its cloth does not give.
        assert 0.01 < max(after.edge(e).length - before.edge(e).length for e in ("e1", "e3")) < 0.06
    # Both halves of a piece on the fold, and both of a pair, move alike.
    left, right = (
        moved.piece("front", "").edge(e).points[:, 1].mean() - narrow.piece("front", "").edge(e).points[:, 1].mean()
        for e in ("e2", "e4")
    )
    assert left == pytest.approx(right, abs=0.01)


def test_a_drawing_of_freesewing_is_read_by_its_sewing_lines(tmp_path: Path) -> None:
    drawing = tmp_path / "aaron.svg"
    drawing.write_text(
        """<svg xmlns="http://www.w3.org/2000/svg" width="452mm" height="330mm" viewBox="0 0 452 330">
        <defs><marker id="grainlineTo"><path class="note fill-note" d="M 0,4 L 12,8 L 12,0 z"/></marker></defs>
        <g id="fs-container">
        <g id="fs-stack-aaron.front" transform="translate(12,12)"><g id="fs-stack-aaron.front-part-aaron.front">
        <path d="M 0,0 L 200,0 L 180,300 L 0,300 z" class="fabric"/>
        <path d="M -10,-10 L 210,-10 L 190,310 L -10,310 z" class="fabric sa"/>
        <path d="M 100,40 L 100,260" class="note" marker-end="url(#grainlineTo)"/>
        <path d="M 40,100 L 90,100 L 90,150 L 40,150 z" class="various"/></g></g>
        <g id="fs-stack-aaron.back" transform="translate(240,12)"><g id="fs-stack-aaron.back-part-aaron.back">
        <path d="M 0,0 L 180,0 L 180,300 L 0,300 z" class="fabric"/>
        <path d="M -10,-10 L 190,-10 L 190,310 L -10,310 z" class="fabric sa"/></g></g>
        </g></svg>"""
    )
    front, back = read_svg(drawing).pieces[""]
    assert (front.name, back.name) == ("front", "back")
    assert [1e3 * edge.length for edge in back.edges] == pytest.approx([180.0, 300.0, 180.0, 300.0])
    assert front.grain is not None
    assert back.grain is None
    # It is drawn downwards, and read upwards, as the piece is worn.
    np.testing.assert_allclose(front.grain, [[0.112, -0.272], [0.112, -0.052]])
    drawing.write_text(drawing.read_text().replace("L 180,300 L 0,300 z", "L 180,300 L 0,300 L 0,10"))
    with pytest.raises(InputError, match=r"open by 10\.0 mm"):
        read_svg(drawing)


@pytest.mark.parametrize("top", ["e3", "e1"])
def test_a_band_goes_on_beyond_its_seam_as_the_cloth_does(top: str):
    """A tube of radius 10 cm, with a band of two tiers sewn to its upper or, drafted upside down, its lower edge."""
    radius, wide, tall = 0.1, 0.2 * np.pi, 0.2
    band = [(0.0, 0.0), (wide, 0.0), (wide, 0.05), (0.0, 0.05)]
    pieces = {
        "tube": polygon("tube", corners_of(wide, tall)),
        "band": polygon("band", band),
        "fall": polygon("fall", [(x, 2.0 * y) for x, y in band]),
    }
    # The band's lower edge to the tube's upper one, or its upper one to the tube's lower one.
    seams = [
        seam("upper", f"tube.{top}", f"band.{'e1' if top == 'e3' else 'e3'}"),
        seam("turn", f"band.{top}", f"fall.{'e1' if top == 'e3' else 'e3'}"),
        seam("side", "tube.e2", "tube.e4"),
    ]
    meshed = mesh_pieces(pieces, seams, 0.02)
    meshes = meshed.meshes
    flat = meshes["tube"].points
    lies = np.column_stack([radius * np.sin(flat[:, 0] / radius), flat[:, 1], radius * np.cos(flat[:, 0] / radius)])
    found = continue_pieces({"tube": lies}, meshed)
    np.testing.assert_array_equal(found["tube"], lies)
    for name, begins in (("band", tall), ("fall", tall + 0.05)):
        x, y = meshes[name].points.T
        up = begins + y if top == "e3" else tall - begins - (meshes[name].points[:, 1].max() - y)
        asked = np.column_stack([radius * np.sin(x / radius), up, radius * np.cos(x / radius)])
        # Chords of 2 cm slant by up to .1 beside the arc's tangent, 15 cm away from the seam as well.
        assert np.linalg.norm(found[name] - asked, axis=1).max() < 0.015
        assert np.linalg.norm(found[name] - asked, axis=1).mean() < 0.006
    with pytest.raises(InputError, match="'fall' is sewn to no piece that has a designed surface"):
        continue_pieces({"tube": lies}, meshed._replace(welds=meshed.welds[:1]))


def test_a_cuff_is_sewn_to_both_sleeves():
    """Two cuffs, not cut turned over, to a sleeve that is; a yoke in two layers, which both sleeves meet, stays one."""
    square = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)]
    pieces = [
        polygon("sleeve", square, quantity=2),
        polygon("cuff", square, quantity=2, paired=False),
        polygon("yoke", square, quantity=2, paired=False),
    ]
    other = Seam(
        name="over",
        sides=((SeamSide(piece="sleeve", edge="e3", mirrored=True),), (SeamSide(piece="yoke", edge="e3"),)),
    )
    seams = [seam("wrist", "sleeve.e1", "cuff.e3"), seam("over the arm", "sleeve.e3", "yoke.e1"), other]
    whole, sewn, _ = whole_pieces(pieces, seams)
    assert set(whole) == {"sleeve", "sleeve mirrored", "cuff", "cuff mirrored", "yoke"}
    joined = [{side.piece for side in each.stretches} for each in sewn]
    assert {"sleeve mirrored", "cuff mirrored"} in joined
    assert {"sleeve mirrored", "yoke"} in joined
