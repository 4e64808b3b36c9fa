"""Garments are draped in one layer, and closed where their buttons lie."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size
from devices import DEVICE

import warpflat
from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops, join_labels
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.construction.details import FinishingTable, PocketTable
from warpflat.garment.construction.form_garment import FormGarment, flatten_form
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.continue_pieces import continue_pieces, hood_beside_head
from warpflat.garment.draping.drape_pattern import Placement, drape_pattern, place_drafted
from warpflat.garment.draping.mesh_pieces import mesh_pieces
from warpflat.garment.draping.moved_pattern import moved_outlines
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.result import Drape
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.garment.draping.worn_layer import closures, in_one_layer, right_side_out, turned_down
from warpflat.garment.mannequin.forms import shipped_form
from warpflat.garment.mannequin.head import head_of
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Elastic, Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.whole_pieces import turn_over, whole_pieces

NAMES = ("low", "stand", "high", "side")


def rectangle(name: str, width: float, height: float, names: tuple[str, ...] = NAMES, **more: object) -> Piece:
    """A piece whose named edges run from its lower left corner around it."""
    ring = np.array([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height), (0.0, 0.0)])
    edges = [Edge(name=each, points=ring[k : k + 2]) for k, each in enumerate(names)]
    return Piece(name=name, edges=edges, **more)  # type: ignore[arg-type]


def joined(name: str, first: str, second: str, *, mirrored: tuple[bool, bool] = (False, False)) -> Seam:
    """A seam of two edges "piece.edge", of which the second runs against its edge."""
    sides = [
        (SeamSide(piece=p, edge=e, reversed=k == 1, mirrored=m),)
        for k, ((p, e), m) in enumerate(zip((first.split("."), second.split(".")), mirrored, strict=True))
    ]
    return Seam(name=name, sides=(sides[0], sides[1]))


def buttoned_tube(half: float, *, buttons: bool) -> Pattern:
    """A back, and two halves of a front that overlap by 36 mm with their button stands; `half` is half of the way around [m]."""
    height, stand = 0.25, 0.018
    marks, lines = {}, {}
    for number, y in enumerate((0.03, 0.125, 0.22) if buttons else (), start=1):
        ending = f" {number}" if number > 1 else ""
        marks[f"button{ending}"] = np.array([0.5 * half, y])
        lines[f"buttonhole{ending}"] = np.array([[0.5 * half + 0.003, y], [0.5 * half - 0.012, y]])
    front = rectangle("front", 0.5 * half + stand, height, quantity=2, marks=marks, internal_lines=lines)
    back = rectangle("back", half, height, ("low", "right", "high", "left"))
    seams = [
        joined("side left", "back.left", "front.side", mirrored=(False, True)),
        joined("side right", "front.side", "back.right"),
    ]
    # The sides of the drawn half and of the one that is turned over run in opposite directions.
    seams[0] = replace(seams[0], sides=(seams[0].sides[0], (replace(seams[0].sides[1][0], reversed=False),)))
    return Pattern(name="tube", pieces={"": [front, back]}, seams=seams)


def test_fronts_are_closed_where_their_buttons_lie():
    """Buttoned, the tube is held by the hips; open, nothing holds it."""
    body, fabric = body_of_size(30.0), warpflat.find_fabric("woven")
    placement = Placement(spacing=0.03)
    pattern = buttoned_tube(0.475, buttons=True)
    worn, _ = drape_pattern(
        pattern, body, fabric=fabric, placement=placement, options=DrapeOptions(max_steps=400),
        device=DEVICE,
    )  # fmt: skip
    pieces, _, _ = whole_pieces(pattern.pieces[""], (), unsewn=True)
    places = {}
    for name, rows in worn.cloth.piece_vertices.items():
        flat, space = worn.cloth.flat[rows], worn.positions[worn.cloth.welded[rows]]
        for title, mark in pieces[name].marks.items():
            at = np.linalg.norm(flat - mark, axis=1).argmin()
            # There is a vertex where a button lies.
            np.testing.assert_allclose(flat[at], mark, atol=1e-12)
            places.setdefault(title, []).append(space[at])
    assert len(places) == 3
    for title, (one, other) in places.items():
        np.testing.assert_array_equal(one, other, err_msg=title)
        assert one[2] > 0.05, title
    # The stand of each half lies beyond the line where they meet.
    edges = {name: worn.positions[worn.cloth.lines[f"{name}.stand"]] for name in ("front", "front mirrored")}
    assert edges["front"][:, 0].mean() * edges["front mirrored"][:, 0].mean() < 0.0
    middle = {
        name: worn.positions[worn.cloth.welded[rows], 0].mean() for name, rows in worn.cloth.piece_vertices.items()
    }
    for name, points in edges.items():
        assert np.sign(points[:, 0].mean()) == -np.sign(middle[name]), name
    assert worn.positions[:, 1].max() > body.levels()["hip"].height
    # What was turned over to be worn right side out moves in its pattern the other way.
    rows = worn.cloth.piece_vertices["back"]
    turned, moved = worn.cloth.flat.copy(), worn.cloth.flat.copy()
    turned[rows] *= [-1.0, 1.0]
    moved[rows] = turned[rows] - [0.01, 0.0]
    before = replace(worn.cloth, flat=turned, turned=frozenset({"back"}))
    back = moved_outlines(pattern, "", before, replace(before, flat=moved)).piece("back", "")
    np.testing.assert_allclose(back.outline - [0.01, 0.0], pattern.piece("back", "").outline, atol=1e-12)
    with pytest.raises(InputError, match="falls off"):
        drape_pattern(buttoned_tube(0.475, buttons=False), body, fabric=fabric, placement=placement, device=DEVICE)


def test_a_cuff_is_closed_upon_itself():
    hole = np.array([[0.004, 0.03], [0.019, 0.03]])
    cuff = rectangle(
        "cuff",
        0.25,
        0.06,
        marks={"button": np.array([0.24, 0.03])},
        internal_lines={"buttonhole": hole, "buttonhole end 1": hole},
    )
    ((one, at), (other, its)) = closures({"cuff": cuff})[0]
    assert (one, other) == ("cuff", "cuff")
    np.testing.assert_allclose([at, its], [[0.24, 0.03], [0.0115, 0.03]])
    _, meshes, welds = mesh_pieces({"cuff": cuff}, [], 0.01)
    (((_, first), (_, second)),) = welds[-1]
    np.testing.assert_allclose(meshes["cuff"].points[[first, second]], [at, its])
    assert len(np.unique(meshes["cuff"].triangles)) == len(meshes["cuff"].points)
    apart = np.linalg.norm(meshes["cuff"].points[:, None] - [at, its], axis=2)
    assert np.sort(apart, axis=0)[1].min() > 0.005, "the lattice keeps off a button"


def test_what_others_mark_beyond_a_piece_closes_nothing():
    hole = np.array([[0.004, 0.03], [0.019, 0.03]])
    for button in ([0.30, 0.03], [0.25, 0.03], [0.24, 0.03]):
        marks = {" ": np.zeros(2), "button": np.array(button)}
        cuff = rectangle("cuff", 0.25, 0.06, marks=marks, internal_lines={"buttonhole": hole})
        assert len(closures({"cuff": cuff})) == (button[0] < 0.25), button


def wrapped(name: str = "front") -> Piece:
    """Half of a front that runs 8 cm beyond its centre line, with a tie at its upper corner."""
    centre = np.array([[0.2, 0.0], [0.2, 0.5]])
    return rectangle(
        name, 0.28, 0.5, quantity=2, marks={"tie": np.array([0.28, 0.5])}, internal_lines={"centre front": centre}
    )


def test_a_wrap_is_held_where_its_ties_begin():
    """Each half's corner lies on the other one, as far from the centre line."""
    one, other = wrapped(), replace(turn_over(wrapped()), name="front mirrored")
    found = closures({"front": one, "front mirrored": other})
    assert [tuple(name for name, _ in layers) for layers in found] == [
        ("front", "front mirrored"),
        ("front mirrored", "front"),
    ]
    for ((name, at), (_, its)), side in zip(found, (1.0, -1.0), strict=True):
        np.testing.assert_allclose(at, [0.27 * side, 0.49], atol=1e-9, err_msg=name)
        np.testing.assert_allclose(its, [-0.13 * side, 0.49], atol=1e-9, err_msg=name)
    # Without the other half, a centre line or a place within, nothing is tied.
    bare, thin = replace(other, internal_lines={}), rectangle("front", 0.28, 0.01, marks={"tie": np.zeros(2)})
    thin = replace(thin, internal_lines=one.internal_lines)
    for pieces in ((one,), (one, bare), (thin, replace(turn_over(thin), name="front mirrored"))):
        assert not closures({piece.name: piece for piece in pieces})


