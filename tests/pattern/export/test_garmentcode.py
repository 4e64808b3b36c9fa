"""The JSON of GarmentCode: curves, stitches, darts and places read, faults, each one line, and patterns written and read back."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import Command
from real_files import DATA, needs_data

import warpflat
from warpflat.core.errors import InputError
from warpflat.garment.draping.drape_pattern import lay_pieces
from warpflat.garment.draping.mesh_pieces import mesh_pieces, sew_meshes
from warpflat.garment.draping.openings import find_openings
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.whole_pieces import whole_pieces
from warpflat.pattern.export.garmentcode import garmentcode_json, write_garmentcode
from warpflat.pattern.export.pattern_json import write_pattern_json
from warpflat.pattern.export.read_garmentcode import garmentcode_pattern
from warpflat.pattern.export.read_pattern import read_drafted, read_pattern


def panel(vertices: list[tuple[float, float]], curves: dict[int, Any] | None = None, **more: Any) -> dict[str, Any]:
    """A panel whose edges join its vertices in their order; `curves` by the number of the edge."""
    count = len(vertices)
    edges: list[dict[str, Any]] = [{"endpoints": [k, (k + 1) % count]} for k in range(count)]
    for number, curve in (curves or {}).items():
        edges[number]["curvature"] = curve
    return {
        "translation": [0.0, 0.0, 0.0],
        "rotation": [0.0, 0.0, 0.0],
        "vertices": [list(at) for at in vertices],
        "edges": edges,
        **more,
    }


def file_of(panels: dict[str, Any], stitches: list[str], **properties: Any) -> dict[str, Any]:
    """The data of a file; a stitch is "panel.edge panel.edge", and may end in "right_wrong"."""
    rows = []
    for stitch in stitches:
        first, second, *word = stitch.split(" ")
        sides = [{"panel": text.split(".")[0], "edge": int(text.split(".")[1])} for text in (first, second)]
        rows.append([*sides, *word])
    return {"pattern": {"panels": panels, "stitches": rows}, "properties": {"units_in_meter": 100, **properties}}


def seams_of(pattern: Pattern) -> list[tuple[str, str]]:
    def side(chain: Any) -> str:
        return " + ".join(f"{'-' if each.reversed else ''}{each}" for each in chain)

    return [(side(seam.sides[0]), side(seam.sides[1])) for seam in pattern.seams]


SQUARE = [(0.0, 0.0), (40.0, 0.0), (40.0, 60.0), (0.0, 60.0)]


@pytest.mark.parametrize(
    ("curve", "length", "reaches"),
    [
        # A parabola of height h over a chord c: control point at 2 h; length by its closed form.
        ({"type": "quadratic", "params": [[0.5, -0.5]]}, 0.4 * (np.sqrt(2) + np.log(1 + np.sqrt(2))) / 2, -0.1),
        ([0.5, -0.5], 0.4 * (np.sqrt(2) + np.log(1 + np.sqrt(2))) / 2, -0.1),
        ({"type": "cubic", "params": [[0.25, 0.0], [0.75, 0.0]]}, 0.4, 0.0),
        # Half a circle and its longer arc on the right, which is outside at the bottom; on the left the outline bends inwards.
        ({"type": "circle", "params": [20.0, 0, 1]}, 0.2 * np.pi, -0.2),
        ({"type": "circle", "params": [25.0, 1, 1]}, 0.25 * (2 * np.pi - 2 * np.arcsin(0.8)), -0.4),
        ({"type": "circle", "params": [25.0, False, False]}, 0.25 * 2 * np.arcsin(0.8), 0.0),
        # A radius that is too small for the chord is that of half a circle.
        ({"type": "circle", "params": [1.0, 0, 1]}, 0.2 * np.pi, -0.2),
    ],
)
def test_curves_have_their_lengths_and_sides(curve: Any, length: float, reaches: float):
    piece = garmentcode_pattern(file_of({"a": panel(SQUARE, {0: curve})}, []), "p").piece("a", "")
    assert piece.edge("edge_0").length == pytest.approx(length, abs=2e-5)
    assert piece.edge("edge_0").points[:, 1].min() == pytest.approx(reaches, abs=2e-5)
    assert piece.edge("edge_1").length == pytest.approx(0.6, rel=1e-12)


def test_control_points_may_be_absolute_and_units_millimetres():
    given = file_of({"a": panel([(10 * x, 10 * y) for x, y in SQUARE], {0: [200.0, -200.0]})}, [],
                    curvature_coords="absolute", units_in_meter=1000)  # fmt: skip
    edge = garmentcode_pattern(given, "p").piece("a", "").edge("edge_0")
    assert edge.length == pytest.approx(0.4 * (np.sqrt(2) + np.log(1 + np.sqrt(2))) / 2, abs=2e-5)


def test_a_panel_seen_from_behind_is_turned_over_and_a_sleeve_stands_upright():
    """The back's edges run clockwise; the sleeve lies along x, its wrist on the left arm's far end."""
    back = panel([SQUARE[k] for k in (0, 3, 2, 1)], translation=[0.0, 80.0, -25.0])
    sleeve = panel([(0.0, 0.0), (-30.0, 0.0), (-30.0, -20.0), (0.0, -20.0)], translation=[55.0, 110.0, 10.0],
                   rotation=[0.0, 0.0, -50.0])  # fmt: skip
    front = panel(SQUARE, translation=[0.0, 80.0, 25.0])
    found = garmentcode_pattern(file_of({"fr": front, "bk": back, "left_sleeve": sleeve}, []), "p")
    at = {piece.name: piece.at for piece in found.pieces[""]}
    assert at == {"fr": "front", "bk": "back", "left_sleeve": "left arm"}
    assert np.ptp(found.piece("left_sleeve", "").outline, axis=0) == pytest.approx([0.2, 0.3])
    # Each corner hangs where the file says.
    for name, entry in (("bk", back), ("left_sleeve", sleeve)):
        piece, angle = found.piece(name, ""), np.radians(entry["rotation"][2])
        assert piece.placement is not None
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for edge, corner in zip(piece.edges, np.array(entry["vertices"]), strict=True):
            place = 0.01 * (np.array([*(turn @ corner), 0.0]) + entry["translation"])
            np.testing.assert_allclose(piece.placement @ [*edge.points[0], 1.0], place, atol=1e-12)
    turned = garmentcode_pattern(file_of({"a": panel(SQUARE, rotation=[90.0, 90.0, 0.0])}, []), "p").piece("a", "")
    assert turned.placement is not None
    # About x first, then about y: the panel's (1, 0) points backwards, its (0, 1) to the side.
    np.testing.assert_allclose(np.abs(turned.placement[:, :2]).sum(axis=1), [1.0, 0.0, 1.0], atol=1e-12)


def test_sleeves_of_every_pose_stand_upright():
    """Drawn along x or along y, spread, half down or hanging: the cap is always up."""
    lying = [(0.0, 0.0), (-50.0, 0.0), (-50.0, -20.0), (0.0, -20.0)]
    upright = [(0.0, 0.0), (20.0, 0.0), (20.0, 50.0), (0.0, 50.0)]
    for corners, place, angle in ((lying, [70.0, 140.0, 15.0], 0.0), (lying, [55.0, 110.0, 15.0], -50.0),
                                  (upright, [20.0, 90.0, 15.0], 0.0), (upright, [60.0, 100.0, 15.0], 45.0)):  # fmt: skip
        given = panel(corners, translation=place, rotation=[0.0, 0.0, angle], label="arm")
        piece = garmentcode_pattern(file_of({"a": given}, []), "p").piece("a", "")
        assert np.ptp(piece.outline, axis=0) == pytest.approx([0.2, 0.5])
        assert piece.placement is not None
        ends = [float((piece.placement @ [*piece.outline[:, 0].mean() * np.ones(1), y, 1.0])[0]) for y in
                (piece.outline[:, 1].min(), piece.outline[:, 1].max())]  # fmt: skip
        assert ends[1] < ends[0] + 1e-9


def test_stitches_that_follow_each_other_are_a_seam_across_a_dart():
    """The skirt's top has a dart and is sewn to a band of two edges, which is 10 % longer; the band's ends meet the wrong way round."""
    top = [(0.0, 0.0), (40.0, 0.0), (40.0, 50.0), (24.0, 50.0), (20.0, 35.0), (16.0, 50.0), (0.0, 50.0)]
    band = [(0.0, 0.0), (17.6, 0.0), (35.2, 0.0), (35.2, 5.0), (0.0, 5.0)]
    given = file_of({"skirt": panel(top), "band": panel(band)},
                    ["skirt.3 skirt.4", "band.0 skirt.5", "band.1 skirt.2", "band.2 band.4 right_wrong"])  # fmt: skip
    found = garmentcode_pattern(given, "p")
    skirt = found.piece("skirt", "")
    assert [(dart.left, dart.right) for dart in skirt.darts] == [("edge_3", "edge_4")]
    assert [edge.kind for edge in skirt.edges] == ["seam", "seam", "seam", "dart", "dart", "seam", "seam"]
    assert seams_of(found) == [
        ("-skirt.edge_5 + -skirt.edge_2", "band.edge_0 + band.edge_1"),
        ("band.edge_2", "band.edge_4"),
    ]
    assert found.seams[0].ease == pytest.approx(0.1)
    assert found.seams[1].ease == 0.0
    # With another ease in the second half they are two seams.
    given["pattern"]["panels"]["band"]["vertices"][1] = [20.0, 0.0]
    assert len(garmentcode_pattern(given, "p").seams) == 3


@pytest.mark.parametrize("turned", [False, True])
def test_an_edge_of_less_than_a_millimetre_is_in_one_seam_wherever_its_stitches_begin(turned: bool):
    front = panel([(0, 0), (15, 0), (15, 0.08), (15, 20), (0, 20)])
    back = panel([(0, 0), (0, 20), (-15, 20), (-15, 0.05), (-15, 0)])
    stitches = ["f.1 b.3", "f.2 b.2"]
    pattern = garmentcode_pattern(file_of({"f": front, "b": back}, stitches[:: -1 if turned else 1]), "p")
    sewn = [side for seam in pattern.seams for side in seam.stretches]
    assert len(sewn) == len({(side.piece, side.edge) for side in sewn}) == 4


def test_two_straight_sides_of_a_cone_are_a_seam_and_no_dart():
    cone = panel([(0.0, 0.0), (30.0, 0.0), (0.0, 30.0)], {1: {"type": "circle", "params": [30.0, 0, 1]}})
    found = garmentcode_pattern(file_of({"cone": cone}, ["cone.2 cone.0"]), "p")
    assert not found.piece("cone", "").darts
    assert seams_of(found) == [("cone.edge_2", "-cone.edge_0")]


GOOD = file_of({"a": panel(SQUARE), "b": panel(SQUARE)}, ["a.1 b.3"])


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (
            ("panels", "a", "edges", 1, "endpoints"),
            [1, 9],
            r"pattern.panels.a.edges\[1\].endpoints: vertex 9 is not there",
        ),
        (("panels", "a", "edges", 1, "endpoints"), [1, 3], r"edges\[1\]: ends at vertex 3, the next edge starts at 2"),
        (("panels", "a", "edges", 1, "endpoints"), [1], r"endpoints"),
        (("panels", "a", "vertices", 1), [40.0, "x"], r"pattern.panels.a.vertices\[1\]"),
        (("panels", "a", "vertices"), [[0, 0], [1, 1], [2, 2], [3, 3]], r"encloses no area"),
        (("panels", "a", "vertices"), [[0, 0], [40, 60], [40, 0], [0, 60]], r"crosses itself"),
        (("panels", "a", "edges", 0, "curvature"), {"type": "cubic", "params": [[0.5, 0.1]]}, r"a cubic one two"),
        (("panels", "a", "edges", 0, "curvature"), {"type": "circle", "params": [0, 0, 1]}, r"radius above 0"),
        (("panels", "a", "edges", 0, "curvature"), {"type": "spiral", "params": [1]}, r"spiral"),
        (("stitches", 0, 1, "panel"), "c", r"pattern.stitches\[0\]: there is no panel 'c'"),
        (("stitches", 0, 1, "edge"), 4, r"panel 'b' has no edge 4; its edges are 0 to 3"),
        (("stitches", 0, 1), "right_wrong", r"'right_wrong' is no edge"),
        (("stitches", 0, 1), {"panel": "a", "edge": 1}, r"edge 1 of 'a' is stitched twice"),
        (("panels",), {}, r"pattern.panels"),
        (("panels", "a", "translation"), [0, 0], r"translation"),
    ],
)
def test_a_fault_is_one_line_with_its_place(path: tuple[Any, ...], value: Any, message: str, tmp_path: Path):
    given = copy.deepcopy(GOOD)
    there: Any = given["pattern"]
    for step in path[:-1]:
        there = there[step]
    there[path[-1]] = value
    file = tmp_path / "odd.json"
    file.write_text(json.dumps(given))
    with pytest.raises(InputError, match=message) as caught:
        read_pattern(file)
    assert str(file) in str(caught.value)


def test_a_file_is_exported_and_its_lines_stay(command: Command, tmp_path: Path):
    curved = panel(SQUARE, {1: {"type": "quadratic", "params": [[0.5, -0.2]]}})
    Path("bag_specification.json").write_text(json.dumps(file_of({"a": curved, "b": curved}, ["a.1 b.3"])))
    assert (
        command("export", "bag_specification.json", "--format", "dxf", "--format", "svg", "--format", "pdf").code == 0
    )
    assert {path.name for path in Path("out/bag").iterdir()} == {"bag.dxf", "bag.svg", "pattern.pdf", "metrics.json"}
    flat, drawn = read_pattern(Path("bag_specification.json")), read_pattern(Path("out/bag/bag.svg"))
    for piece in flat.pieces[""]:
        for edge in piece.edges:
            assert drawn.piece(piece.name, "").edge(edge.name).length == pytest.approx(edge.length, abs=1e-4)
    assert [seam.sides for seam in drawn.seams] == [seam.sides for seam in flat.seams]
    wide = read_drafted(Path("bag_specification.json"), allowance=0.02).pieces[""][0]
    assert np.ptp(wide.cut_line, axis=0)[1] == pytest.approx(0.64, abs=1e-6)
    # Written again and in another format, but not over what was changed.
    assert command("export", "bag_specification.json", "--format", "svg", "--format", "plt").code == 0
    Path("out/bag/bag.svg").write_text("changed by hand")
    refused = command("export", "bag_specification.json", "--format", "svg")
    assert "bag.svg: was changed since warpflat wrote it" in refused.refusal


def piece_of(name: str, corners: list[tuple[float, float]], **more: Any) -> Piece:
    """A piece whose edges e1, e2 ... join its corners; a corner with a third number ends an edge that bulges out by that."""
    edges = []
    for number, (start, end) in enumerate(pairwise([*corners, corners[0]]), start=1):
        (x, y), (u, v), bulge = start[:2], end[:2], (*end, 0.0)[2]
        t = np.linspace(0.0, 1.0, 41 if bulge else 2)[:, None]
        points = [x, y] + t * [u - x, v - y] + bulge * np.sin(np.pi * t) * [v - y, x - u]
        points[[0, -1]] = (x, y), (u, v)
        edges.append(Edge(name=f"e{number}", points=points))
    return Piece(name=name, edges=edges, **more)


def side_of(text: str, *, reversed: bool) -> tuple[SeamSide, ...]:
    return tuple(
        SeamSide(piece=word.split(".")[0], edge=word.split(".")[1], reversed=reversed) for word in text.split(" + ")
    )


def worn() -> Pattern:
    """A half front on the fold with a curved waist and a curved armhole, a back with a dart, and a sleeve that is cut twice."""
    front = piece_of("front", [(0.0, 0.0), (0.25, 0.0), (0.25, 0.3, 0.04), (0.15, 0.5, -0.15), (0.0, 0.5, -0.1)])
    front = replace(
        front, edges=[*front.edges[:4], Edge(name="fold", points=front.edges[4].points, kind="fold")], at="front",
        placement=np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.9], [0.0, 0.0, 0.2]]),
    )  # fmt: skip
    back = piece_of("back", [(-0.25, 0.0), (0.25, 0.0), (0.25, 0.31), (0.15, 0.5, -0.1), (0.02, 0.5), (0.0, 0.35),
                             (-0.02, 0.5), (-0.15, 0.5), (-0.25, 0.31, -0.1)])  # fmt: skip
    kinds = ["seam", "seam", "seam", "seam", "dart", "dart", "seam", "seam", "seam"]
    back = replace(
        back, edges=[replace(edge, kind=kind) for edge, kind in zip(back.edges, kinds, strict=True)], at="back",
        darts=[Dart(name="neck", left="e5", right="e6")],
        placement=np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.9], [0.0, 0.0, -0.2]]),
    )  # fmt: skip
    sleeve = piece_of("sleeve", [(0.0, 0.0), (0.4, 0.0), (0.4, 0.2), (0.0, 0.2, 0.3)], quantity=2)
    seams = [
        Seam(name="side", sides=(side_of("front.e2", reversed=False), side_of("back.e9", reversed=True))),
        Seam(name="shoulder", sides=(side_of("front.e4", reversed=False), side_of("back.e7", reversed=True))),
        Seam(name="under the arm", sides=(side_of("sleeve.e2", reversed=False), side_of("sleeve.e4", reversed=True))),
        Seam(name="armhole", sides=(side_of("front.e3 + back.e8", reversed=False), side_of("sleeve.e3", reversed=True)),
             eased=(0.3, 0.7)),
    ]  # fmt: skip
    return Pattern(name="worn", pieces={"": [front, back, sleeve]}, seams=seams)


def test_a_panel_keeps_its_cloths_and_how_often_it_is_cut(tmp_path: Path):
    """A sleeve of the pair is a panel; of the bags, sewn to their copies that are turned over, each side has two."""
    pattern = worn()
    cut = {"front": {}, "back": {"also": {"fusible": 1}}, "sleeve": {"also": {"fusible": 2}}}
    pieces = [replace(piece, fabric="wool", **cut[piece.name]) for piece in pattern.pieces[""]]
    bag = piece_of("bag", [(0.0, 0.0), (0.2, 0.0), (0.2, 0.2)], quantity=4, fabric="cotton")
    rim = side_of("bag.e2", reversed=False)
    both = Seam(name="rim", sides=(rim, tuple(replace(side, mirrored=True) for side in rim)))
    patch = piece_of("patch", [(0.0, 0.0), (0.2, 0.0), (0.2, 0.2)], quantity=2, paired=False)
    given = replace(pattern, pieces={"": [*pieces, bag, patch]}, seams=[*pattern.seams, both])
    file = tmp_path / "worn_specification.json"
    write_garmentcode(draft_garment(given, true=False), file)
    found = read_pattern(file)
    assert {piece.name: (piece.fabric, piece.quantity, dict(piece.also)) for piece in found.pieces[""]} == {
        "front": ("wool", 1, {}), "back": ("wool", 1, {"fusible": 1}),
        "sleeve": ("wool", 1, {"fusible": 1}), "sleeve mirrored": ("wool", 1, {"fusible": 1}),
        "bag": ("cotton", 2, {}), "bag mirrored": ("cotton", 2, {}), "patch": ("", 2, {}),
    }  # fmt: skip
    assert not any(found.piece(name, "").is_pair for name in ("bag", "bag mirrored", "patch"))


def test_a_pattern_comes_back_with_its_lengths_and_seams(tmp_path: Path):
    drafted = draft_garment(worn(), true=False)
    file = tmp_path / "worn_specification.json"
    assert write_garmentcode(drafted, file) == ()
    found = read_pattern(file)
    flat = [
        replace(each.piece, edges=[replace(edge.edge, points=edge.line) for edge in each.edges])
        for each in drafted.pieces[""]
    ]
    pieces, seams, _ = whole_pieces(flat, drafted.pattern.seams)
    assert {piece.name for piece in found.pieces[""]} == {"front", "back", "sleeve", "sleeve mirrored"}
    for name, piece in pieces.items():
        lengths = {edge.name: edge.length for edge in found.piece(name, "").edges}
        assert lengths == pytest.approx({edge.name: edge.length for edge in piece.edges}, abs=1e-4)
    sewn = {seam.name: seam for seam in seams if seam.name != "back.neck"}
    assert [(dart.left, dart.right) for dart in found.piece("back", "").darts] == [("e5", "e6")]
    assert {seam.name for seam in found.seams} == sewn.keys()
    for seam in found.seams:
        assert set(seam.sides) == set(sewn[seam.name].sides)
    # What the file says again is the same; what a drape needs is there.
    again = tmp_path / "again_specification.json"
    write_garmentcode(draft_garment(found, true=False), again)
    assert {seam.name: set(seam.sides) for seam in read_pattern(again).seams} == {
        seam.name: set(seam.sides) for seam in found.seams
    }
    front = found.piece("front", "")
    assert front.at == "front"
    assert front.placement is not None
    np.testing.assert_allclose((front.placement @ [*front.outline.mean(axis=0), 1.0])[2], 0.2, atol=1e-9)


def test_other_programs_can_read_what_is_written(tmp_path: Path):
    """Each edge is in one stitch, both sides of a stitch have one label at most, edges chain, and the file has the library's keys."""
    data, notes = garmentcode_json(draft_garment(worn(), true=False))
    assert notes == ()
    assert list(data) == ["pattern", "parameters", "parameter_order", "properties"]
    pattern = data["pattern"]
    assert list(pattern) == ["panels", "stitches", "panel_order"]
    stitched = [
        (side["panel"], side["edge"]) for stitch in pattern["stitches"] for side in stitch if side != "right_wrong"
    ]
    assert len(set(stitched)) == len(stitched)
    for panel in pattern["panels"].values():
        assert {"translation", "rotation", "vertices", "edges"} <= panel.keys()
        count = len(panel["vertices"])
        assert [edge["endpoints"] for edge in panel["edges"]] == [[k, (k + 1) % count] for k in range(count)]
        assert panel["vertices"][0] == [0.0, 0.0]
    if DATA.is_dir():
        given = json.loads((DATA / "patterns" / "dress_pencil.json").read_text())
        assert given["properties"] == data["properties"]
        assert given.keys() == data.keys()
        assert given["pattern"].keys() == pattern.keys()


