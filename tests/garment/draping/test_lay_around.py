"""Garments are laid around a body by their openings: each around its limb, left and right, front and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from bodies import body_of_size
from plain_patterns import ARMHOLE, SLEEVE, TOP, top
from polygons import polygon, sewn

import warpflat
from warpflat.core.errors import InputError
from warpflat.garment.draping.drape_pattern import lay_pieces
from warpflat.garment.draping.lay_around import Laid
from warpflat.garment.draping.limbs import limb_lines, links
from warpflat.garment.draping.mesh_pieces import mesh_pieces, sew_meshes
from warpflat.garment.draping.openings import Opening, find_openings
from warpflat.garment.draping.sew_around import stretches
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.pattern.drafting.pieces import Piece, Seam


def lay(pieces: Sequence[Piece], seams: Sequence[Seam], **more: object) -> tuple[SewnCloth, list[Opening], Laid]:
    named = {each.name: each for each in pieces}
    meshed = mesh_pieces(named, seams, 0.03)
    cloth = sew_meshes(meshed, warpflat.find_fabric("woven"))
    openings = find_openings(cloth)
    laid = lay_pieces(cloth, meshed, openings, body_of_size(30.0), **more)  # type: ignore[arg-type]
    return cloth, openings, laid


def middle(cloth: SewnCloth, laid: Laid, name: str) -> np.ndarray:
    return np.asarray(laid.positions[cloth.welded[cloth.piece_vertices[name]]].mean(axis=0))


@pytest.mark.parametrize("swapped", [False, True])
def test_sleeves_go_around_the_arms_and_the_front_lies_in_front(swapped: bool):
    names = ("back", "front") if swapped else ("front", "back")
    cloth, openings, laid = lay(*top(*names))
    lines = limb_lines(body_of_size(30.0))
    for opening, limb in zip(openings, laid.limbs, strict=True):
        found = links(laid.positions[opening.vertices], lines)
        if limb:
            assert {each: abs(count) for each, count in found.items()} == {each: int(each == limb) for each in found}
        else:
            assert abs(found["left arm"]) + abs(found["left leg"]) > 0
    assert middle(cloth, laid, "front")[2] > middle(cloth, laid, "back")[2] + 0.1
    # Seen from its right side the first piece has the left sleeve on its right side, e2, if it lies in front.
    assert middle(cloth, laid, "l")[0] * (-1.0 if swapped else 1.0) > 0.15
    assert middle(cloth, laid, "r")[0] * (-1.0 if swapped else 1.0) < -0.15
    assert np.abs(stretches(cloth, laid.positions)).mean() < 0.05
    assert not laid.level.any()
    assert not laid.hooded
    # A wider neck lies farther out on the shoulders, and lower.
    neck = laid.positions[openings[-1].vertices, 1].mean()
    wide = [({0.16: 0.1, 0.34: 0.4}.get(x, x), y) for x, y in TOP]
    pieces, seams = top(*names)
    _, openings, laid = lay(
        [polygon(each.name, wide) if len(each.edges) == len(TOP) else each for each in pieces], seams
    )
    assert laid.positions[openings[-1].vertices, 1].mean() < neck - 0.01


def test_a_cuff_goes_with_its_sleeve_and_a_hood_around_the_head():
    pieces, seams = top()
    cuff = [(0.0, 0.0), (ARMHOLE, 0.0), (ARMHOLE, 0.06), (0.0, 0.06)]
    half = [(0.0, 0.0), (0.18, 0.0), (0.18, 0.3), (0.0, 0.3)]
    seams += [sewn("l.e0", "m.e2"), sewn("m.e1", "m.e3"), sewn("r.e2", "n.e2"), sewn("n.e1", "n.e3")]
    pieces += [polygon("m", cuff), polygon("n", cuff)]
    _, openings, laid = lay(pieces, seams)
    found = {limb: opening.pieces for limb, opening in zip(laid.limbs, openings, strict=True) if limb}
    assert set(found) == {"left arm", "right arm"}
    assert set(found.values()) == {frozenset("m"), frozenset("n")}
    assert not laid.hooded
    seams += [sewn("p.e4", "x.e0"), sewn("q.e4", "y.e0"), sewn("x.e2", "y.e2"), sewn("x.e1", "y.e3")]
    laid = lay([*pieces, polygon("x", half), polygon("y", half)], seams)[2]
    assert sorted(laid.limbs) == ["", "", "left arm", "right arm"]


def test_a_skirt_hangs_from_the_waist_and_is_as_symmetric_as_it_is_drawn():
    """Its upper edge is told by how it is drawn; a front is told by `at`, and a slit is no opening of its own."""
    shape = [(0.0, 0.0), (0.6, 0.0), (0.52, 0.5), (0.08, 0.5)]
    seams = [sewn("a.e1", "b.e3"), sewn("b.e1", "a.e3")]
    for at in ("front", "back"):
        cloth, openings, laid = lay([polygon("a", shape, at=at), polygon("b", shape)], seams)
        assert laid.limbs == ["", ""]
        assert laid.level.all()
        other = "a" if at == "front" else "b"
        assert middle(cloth, laid, other)[2] > 0.08
        assert abs(middle(cloth, laid, other)[0]) < 0.01
    waist = laid.positions[openings[1].vertices, 1]
    assert waist.mean() == pytest.approx(body_of_size(30.0).levels()["waist"].height, abs=0.02)
    assert laid.positions[openings[0].vertices, 1].mean() < waist.mean() - 0.4
    assert np.abs(stretches(cloth, laid.positions)).max() < 0.2
    lower = lay([polygon("a", shape), polygon("b", shape)], seams, top="hip")[2].positions
    hip = body_of_size(30.0).levels()["hip"].height
    assert lower[openings[1].vertices, 1].mean() == pytest.approx(hip, abs=0.02)
    with pytest.raises(InputError, match="level 'hop' is unknown"):
        lay([polygon("a", shape), polygon("b", shape)], seams, top="hop")


@pytest.mark.parametrize("hem", [0.2, 0.36])
def test_each_leg_goes_around_its_own(hem: float):
    """Wide ones, too, whose hems would reach around both legs."""
    front = [(0.0, 0.0), (hem, 0.0), (hem + 0.02, 0.63), (0.2, 0.9), (0.0, 0.9)]
    names = ("front left", "back left", "front right", "back right")
    # Each leg: the side seam, then the inside of the leg; the crotch joins both fronts and both backs.
    mirrored = [(-x, y) for x, y in front[::-1]]
    pieces = [
        polygon(names[0], mirrored), polygon(names[1], front), polygon(names[2], front), polygon(names[3], mirrored),
    ]  # fmt: skip
    # Edges of `front`: e0 hem, e1 inside, e2 crotch, e3 waist, e4 side; mirrored: e0 waist, e1 crotch, e2 inside, e3 hem, e4 side.
    seams = [
        sewn(f"{names[0]}.e4", f"{names[1]}.e4"), sewn(f"{names[2]}.e4", f"{names[3]}.e4"),
        sewn(f"{names[0]}.e2", f"{names[1]}.e1"), sewn(f"{names[2]}.e1", f"{names[3]}.e2"),
        sewn(f"{names[0]}.e1", f"{names[2]}.e2"), sewn(f"{names[1]}.e2", f"{names[3]}.e1"),
    ]  # fmt: skip
    cloth, openings, laid = lay(pieces, seams)
    assert sorted(laid.limbs) == ["", "left leg", "right leg"]
    lines = limb_lines(body_of_size(30.0))
    for opening, limb in zip(openings, laid.limbs, strict=True):
        if limb:
            around = links(laid.positions[opening.vertices], lines)
            assert abs(around[limb]) == 1
            assert sum(map(abs, around.values())) == 1
    for name in names:
        assert middle(cloth, laid, name)[2] * (1.0 if name.startswith("front") else -1.0) > 0.02
    sides = {name: np.sign(middle(cloth, laid, name)[0]) for name in names}
    assert sides[names[0]] == sides[names[1]] == -sides[names[2]] == -sides[names[3]]


def test_what_goes_around_nothing_is_refused_in_a_line():
    """A top that is open in front, and a rag."""
    left, right = ([(x, y) for x, y in half] for half in (TOP[1:6], TOP))
    half = [(0.25, 0.0), *left[:4], (0.25, 0.58)]
    mirrored = [(0.5 - x, y) for x, y in half[::-1]]
    pieces = [polygon("a", half), polygon("b", mirrored), polygon("q", right)]
    # `half`: e0 hem, e1 side, e2 armhole, e3 shoulder, e4 neck, e5 front; mirrored: e0 neck, e1 shoulder, e2 armhole, e3 side, e4 hem.
    seams = [sewn("a.e1", "q.e7"), sewn("a.e3", "q.e5"), sewn("b.e3", "q.e1"), sewn("b.e1", "q.e3")]
    with pytest.raises(
        InputError, match=r"slides off: its front is open, by a border of \d\.\d\d m; close it by a seam"
    ):
        lay(pieces, seams)
    with pytest.raises(InputError, match="has a single opening"):
        lay([polygon("a", SLEEVE), polygon("b", SLEEVE)], [sewn("a.e2", "b.e0")])