def test_marks_lie_on_what_is_cut_turned_over():
    front = rectangle("front", 0.2, 0.1, quantity=2, marks={"button": np.array([0.15, 0.04])})
    band = rectangle("band", 0.2, 0.1, marks={"button": np.array([0.15, 0.04])})
    folded = replace(band, edges=[*band.edges[:3], replace(band.edges[3], kind="fold")])
    pieces, _, _ = whole_pieces([front, folded], [], unsewn=True)
    np.testing.assert_allclose(pieces["front mirrored"].marks["button"], [-0.15, 0.04])
    np.testing.assert_allclose(pieces["band"].marks["button"], [0.15, 0.04])
    np.testing.assert_allclose(pieces["band"].marks["button mirrored"], [-0.15, 0.04])


def test_buttons_that_fit_no_buttonholes_close_nothing():
    """Of two pieces that are marked alike, the mirrored one is the other half; else there must be no choice."""
    hole = np.array([[0.185, 0.03], [0.2, 0.03]])
    marks = {"button": np.array([0.188, 0.03]), "button 2": np.array([0.188, 0.08])}
    lines = {"buttonhole": hole, "buttonhole 2": hole + np.array([0.0, 0.05])}
    front = rectangle("front", 0.21, 0.1, marks=marks, internal_lines=lines)
    other, third = (replace(front, name=name) for name in ("front mirrored", "other front"))
    bare = replace(other, marks={}, internal_lines={})
    one_hole = [replace(each, internal_lines={"buttonhole": hole}) for each in (front, other)]
    for pieces, count in (
        ([front, other, third], 2), ([front, third], 2), ([front, third, replace(front, name="fourth")], 0),
        ([front, bare], 0), (one_hole, 0),
    ):  # fmt: skip
        found = closures({piece.name: piece for piece in pieces})
        assert len(found) == count, [piece.name for piece in pieces]
        for (one, at), (another, its) in found:
            assert {one, another} == {piece.name for piece in pieces[:2]}
            np.testing.assert_array_equal(at, its)