def test_a_band_whose_ends_meet_is_opened_where_a_zip_would_be(tmp_path: Path):
    """GarmentCode refuses two corners of a panel that become one, unless a stitch joins the panel to itself there."""
    front, back = (piece_of(name, [(0.0, 0.0), (0.3, 0.0), (0.3, 0.4), (0.0, 0.4)]) for name in ("front", "back"))
    band = piece_of("band", [(0.0, 0.0), (0.6, 0.0), (0.6, 0.04), (0.0, 0.04)])
    sides = {
        "left": ("front.e2", "back.e4"),
        "right": ("back.e2", "front.e4"),
        "waist": ("band.e1", "back.e3 + front.e3"),
    }
    seams = [
        Seam(name=name, sides=(side_of(one, reversed=False), side_of(other, reversed=True)))
        for name, (one, other) in sides.items()
    ]
    drafted = draft_garment(Pattern(name="skirt", pieces={"": [front, back, band]}, seams=seams), true=False)
    data, notes = garmentcode_json(drafted)
    assert len(notes) == 1
    assert "is open over 400 mm between" in notes[0]
    (opened,) = data["pattern"]["open"]
    assert opened["stitch"][0]["seam"] in ("left", "right")
    assert len(data["pattern"]["stitches"]) == 3
    file = tmp_path / "skirt_specification.json"
    write_garmentcode(drafted, file)
    assert {seam.name: seam.sides for seam in read_pattern(file).seams} == {seam.name: seam.sides for seam in seams}
    # With its ends sewn to each other the band needs no opening.
    closed = Seam(name="ends", sides=(side_of("band.e2", reversed=False), side_of("band.e4", reversed=True)))
    whole = draft_garment(Pattern(name="skirt", pieces={"": [front, back, band]}, seams=[*seams, closed]), true=False)
    assert garmentcode_json(whole)[1] == ()


