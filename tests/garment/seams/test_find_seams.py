"""Whole garments are cut where a tailor would cut them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import seam_solids as solids

import warpflat
from warpflat.flat.surface.connectivity import border_loops, euler_characteristic
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.construction.sew_pieces import meeting_borders, unsewn_borders
from warpflat.garment.seams.anatomy import averaged_limbs, find_anatomy
from warpflat.garment.seams.find import FoundSeams, cloth_of
from warpflat.garment.seams.thickness import even_line, without_thickness

SHIRTS = {
    "T-pose": {"arm": 0.0},
    "A-pose": {"arm": 0.8},
    "hanging": {"arm": 1.35},
    "short sleeves": {"arm": 0.5, "sleeve": 0.27},
}


@cache
def shirt(name: str) -> Surface:
    return solids.shirt(step=0.035, **SHIRTS[name])


@cache
def trousers() -> Surface:
    return solids.trousers()


def broken_by_seams(found: FoundSeams) -> list[str]:
    """What holds of the pieces of every garment, and not of these: each lies flat as a disk, and all borders along seams meet."""
    pieces = {piece.name: piece for piece in found.pieces}
    sewn = sum(
        float(np.linalg.norm(np.diff(pieces[pair.pieces[0]].vertices[pair.vertices[0]], axis=0), axis=1).sum())
        for pair in meeting_borders(pieces)
    )
    holds = {
        "pieces are disks": all(
            euler_characteristic(piece.faces) == len(border_loops(piece.faces)) == 1 for piece in found.pieces
        ),
        "pieces have names of their own": len(pieces) == len(found.pieces),
        "borders are sewn": not unsewn_borders(pieces),
        "seams are as long as the borders": sewn == pytest.approx(sum(seam.length for seam in found.seams), rel=1e-9),
    }
    return [what for what, is_so in holds.items() if not is_so]


def without(surface: Surface, *beyond: Callable[[np.ndarray], np.ndarray]) -> Surface:
    """A surface without what lies where fields of places are positive."""
    cloth = cloth_of(surface)
    for field in beyond:
        cloth, outside, _ = replace(cloth, values={"beyond": field(cloth.vertices)}).split(
            "beyond", np.ones(len(cloth.faces), dtype=bool)
        )
        cloth = replace(cloth, faces=cloth.faces[~outside], values={})
    used, place = np.unique(cloth.faces, return_inverse=True)
    return warpflat.make_surface(cloth.vertices[used], place.reshape(-1, 3), component="largest")


def worn(*more: solids.Distance, arm: float) -> Surface:
    """A closed skin around trunk, neck and arms that hang, and around more."""
    parts = [solids.rod([0, -0.05, 0], [0, 0.45, 0], 0.17, 0.65), solids.rod([0, 0.45, 0], [0, 0.75, -0.02], 0.06)]
    for side in (1.0, -1.0):
        way = np.array([side * np.cos(arm), -np.sin(arm), 0.0])
        root = np.array([0.14 * side, 0.5, 0.0])
        parts.append(solids.rod(root, root + 0.45 * way, 0.065))
    return solids.skin(solids.joined([*parts, *more], 0.02), [-0.65, -0.25, -0.25], [0.65, 1.0, 0.25], 0.035)


def below_hem(points: np.ndarray) -> np.ndarray:
    return -points[:, 1]


# The second is open in front by so much that what is left of it is no wider than the neck.
@pytest.mark.parametrize(("radius", "face"), [(0.12, 0.05), (0.1, 0.0)])
def test_a_hood_is_cut_off_at_the_neck_and_in_halves(radius: float, face: float) -> None:
    arm = 0.6
    closed = worn(solids.rod([0, 0.72, -0.02], [0, 0.78, -0.02], radius), arm=arm)
    found = warpflat.find_seams(
        without(
            closed,
            below_hem,
            lambda points: np.abs(points[:, 0]) * np.cos(arm) - points[:, 1] * np.sin(arm) - 0.24,
            lambda points: np.minimum(points[:, 2] - face, points[:, 1] - 0.66),
        )
    )
    assert {piece.name for piece in found.pieces} == {
        "front", "back", "left_sleeve", "right_sleeve", "left_hood", "right_hood"
    }  # fmt: skip
    assert {"hood", "hood centre"} < {seam.name for seam in found.seams}
    assert broken_by_seams(found) == []
    hood = next(piece for piece in found.pieces if piece.name == "left_hood")
    assert hood.vertices[:, 1].min() > 0.55
    # As the face is open, nothing of the trunk's lines runs over the crown.
    assert max(p.vertices[:, 1].max() for p in found.pieces if not p.name.endswith("hood")) < 0.75


def test_the_armhole_of_bare_shoulders_ends_at_the_neck() -> None:
    arm = 0.9
    found = warpflat.find_seams(
        without(
            worn(arm=arm),
            below_hem,
            lambda points: points[:, 1] - 0.43,
            lambda points: np.abs(points[:, 0]) * np.cos(arm) - points[:, 1] * np.sin(arm) - 0.05,
        )
    )
    assert {piece.name for piece in found.pieces} == {"front", "back", "left_sleeve", "right_sleeve"}
    assert {seam.name.rsplit(" ", 1)[0] for seam in found.seams} == {"armhole", "side", "underarm"}
    assert broken_by_seams(found) == []
    assert all("neck" in piece.lines for piece in found.pieces)


@pytest.mark.parametrize("name", SHIRTS)
def test_a_shirt_becomes_front_back_and_two_sleeves(name: str) -> None:
    found = warpflat.find_seams(shirt(name))
    assert found.what == "top, 2 sleeves"
    assert {piece.name for piece in found.pieces} == {"front", "back", "left_sleeve", "right_sleeve"}
    assert {seam.name for seam in found.seams} == {
        f"{seam} {side}" for seam in ("armhole", "underarm", "side", "shoulder") for side in ("left", "right")
    }
    assert broken_by_seams(found) == []
    by_name = {piece.name: piece for piece in found.pieces}
    # The wearer's left is +x, as the front faces +z.
    assert by_name["left_sleeve"].vertices[:, 0].min() > 0.05
    assert by_name["front"].vertices[:, 2].mean() > 0.03
    # The armhole passes the armpit, which is nearer to the trunk than to the wrist, and goes over the shoulder.
    edges = [line for key, line in by_name["front"].lines.items() if key.startswith("armhole")]
    armhole = by_name["front"].vertices[np.concatenate(edges)]
    assert np.abs(armhole[:, 0]).min() > 0.13
    assert np.abs(armhole[:, 0]).max() < 0.30


def test_the_sleeves_of_a_waisted_shirt_begin_at_its_armpits_not_at_its_waist() -> None:
    plain = solids.shirt(arm=0.9, sleeve=0.235, step=0.035)
    height = plain.vertices[:, 1]
    narrower = np.where(height < 0.4, 1.0 - 0.5 * np.exp(-(((height - 0.15) / 0.12) ** 2)), 1.0)
    waisted = warpflat.make_surface(plain.vertices * np.stack([narrower, 0 * narrower + 1, narrower], 1), plain.faces)
    cloth = cloth_of(waisted)
    anatomy = find_anatomy(cloth)
    assert [limb.kind for limb in anatomy.limbs] == ["sleeve", "sleeve"]
    assert [limb.fork[1] for limb in anatomy.limbs] == pytest.approx([0.415, 0.415], abs=0.02)


def test_a_sleeves_end_that_turns_inwards_to_the_wrist_is_no_cloth() -> None:
    surface = shirt("T-pose")
    vertices, faces = [surface.vertices], surface.faces.tolist()
    for loop in border_loops(surface.faces):
        rim = surface.vertices[loop]
        if abs(rim[:, 0].mean()) < 0.3:
            continue
        middle, around = rim.mean(axis=0), len(loop)
        before = loop.tolist()
        for share, inwards in ((0.85, 0.001), (0.6, 0.0055)):
            ring = middle + share * (rim - middle)
            ring[:, 0] -= np.sign(middle[0]) * inwards
            first = sum(map(len, vertices))
            vertices.append(ring)
            row = list(range(first, first + around))
            faces += [[before[(k + 1) % around], before[k], row[k], row[(k + 1) % around]] for k in range(around)]
            before = row
    found = warpflat.find_seams(warpflat.make_surface(np.concatenate(vertices), faces))
    assert any("drawn thickness" in note for note in found.notes)
    assert sum(map(_area, found.pieces)) == pytest.approx(_area(surface), rel=3e-3)


def test_one_sleeve_is_found_where_front_and_back_mirror_each_other() -> None:
    rods = [
        solids.rod((0, 1.0, 0), (0, 1.42, 0), 0.17, 0.7),
        solids.rod((0, 1.42, 0), (0, 1.75, 0), 0.065),
        solids.rod((0.16, 1.45, 0), (0.75, 1.45, 0), 0.062),
    ]
    openings = [((0, 0.95, 0), (0, -1, 0)), ((0, 1.62, 0), (0, 1, 0)), ((0.62, 1.45, 0), (1, 0, 0))]
    found = warpflat.find_seams(
        solids.skin(solids.joined(rods, 0.03), (-0.4, 0.7, -0.3), (0.9, 1.9, 0.3), 0.045, openings)
    )
    assert found.what == "top, 1 sleeve"
    assert sorted(piece.name for piece in found.pieces) == ["back", "front", "left_sleeve"]
    assert {"armhole left", "underarm left", "shoulder left", "side left", "side right"} == {
        s.name for s in found.seams
    }


def test_left_and_right_are_mirror_images() -> None:
    found = {seam.name: seam for seam in warpflat.find_seams(shirt("T-pose")).seams}
    for name in ("armhole", "side", "shoulder", "underarm"):
        assert found[f"{name} left"].length == pytest.approx(found[f"{name} right"].length, abs=4e-3)


def test_trousers_become_four_legs() -> None:
    found = warpflat.find_seams(trousers())
    assert {piece.name for piece in found.pieces} == {
        f"{side}_{part}_leg" for side in ("left", "right") for part in ("front", "back")
    }
    assert {"centre front", "centre back", "inseam left", "side right"} <= {seam.name for seam in found.seams}
    assert broken_by_seams(found) == []
    # The grain of a leg hangs.
    for piece in found.pieces:
        line = piece.vertices[piece.lines["grain"]]
        way = line[-1] - line[0]
        assert abs(way[1]) > 0.98 * np.linalg.norm(way)


def test_a_panel_of_a_leg_is_no_band() -> None:
    panel = warpflat.SeamCut(name="panel", plane=((0.155, 0.0, 0.0), (1.0, 0.107, 0.0)))
    found = warpflat.find_seams(trousers(), warpflat.SeamOptions(cuts=(panel,)))
    # It is narrow, and ends at the waist and at the ankle.
    assert {piece.name for piece in found.pieces if piece.name.startswith("left")} == {
        "left_front_leg", "left_back_leg", "left_leg",
    }  # fmt: skip


def test_a_skirt_becomes_front_and_back() -> None:
    found = warpflat.find_seams(solids.skirt())
    assert {piece.name for piece in found.pieces} == {"front", "back"}
    assert broken_by_seams(found) == []
    # Its side seams lie in the plane between front and back.
    pieces = {piece.name: piece for piece in found.pieces}
    for pair in meeting_borders(pieces):
        assert np.abs(pieces[pair.pieces[0]].vertices[pair.vertices[0]][:, 2]).max() < 2e-3


def test_the_front_is_where_the_user_says() -> None:
    found = warpflat.find_seams(solids.skirt(), warpflat.SeamOptions(front="-z"))
    front = next(piece for piece in found.pieces if piece.name == "front")
    assert front.vertices[:, 2].mean() < 0.0
    with pytest.raises(warpflat.InputError, match=r"front = 'z' is no direction; .*\+z"):
        warpflat.find_seams(solids.skirt(), warpflat.SeamOptions(front="z"))


def test_a_garment_that_lies_on_its_back_is_set_upright() -> None:
    surface = trousers()
    turned = surface.vertices @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    lying = warpflat.make_surface(turned, surface.faces, name="trousers")
    found = warpflat.find_seams(lying)
    assert found.up == "+z"
    assert {seam.name for seam in found.seams} == {seam.name for seam in warpflat.find_seams(surface).seams}


def test_seams_can_be_left_closed() -> None:
    found = warpflat.find_seams(shirt("T-pose"), warpflat.SeamOptions(no=("shoulder",)))
    assert not any(seam.name.startswith("shoulder") for seam in found.seams)
    assert {piece.name for piece in found.pieces} >= {"left_sleeve", "right_sleeve"}
    assert len(found.pieces) == 3


def test_thickness_drawn_at_a_hem_is_no_cloth() -> None:
    surface = solids.skirt()
    loop = max(border_loops(surface.faces), key=lambda ids: -surface.vertices[ids, 1].mean())
    inner = surface.vertices[loop] * [0.95, 1.0, 0.95]
    upper = inner + np.array([0.0, 0.03, 0.0])
    count, around = len(surface.vertices), len(loop)
    faces = surface.faces.tolist()
    rows = [loop.tolist(), [count + k for k in range(around)], [count + around + k for k in range(around)]]
    for one, other in pairwise(rows):
        faces += [[one[(k + 1) % around], one[k], other[k], other[(k + 1) % around]] for k in range(around)]
    thick = warpflat.make_surface(np.concatenate([surface.vertices, inner, upper]), faces)
    found = warpflat.find_seams(thick)
    assert any("drawn thickness" in note for note in found.notes)
    area = sum(_area(piece) for piece in found.pieces)
    assert area == pytest.approx(_area(surface), rel=1e-6)


@pytest.mark.parametrize(("share", "is_rim"), [(0.95, True), (0.8, False)])
def test_a_narrow_rim_across_a_hem_is_no_cloth_and_a_wide_one_is(share: float, *, is_rim: bool) -> None:
    surface = solids.skirt()
    hem = np.arange(40)
    rim = np.stack([np.roll(hem, -1), hem, hem + 640, np.roll(hem, -1) + 640], axis=1)
    vertices = np.concatenate([surface.vertices, surface.vertices[hem] * [share, 1.0, share] + [0.0, 0.001, 0.0]])
    kept, notes = without_thickness(cloth_of(warpflat.make_surface(vertices, [*surface.faces.tolist(), *rim.tolist()])))
    assert bool(notes) == is_rim
    assert (kept.face_areas.sum() == pytest.approx(_area(surface), rel=1e-6)) == is_rim


def test_what_is_taken_off_at_an_opening_ends_in_an_even_line() -> None:
    cloth = cloth_of(solids.skirt(rows=40, around=80))
    middles = cloth.vertices[cloth.faces].mean(axis=1)
    column = (np.arctan2(middles[:, 0], middles[:, 2]) * 40 / np.pi).astype(int) % 80
    ragged = middles[:, 1] > 0.55 + 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, 80)[column]
    made, taken = even_line(cloth, ragged, float(np.sqrt(cloth.face_areas.sum())))
    kept = made.faces[~taken]
    loop = max(border_loops(kept.astype(np.int32)), key=lambda ids: made.vertices[ids, 1].mean())
    heights = made.vertices[loop, 1]
    # Teeth of up to 40 mm become a line that rises by little from one point to the next.
    assert np.abs(np.diff(heights)).max() < 0.004
    assert np.ptp(heights) < 0.016
    assert heights.mean() == pytest.approx(0.55, abs=0.005)
    assert made.face_areas.sum() == pytest.approx(cloth.face_areas.sum(), rel=1e-3)


def _area(surface: Surface) -> float:
    faces = np.concatenate([surface.faces[:, [0, 1, 2]], surface.faces[surface.faces[:, 3] >= 0][:, [0, 2, 3]]])
    a, b, c = surface.vertices[faces].transpose(1, 0, 2)
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def test_an_armhole_turns_forwards_with_a_raised_sleeve() -> None:
    way = np.array([1.0, 0.86, 0.64]) / np.linalg.norm([1.0, 0.86, 0.64])
    parts = [solids.rod([0, -0.05, 0], [0, 0.45, 0], 0.17, 0.65), solids.rod([0, 0.45, 0], [0, 0.75, -0.02], 0.06)]
    openings: list[solids.Plane] = [([0, 0, 0], [0, -1, 0]), ([0, 0.66, 0.0], [0, 0.94, 0.34])]
    for side in (1.0, -1.0):
        mirror = np.array([side, 1.0, 1.0])
        root = np.array([0.12, 0.5, 0.0])
        parts.append(solids.rod(root * mirror, (root + 0.35 * way) * mirror, 0.06))
        openings.append(((root + 0.28 * way) * mirror, way * mirror))
    shirt = solids.skin(solids.joined(parts, 0.02), [-0.6, -0.2, -0.3], [0.6, 1.0, 0.5], 0.035, openings)
    found = warpflat.find_seams(shirt)
    length = {seam.name: seam.length for seam in found.seams}
    sleeve = next(piece for piece in found.pieces if piece.name == "left_sleeve")
    rim = sleeve.vertices[sleeve.lines["sleeve"]]
    # Square to the side it would be a fifth longer than the sleeve is wide.
    assert length["armhole left"] < 1.18 * float(np.linalg.norm(np.diff(rim, axis=0), axis=1).sum())
    assert length["armhole left"] == pytest.approx(length["armhole right"], abs=1e-4)


def test_limbs_of_a_garment_of_equal_sides_are_mirror_images() -> None:
    cloth = cloth_of(solids.shirt(0.4))
    anatomy = find_anatomy(cloth)
    left, right = sorted(anatomy.limbs, key=lambda limb: -limb.side)
    off = replace(left, along=np.array([0.6, 0.0, 0.8]), fork=left.fork + np.array([0.0, 0.3, 0.0]))
    anatomy = replace(anatomy, limbs=(off, right))
    apart = averaged_limbs(anatomy, alike=False)
    assert apart[0] is off
    one, other = averaged_limbs(anatomy, alike=True)
    np.testing.assert_allclose(one.along - 2.0 * (one.along @ anatomy.normal) * anatomy.normal, other.along, atol=1e-12)
    assert (one.fork + other.fork) @ anatomy.normal == pytest.approx(2.0 * anatomy.offset)


def test_holes_in_the_mesh_are_closed_before_it_is_cut() -> None:
    plain = solids.skirt(60, 140)
    middles = plain.vertices[plain.faces].mean(axis=1)
    keep = np.ones(len(plain.faces), dtype=bool)
    for place in ([0.0, 0.3, 0.16], [0.05, 0.2, -0.17], [-0.1, 0.1, 0.17]):
        keep[np.linalg.norm(middles - place, axis=1).argmin()] = False
    found = warpflat.find_seams(warpflat.make_surface(plain.vertices, plain.faces[keep], name="skirt"))
    assert {seam.name for seam in found.seams} == {"side left", "side right"}
    assert [len(border_loops(piece.faces)) for piece in found.pieces] == [1, 1]
    assert any(note.startswith("3 holes of at most ") and note.endswith(" mm around closed") for note in found.notes)