def test_what_lies_within_is_left_out():
    """A grown-on facing is cut off at its fold, and its seam goes; so do a binding and a bag, but not what fills a cut-off corner."""
    around = {"low": [(0.0, 0.0), (0.25, 0.0)], "facing edge": [(0.25, 0.0), (0.25, 0.1)]}
    around |= {"lost.left": [(0.25, 0.1), (0.23, 0.11)], "lost.right": [(0.23, 0.11), (0.25, 0.12)]}
    around |= {"facing edge 2": [(0.25, 0.12), (0.25, 0.3)]}
    around |= {"facing neck": [(0.25, 0.3), (0.2, 0.32)], "neck": [(0.2, 0.32), (0.1, 0.3)]}
    around |= {"shoulder": [(0.1, 0.3), (0.0, 0.3)], "side 2": [(0.0, 0.3), (0.0, 0.22)]}
    around |= {"kept.left": [(0.0, 0.22), (0.04, 0.21)], "kept.right": [(0.04, 0.21), (0.0, 0.2)]}
    around |= {"side": [(0.0, 0.2), (0.0, 0.0)]}
    edges = [
        Edge(name=name, points=np.array(points), kind="dart" if "." in name else "seam")
        for name, points in around.items()
    ]
    lines = {"fold line": np.array([[0.2, 0.0], [0.2, 0.32]]), "waist": np.array([[0.0, 0.1], [0.2, 0.1]])}
    lines["stitching"] = np.array([[0.22, 0.0], [0.22, 0.3]])
    eye = np.array([[0.1, 0.1], [0.105, 0.15], [0.1, 0.2], [0.095, 0.15]])
    front = Piece(
        name="front",
        edges=edges,
        internal_lines=lines,
        darts=[Dart(name=name, left=f"{name}.left", right=f"{name}.right") for name in ("kept", "lost")],
        holes=[Hole(name="eye", points=eye), Hole(name="behind", points=eye + np.array([0.13, 0.0]))],
        marks={"button": np.array([0.18, 0.2]), "notch": np.array([0.24, 0.1])},
    )
    back = rectangle("back", 0.2, 0.3, ("low", "right", "shoulder", "left"))
    # A raw edge alone makes no binding, nor does a strip whose edges are all sewn or hemmed.
    back = replace(back, edges=[*back.edges[:3], replace(back.edges[3], kind="cut", allowance=0.0)])
    band, loop = rectangle("band", 0.2, 0.03, role="strip"), rectangle("loop", 0.02, 0.05)
    corner, bag = (rectangle(name, 0.1, 0.3, role="pocket") for name in ("corner", "bag"))
    facing = rectangle("neck facing", 0.1, 0.05, role="facing")
    binding = rectangle("binding", 0.2, 0.02, role="strip")
    turned = replace(binding.edges[2], kind="cut", allowance=0.0)
    binding = replace(binding, edges=[*binding.edges[:2], turned, binding.edges[3]])
    chain = tuple(SeamSide(piece=name, edge=edge) for name, edge in (("back", "low"), ("corner", "low")))
    seams = [
        joined("side", "front.side", "back.right"), joined("neck facing", "front.neck", "neck facing.low"),
        joined("grown-on", "front.shoulder", "front.facing neck"), joined("binding", "binding.low", "back.shoulder"),
        Seam(name="hem", sides=((SeamSide(piece="front", edge="low"),), chain)), joined("bag", "bag.side", "corner.side"),
        joined("band", "band.low", "back.left"), joined("loop", "loop.low", "neck facing.high"),
    ]  # fmt: skip
    pieces = (front, back, corner, bag, facing, binding, band, loop)
    kept, left, notes = in_one_layer({p.name: p for p in pieces}, seams, ())
    assert set(kept) == {"front", "back", "corner", "band"}
    assert [seam.name for seam in left] == ["side", "hem", "band"]
    assert notes == ["worn in one layer: bag, binding, front, loop, neck facing"]
    assert kept["front"].outline.max(axis=0) == pytest.approx([0.2, 0.32])
    assert {edge.name: edge.length for edge in kept["front"].edges if edge.kind != "dart"} == pytest.approx(
        {"low": 0.2, "fold line": 0.32, "neck": np.hypot(0.1, 0.02), "shoulder": 0.1, "side": 0.2, "side 2": 0.08}
    )
    assert set(kept["front"].marks) == {"button"}
    assert set(kept["front"].internal_lines) == {"waist"}
    assert [hole.name for hole in kept["front"].holes] == ["eye"]
    assert [dart.name for dart in kept["front"].darts] == ["kept"]