def test_what_garmentcode_does_not_know_is_named(command: Command):
    hole = Hole(name="eye", points=0.05 * np.array([(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)]))
    lines = {"hip": np.array([(0.02, 0.2), (0.28, 0.2)])}
    cloth = piece_of("cloth", [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)], holes=[hole], internal_lines=lines)
    sides = side_of("cloth.e1", reversed=False), side_of("cloth.e3", reversed=True)
    seams = [Seam(name=name, sides=sides) for name in ("first", "second")]
    Path("run").mkdir()
    write_pattern_json(draft_garment(Pattern(name="p", pieces={"": [cloth]}, seams=seams)), "run/pattern.json")
    ended = command("export", "run", "--format", "garmentcode")
    assert ended.code == 0
    assert ended.out == "run: p_specification.json\n"
    assert "cloth: GarmentCode knows no holes: eye left out" in ended.err
    assert "cloth: GarmentCode knows no lines inside: hip left out" in ended.err
    assert "seam 'second': one of its edges is in another seam" in ended.err
    assert [seam.name for seam in read_pattern("run/p_specification.json").seams] == ["first"]


def test_panels_hang_where_the_body_is():
    """A top hangs from the shoulders and a skirt of its own from the waist; fronts are in front."""
    top = [
        (0.0, 0.0),
        (50.0, 0.0),
        (50.0, 30.0),
        (40.0, 50.0),
        (32.0, 52.0),
        (25.0, 40.0),
        (18.0, 52.0),
        (10.0, 50.0),
        (0.0, 30.0),
    ]
    skirt = [(0.0, 0.0), (50.0, 0.0), (45.0, 60.0), (5.0, 60.0)]

    def other_side(panel_of: dict[str, Any]) -> dict[str, Any]:
        """The panel behind: its edges run the other way, and keep their numbers where k becomes -2 - k."""
        turned = copy.deepcopy(panel_of)
        turned["edges"] = [{**edge, "endpoints": edge["endpoints"][::-1]} for edge in reversed(panel_of["edges"])]
        turned["translation"] = [*panel_of["translation"][:2], -panel_of["translation"][2]]
        return turned

    panels: dict[str, Any] = {"top_f": panel(top, translation=[-25.0, 300.0, 30.0])}
    panels["skirt_f"] = panel(skirt, translation=[-25.0, 0.0, 30.0])
    panels["skirt_f"]["edges"][2]["label"] = "lower_interface"
    for name in list(panels):
        panels[name.replace("_f", "_b")] = other_side(panels[name])
    count = {name: len(each["edges"]) for name, each in panels.items()}
    stitches = [f"{f}.{k} {f.replace('_f', '_b')}.{count[f] - 1 - k}"
                for f, ks in (("top_f", (1, 3, 6, 8)), ("skirt_f", (1, 3)))
                for k in ks]  # fmt: skip
    pattern = garmentcode_pattern(file_of(panels, stitches), "p")
    pieces, seams, _ = whole_pieces(pattern.pieces[""], pattern.seams)
    meshed = mesh_pieces(pieces, seams, 0.03)
    body = warpflat.Mannequin.from_size("EU 38", resolution_mm=30.0)
    cloth = sew_meshes(meshed, warpflat.find_fabric("woven"))
    laid = lay_pieces(cloth, meshed, find_openings(cloth), body)
    assert {limb for limb in laid.limbs if limb} == {"left arm", "right arm"}
    # The skirt, a garment of its own, keeps its height, which is that of the waist at its upper edge.
    skirts = np.unique(np.concatenate([cloth.welded[cloth.piece_vertices[f"skirt_{side}"]] for side in "fb"]))
    np.testing.assert_array_equal(np.flatnonzero(laid.level), skirts)
    rows = cloth.piece_vertices["skirt_f"]
    waist = laid.positions[cloth.welded[rows][cloth.flat[rows, 1] > cloth.flat[rows, 1].max() - 1e-6]]
    assert waist[:, 1].mean() == pytest.approx(body.levels()["waist"].height, abs=0.02)

    def middle(name: str) -> np.ndarray:
        return np.asarray(laid.positions[cloth.welded[cloth.piece_vertices[name]]].mean(axis=0))

    for name in ("top", "skirt"):
        assert middle(f"{name}_f")[2] > middle(f"{name}_b")[2] + 0.05