@pytest.mark.parametrize("turned", [False, True])
def test_what_fills_a_cut_off_corner_ends_at_the_pockets_opening(turned: bool):
    """Of the half of a bag that goes on behind the corner, the corner alone is worn, and it closes the opening."""
    front_ring = {"low": [(0.0, 0.0), (0.3, 0.0)], "outseam": [(0.3, 0.0), (0.3, 0.3)]}
    front_ring |= {
        "opening": [(0.3, 0.3), (0.27, 0.36), (0.2, 0.4)],
        "waist": [(0.2, 0.4), (0.0, 0.4)],
        "crotch": [(0.0, 0.4), (0.0, 0.0)],
    }
    corner_ring = {
        "under": [(0.1, 0.4), (0.1, 0.2)],
        "rim": [(0.1, 0.2), (0.3, 0.2)],
        "outseam under": [(0.3, 0.2), (0.3, 0.3)],
    }
    corner_ring |= {
        "outseam": [(0.3, 0.3), (0.3, 0.4)],
        "waist": [(0.3, 0.4), (0.2, 0.4)],
        "waist under": [(0.2, 0.4), (0.1, 0.4)],
    }
    front, corner = (
        Piece(name=name, role=role, edges=[Edge(name=each, points=np.array(points)) for each, points in ring.items()])
        for name, role, ring in (("front", "shell", front_ring), ("corner", "pocket", corner_ring))
    )
    bag, back = (
        rectangle("bag", 0.2, 0.1, role="pocket"),
        rectangle("back", 0.2, 0.4, ("low", "right", "waist", "left")),
    )
    band = rectangle("band", 0.5, 0.03)
    pieces = {piece.name: piece for piece in (front, corner, bag, back, band)}
    if turned:
        pieces = {name: replace(turn_over(piece), name=name) for name, piece in pieces.items()}
    rows = [
        tuple(SeamSide(piece=name, edge=edge, reversed=True) for name, edge in row)
        for row in ((("corner", "outseam"), ("front", "outseam")), (("corner", "waist"), ("front", "waist")))
    ]
    if turned:
        rows = [tuple(replace(side, reversed=False) for side in row) for row in rows]
    seams = [
        Seam(name="outseam", sides=((SeamSide(piece="back", edge="left"),), rows[0])),
        Seam(name="waist", sides=((SeamSide(piece="band", edge="low"),), rows[1])),
        joined("opening", "front.opening", "bag.low"), joined("rim", "corner.rim", "bag.high"),
    ]  # fmt: skip
    kept, left, notes = in_one_layer(pieces, seams, ())
    assert set(kept) == {"front", "corner", "back", "band"}
    assert notes == ["worn in one layer: bag"]
    assert [seam.name for seam in left] == ["outseam", "waist", "opening"]
    assert {edge.name: edge.length for edge in kept["corner"].edges} == pytest.approx(
        {"outseam": 0.1, "waist": 0.1, "opening": np.hypot(0.03, 0.06) + np.hypot(0.07, 0.04)}
    )
    one, other = (side[0] for side in left[-1].sides)
    lines = [kept[side.piece].edge(side.edge).points[:: -1 if side.reversed else 1] for side in (one, other)]
    np.testing.assert_allclose(lines[0], lines[1], atol=1e-12)
    # Nothing is cut that fits no opening.
    shorter = {**front_ring, "outseam": [(0.3, 0.0), (0.3, 0.34)], "opening": [(0.3, 0.34), (0.2, 0.4)]}
    front = Piece(name="front", edges=[Edge(name=name, points=np.array(points)) for name, points in shorter.items()])
    kept, _, _ = in_one_layer(pieces | {"front": turn_over(front) if turned else front}, seams, ())
    assert len(kept["corner"].edges) == 6