@pytest.mark.parametrize("turned", [False, True])
def test_a_piece_hangs_before_the_one_that_it_is_sewn_to_beside_another(turned: bool):
    """A band along two pieces, of which nobody has said where they hang."""
    long, short = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.1), (0.0, 0.1)], [(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)]
    placed = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.9], [0.0, 0.0, 0.2]])
    pieces = [piece_of("band", long, placement=placed), piece_of("one", short), piece_of("other", short)]
    sides = side_of("band.e1", reversed=False), side_of("other.e3 + one.e3", reversed=True)
    seam = Seam(name="band", sides=sides[::-1] if turned else sides)
    written, _ = garmentcode_json(draft_garment(Pattern(name="p", pieces={"": pieces}, seams=[seam])))
    heights = {name: panel["translation"][2] for name, panel in written["pattern"]["panels"].items()}
    assert heights["one"] == pytest.approx(heights["other"])
    assert heights["one"] > heights["band"]


@needs_data
@pytest.mark.parametrize(("name", "seams", "darts"), [("dress_pencil", 15, 4), ("shirt_mean", 16, 0)])
def test_patterns_of_garmentcode_are_drafted(name: str, seams: int, darts: int):
    file = DATA / "patterns" / f"{name}.json"
    given = json.loads(file.read_text())["pattern"]
    drafted = read_drafted(file)
    read = drafted.pattern
    assert len(read.seams) == seams
    assert sum(len(piece.darts) for piece in read.pieces[""]) == darts
    stitched = sum(max(map(len, seam.sides)) for seam in read.seams) + darts
    assert stitched == len(given["stitches"])
    for piece in drafted.pieces[""]:
        for edge in piece.edges:
            assert edge.length == pytest.approx(edge.edge.length, abs=1e-4)
    assert all(seam.matches for seam in drafted.seams)