def test_a_second_layer_is_left_out_where_it_would_have_no_place_of_its_own():
    """A collar's is sewn to the first one alone; a cuff's copy is sewn to the other sleeve."""
    names = ("shell", "collar", "collar mirrored", "fall", "fall mirrored", "cuff", "cuff mirrored", "shell mirrored")
    pieces = {name: rectangle(name, 0.2, 0.1) for name in names}
    seams = [
        joined("collar", "collar.low", "shell.high"), joined("edge", "collar.high", "collar mirrored.high"),
        joined("fall", "fall.low", "collar.side"), joined("second fall", "fall mirrored.low", "collar mirrored.side"),
        joined("fall edge", "fall.high", "fall mirrored.high"), joined("cuff", "cuff.low", "shell.low"),
        joined("cuff mirrored", "cuff mirrored.low", "shell mirrored.low"), joined("centre", "shell.side", "shell mirrored.side"),
    ]  # fmt: skip
    kept, left, notes = in_one_layer(pieces, seams, {"shell"})
    assert kept.keys() == pieces.keys() - {"collar mirrored", "fall mirrored"}
    assert [seam.name for seam in left] == ["collar", "fall", "cuff", "cuff mirrored", "centre"]
    assert notes == ["worn in one layer: collar, fall"]
    # Where no piece has a designed surface, the pieces are placed by all of their seams.
    assert in_one_layer(pieces, seams, ())[0].keys() == pieces.keys()


@pytest.mark.parametrize("run_against", [False, True])
def test_strips_are_worn_right_side_out(run_against: bool):
    """A cuff's seam may be named in the direction of both outlines, and then it is turned over: no edge is run through twice."""
    sleeve = rectangle("sleeve", 0.2, 0.3, ("wrist", "one side", "cap", "other side"))
    cuff = rectangle("cuff", 0.2, 0.05, ("lower", "right", "upper", "left"), marks={"button": np.array([0.19, 0.02])})
    band = rectangle("band", 0.2, 0.02, ("lower", "right", "upper", "left"))
    sides = [(SeamSide(piece="cuff", edge="lower", reversed=run_against),), (SeamSide(piece="sleeve", edge="wrist"),)]
    seams = [Seam(name="cuff", sides=(sides[0], sides[1])), joined("band", "band.lower", "cuff.upper")]
    pieces, left, turned = right_side_out({piece.name: piece for piece in (cuff, sleeve, band)}, seams, {"sleeve"})
    # So does that of the other sleeve, whose surface is the mirror image of a designed one.
    other = {f"{piece.name} mirrored": replace(piece, name=f"{piece.name} mirrored") for piece in (cuff, sleeve, band)}
    others = [
        replace(seam, sides=tuple((replace(row[0], piece=f"{row[0].piece} mirrored"),) for row in seam.sides))
        for seam in seams
    ]
    assert right_side_out(other, others, {"sleeve"})[2] == {f"{name} mirrored" for name in turned}
    assert np.sign(pieces["cuff"].marks["button"][0]) == (1.0 if run_against else -1.0)
    # The seam of cuff and band is named rightly, so that the band follows.
    assert turned == (set() if run_against else {"cuff", "band"})
    _, meshes, welds = mesh_pieces(pieces, left, 0.02)
    begins = dict(zip(meshes, np.cumsum([0, *(len(mesh.points) for mesh in meshes.values())]).tolist(), strict=False))
    joints = [(begins[a] + i, begins[b] + j) for seam in welds for (a, i), *others in seam for b, j in others]
    count = sum(len(mesh.points) for mesh in meshes.values())
    welded = join_labels(count, *np.array(joints).T)
    faces = np.concatenate([welded[mesh.triangles + begins[name]] for name, mesh in meshes.items()])
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert len(np.unique(directed, axis=0)) == len(directed)
    assert len(border_loops(faces)) == 1


def test_a_fall_starts_turned_down_over_its_stand():
    """The stand goes on upwards from an upright shell, and the fall comes down from its upper edge."""
    shell = rectangle("shell", 0.2, 0.3)
    stand, fall = (
        rectangle(name, 0.2, height, role="collar") for name, height in (("collar_stand", 0.03), ("collar", 0.05))
    )
    seams = [joined("stand", "collar_stand.low", "shell.high"), joined("fall", "collar.low", "collar_stand.high")]
    pieces = {piece.name: piece for piece in (shell, stand, fall)}
    assert turned_down(pieces) == {"collar"}
    meshed = mesh_pieces(pieces, seams, 0.01)
    flat = meshed.meshes["shell"].points
    placed = {"shell": np.column_stack([flat, np.zeros(len(flat))])}
    for turned, low, high in (((), 0.33, 0.38), ({"collar"}, 0.28, 0.33)):
        found = continue_pieces(placed, meshed, turned)
        assert np.sort(found["collar_stand"][:, 1])[[0, -1]] == pytest.approx([0.3, 0.33], abs=1e-6)
        assert np.sort(found["collar"][:, 1])[[0, -1]] == pytest.approx([low, high], abs=1e-6)


def test_the_halves_of_a_hood_start_beside_the_head():
    """Both face forwards as they are drawn, also the half that is turned over; a strip over the crown goes on from them."""
    neckline = np.array([[0.0, 1.4, -0.06], [0.05, 1.39, -0.02], [0.06, 1.37, 0.04]])
    back = rectangle("back", 0.2, 0.3)
    half = rectangle("hood", 0.2, 0.3, role="hood")
    halves = {"hood": half, "hood mirrored": turn_over(half), "strip": rectangle("strip", 0.1, 0.3, role="hood")}
    meshed = mesh_pieces({"back": back, **halves}, [], 0.05)
    meshes = meshed.meshes
    rows = {name: meshes[name].edges["low"] for name in halves}
    rows["hood mirrored"] = rows["hood mirrored"][::-1]
    places = np.column_stack(
        [np.interp(np.linspace(0.0, 2.0, len(rows["hood"])), range(3), column) for column in neckline.T]
    )
    low = meshes["back"].edges["low"]
    around = np.zeros((len(meshes["back"].points), 3))
    around[low] = places
    across = np.array([-1.0, 1.0, 1.0])
    welds = [[[("hood", int(a)), ("back", int(b))] for a, b in zip(rows["hood"], low, strict=True)]]
    found = hood_beside_head({"back": around}, meshed._replace(welds=welds), set(halves), 0.09)
    assert set(found) == {"hood"}
    others = [[[("hood mirrored", int(a)), ("back", int(b))] for a, b in zip(rows["hood mirrored"], low, strict=True)]]
    found |= hood_beside_head({"back": around * across}, meshed._replace(welds=others), set(halves), 0.09)
    for name, side in (("hood", 1.0), ("hood mirrored", -1.0)):
        np.testing.assert_allclose(found[name][:, 0], 0.09 * side)
        np.testing.assert_allclose(np.ptp(found[name][:, 1:], axis=0), [0.3, 0.2])
        assert found[name][rows[name], 1].max() < 1.4
        assert found[name][rows[name][-1], 2] - found[name][rows[name][0], 2] == pytest.approx(0.2)
    strip = [
        [("strip", int(k)), ("back", int(b))] for k, b in zip(rows["strip"], low[: len(rows["strip"])], strict=False)
    ]
    middle = around - [0.5 * (places[: len(strip), 0].min() + places[: len(strip), 0].max()), 0.0, 0.0]
    assert not hood_beside_head({"back": middle}, meshed._replace(welds=[strip]), set(halves), 0.09)


def test_a_drape_begins_in_one_layer_right_side_out_with_its_collar_turned_down():
    """A facing is left out, a cuff whose seam is named in the direction of both outlines is turned over, and a fall comes down."""
    body = body_of_size(30.0)
    hip = body.levels()["hip"]
    radius = (hip.girth + 0.1) / (2.0 * np.pi)
    shell = rectangle("shell", 2.0 * np.pi * radius, 0.3)
    facing, cuff, stand, fall = (
        rectangle(name, 2.0 * np.pi * radius, high, role=role)
        for name, high, role in (
            ("facing", 0.04, "facing"), ("cuff", 0.05, "cuff"), ("collar_stand", 0.03, "collar"), ("collar", 0.05, "collar"),
        )
    )  # fmt: skip
    seams = [
        joined("facing", "facing.low", "facing.high"), joined("stand", "collar_stand.low", "shell.high"),
        joined("fall", "collar.low", "collar_stand.high"), joined("cuff", "cuff.low", "shell.low"),
        joined("side", "shell.stand", "shell.side"),
    ]  # fmt: skip
    seams[3] = replace(seams[3], sides=(seams[3].sides[0], (replace(seams[3].sides[1][0], reversed=False),)))
    pattern = Pattern(name="x", pieces={"": [shell, facing, cuff, stand, fall]}, seams=seams)

    def around(points: FloatArray) -> FloatArray:
        angle, height = points[:, 0] / radius, points[:, 1] + hip.height - 0.15
        return np.column_stack([radius * np.sin(angle), height, radius * np.cos(angle)])

    worn, notes = drape_pattern(
        pattern, body, fabric=warpflat.find_fabric("woven"),
        placement=Placement(lifts={"shell": around}, spacing=0.04, hold=["shell.high"]),
        options=DrapeOptions(max_steps=1), device=DEVICE,
    )  # fmt: skip
    assert notes == ["worn in one layer: facing"]
    assert set(worn.cloth.piece_vertices) == {"shell", "cuff", "collar_stand", "collar"}
    assert worn.cloth.turned == {"cuff"}
    top = hip.height + 0.15
    begins = {
        name: worn.cloth.designed[worn.cloth.welded[rows], 1] - top for name, rows in worn.cloth.piece_vertices.items()
    }
    assert begins["collar_stand"].max() > 0.02
    assert begins["collar"].min() < -0.01
    assert begins["cuff"].min() < -0.34


def test_an_elastic_draws_its_edge_to_the_body_at_its_height_and_holds_it():
    """A tube that is far too wide hangs from it; without it, the tube falls."""
    body, girth = body_of_size(30.0), 1.5
    hip = body.levels()["hip"].height
    tube = rectangle("tube", girth, 0.15, ("low", "right", "waist", "left"))
    elastic = Elastic(edge="waist", width=0.03, lengths={"": 0.7})
    pattern = Pattern(
        name="x", pieces={"": [tube]}, seams=[joined("side", "tube.left", "tube.right")], elastics=[elastic]
    )

    def around(points: FloatArray) -> FloatArray:
        radius = girth / (2.0 * np.pi)
        return np.column_stack(
            [radius * np.sin(points[:, 0] / radius), hip + points[:, 1], radius * np.cos(points[:, 0] / radius)]
        )

    def worn(pattern: Pattern) -> tuple[Drape, list[str]]:
        return drape_pattern(
            pattern, body, fabric=warpflat.find_fabric("woven"), placement=Placement(lifts={"tube": around}, spacing=0.04),
            options=DrapeOptions(max_steps=2000), device=DEVICE,
        )  # fmt: skip

    drape, notes = worn(pattern)
    waist = drape.positions[drape.cloth.lines["tube.waist"]]
    assert notes[-1] == "held by an elastic: waist"
    assert np.abs(drape.body.gaps(waist)).max() < 0.002
    assert np.ptp(waist[:, 1]) < 0.01
    assert drape.hangs_below == pytest.approx(hip)
    with pytest.raises(InputError, match="falls off"):
        worn(replace(pattern, elastics=()))


def test_a_pattern_is_compared_with_where_its_elastic_has_drawn_it():
    body = body_of_size(30.0)
    hip = body.levels()["hip"]
    radius = (hip.girth + 0.1) / (2.0 * np.pi)
    tube = rectangle("tube", 2.0 * np.pi * radius, 0.15, ("low", "right", "waist", "left"))
    elastic = Elastic(edge="waist", width=0.03, lengths={"": 0.7})
    pattern = Pattern(
        name="x", pieces={"": [tube]}, seams=[joined("side", "tube.left", "tube.right")], elastics=[elastic]
    )

    def around(points: FloatArray) -> FloatArray:
        angle = points[:, 0] / radius
        return np.column_stack([radius * np.sin(angle), hip.height - 0.05 + points[:, 1], radius * np.cos(angle)])

    drape, _ = drape_pattern(
        pattern, body, fabric=warpflat.find_fabric("woven"), placement=Placement(lifts={"tube": around}, spacing=0.04),
        options=DrapeOptions(max_steps=1), device=DEVICE,
    )  # fmt: skip
    assert drape.compared_with == "designed surface"
    assert drape.distance[drape.cloth.lines["tube.waist"]].max() < 1e-6


def test_a_hood_is_draped_over_a_head(monkeypatch: pytest.MonkeyPatch):
    body = body_of_size(30.0)
    hip, neck = body.levels()["hip"], body.levels()["neck"].height
    radius = (hip.girth + 0.1) / (2.0 * np.pi)
    shell = rectangle("shell", 2.0 * np.pi * radius, 0.3)
    hood = rectangle("hood", np.pi * radius, 0.3, ("neck", "front edge", "upper", "crown"), quantity=2, role="hood")
    chain = (SeamSide(piece="hood", edge="neck", mirrored=True, reversed=True), SeamSide(piece="hood", edge="neck"))
    seams = [
        Seam(name="hood", sides=((SeamSide(piece="shell", edge="high", reversed=True),), chain)),
        joined("side", "shell.stand", "shell.side"),
    ]
    pattern = Pattern(name="x", pieces={"": [shell, hood]}, seams=seams)
    begins = list[dict[str, FloatArray]]()

    def kept(cloth: SewnCloth, start: FloatArray, *_: object, **__: object) -> FloatArray:
        begins.append({name: start[cloth.welded[rows]] for name, rows in cloth.piece_vertices.items()})
        return start

    def around(points: FloatArray) -> FloatArray:
        angle, height = points[:, 0] / radius - np.pi, points[:, 1] + neck - 0.4
        return np.column_stack([-radius * np.sin(angle), height, -radius * np.cos(angle)])

    monkeypatch.setattr("warpflat.garment.draping.drape_pattern.sew_around", kept)
    # The shell, a bare cylinder, is worn where it is.
    monkeypatch.setattr("warpflat.garment.draping.drape_pattern._elsewhere", lambda *_: "")
    for role in ("hood", "collar"):
        pattern = replace(pattern, pieces={"": [shell, replace(hood, role=role)]})
        worn, _ = drape_pattern(
            pattern, body, fabric=warpflat.find_fabric("woven"),
            placement=Placement(lifts={"shell": around}, spacing=0.04, hold=["shell.high"]),
            options=DrapeOptions(max_steps=1), device=DEVICE,
        )  # fmt: skip
        assert (worn.body.vertices[:, 1].max() > body.lengths["stature"] - 0.001) == (role == "hood")
    far = np.abs(head_of(body)[0][:, 0]).max() + 0.01
    for name, side in (("hood", -1.0), ("hood mirrored", 1.0)):
        assert np.median(begins[0][name][:, 0]) == pytest.approx(side * far), name
        assert np.abs(begins[1][name][:, 0]).max() > 1.2 * far


def placed_on(form: str, *, turned: bool = False, **more: object) -> tuple[FormGarment, dict[str, list[Surface]]]:
    """A garment with finishing or pockets, and where these are worn; `turned` draws the lines inside its pieces from their other ends."""
    mannequin = body_of_size(30.0)
    made = flatten_form(mannequin, mannequin.form(shipped_form(form)), fabric="woven", sewn=True, curves_mm=0.0)
    garment = replace(made, **more)  # type: ignore[arg-type]
    pattern, _ = pattern_of_garment({"": garment}, name=form)
    if turned:
        lines = [{name: line[::-1] for name, line in reversed(p.internal_lines.items())} for p in pattern]
        pieces = [replace(piece, internal_lines=own) for piece, own in zip(pattern, lines, strict=True)]
        pattern = replace(pattern, pieces={"": pieces})
    return garment, place_drafted(pattern, garment)


def test_a_flounce_falls_from_its_edge_and_a_waistband_stands_on_it():
    wishes = [
        FinishingTable(kind="waistband", edge="waist", width_mm=30),
        FinishingTable(kind="flounce", edge="knee", width_mm=200, turns=0.5),
    ]
    garment, worn = placed_on("skirt", finishing=wishes)
    cloth = np.concatenate([piece.surface.vertices for piece in garment.pieces.values()])
    low, high = cloth[:, 1].min(), cloth[:, 1].max()
    (band,) = worn.pop("waistband")
    assert low < band.vertices[:, 1].min()
    assert 0.02 < band.vertices[:, 1].max() - high < 0.04
    skirt = np.concatenate([copy.vertices for copies in worn.values() for copy in copies])
    assert skirt[:, 1].max() < low + 0.01
    # It stands out by 0.4 of what it falls, all around.
    assert low - skirt[:, 1].min() == pytest.approx(0.2 / np.hypot(1.0, 0.4), abs=0.02)
    hem, edge = skirt[skirt[:, 1] < skirt[:, 1].min() + 0.02], cloth[cloth[:, 1] < low + 0.005]
    assert (np.ptp(hem, axis=0) - np.ptp(edge, axis=0))[[0, 2]] == pytest.approx(2 * 0.4 * 0.186, abs=0.03)


@pytest.mark.parametrize("turned", [False, True])
def test_a_patch_lies_on_its_piece(turned: bool):
    pocket = PocketTable(kind="patch", piece="front", width_mm=120, height_mm=100, line="abdomen", below_mm=10)
    garment, worn = placed_on("skirt", turned=turned, pockets=[pocket])
    (name,) = worn
    assert name == "front_pocket"
    cloth = garment.pieces["front"].surface.vertices
    for patch in worn[name]:
        far = np.linalg.norm(patch.vertices[:, None] - cloth, axis=2).min(axis=1)
        assert far.max() < 0.03
        assert np.ptp(patch.vertices[:, 1]) == pytest.approx(0.115, abs=0.01)


def test_a_turned_down_collar_lies_on_the_garment():
    collar = FinishingTable(kind="collar", edge="neck", style="convertible", width_mm=70, placket_mm=140)
    garment, worn = placed_on("shirt", finishing=[collar])
    surfaces = [piece.surface for piece in garment.pieces.values()]
    first = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    faces = [np.where(each.faces >= 0, each.faces + at, -1) for each, at in zip(surfaces, first, strict=False)]
    shirt = Body(
        np.concatenate([each.vertices for each in surfaces]), np.concatenate(faces).astype(np.int32), device=DEVICE
    )
    points = np.concatenate([copy.vertices for copies in worn.values() for copy in copies])
    centre, normal = shirt.nearest(points)
    height = np.einsum("ij,ij->i", points - centre, normal)
    assert np.ptp(points[:, 0]) > 0.2
    assert height.min() > -1e-3
    # But for the neckline it lies on the cloth, and no chord of it within.
    assert np.quantile(height, 0.3) > 1e-3
