"""Corners trued: edges run on across seams, darts and folds; seams keep their lengths; walked seams show what differs."""

from dataclasses import replace

import numpy as np
import pytest

from warpflat.pattern.drafting.curves import chords, fit_curve
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.truing import true_corners, turned_end
from warpflat.pattern.drafting.walked import walk_seams


def quad(name: str, corners: list[tuple[float, float]], fold: bool = False) -> Piece:
    """Return a piece with four edges: hem, side, top and centre."""
    points = np.array([*corners, corners[0]])
    kinds = ("hem", "seam", "seam", "fold" if fold else "seam")
    names = ("hem", "side", "top", "centre")
    return Piece(
        name=name,
        edges=[
            Edge(name=n, points=points[k : k + 2], kind=kind)
            for k, (n, kind) in enumerate(zip(names, kinds, strict=True))
        ],
    )


def flared(hem_drop: float, length: float = 0.4) -> Pattern:
    """Return half a front on the fold sewn at the side to a like back; both sides' hems drop by `hem_drop` [m]."""
    front = quad("front", [(0.0, 0.0), (0.2, -hem_drop), (0.2, length - hem_drop), (0.0, length)], fold=True)
    back = replace(front, name="back")
    seam = Seam(name="side", sides=((SeamSide(piece="front", edge="side"),), (SeamSide(piece="back", edge="side"),)))
    return Pattern(name="skirt", pieces={"": [front, back]}, seams=[seam])


def test_hems_run_on_across_the_side_and_meet_the_fold_squarely() -> None:
    """A hem that falls by 8 degrees is turned at both ends, and its corners and the seam's length stay."""
    garment = flared(0.2 * np.tan(np.radians(8.0)))
    drafted = draft_garment(garment)
    assert len(drafted.corners) == 6
    for corner in drafted.corners:
        assert abs(corner.before_deg - corner.wanted_deg) > 7.0
        assert corner.after_deg == pytest.approx(corner.wanted_deg, abs=0.1)
        assert 0.5 < corner.move_mm <= 3.0
    front = drafted.pieces[""][0]
    angle = np.degrees(np.arctan2(*(front.edge("hem").line[1] - front.edge("hem").line[0])[::-1]))
    assert angle == pytest.approx(0.0, abs=1.0)
    assert drafted.seams[0].length_mm == pytest.approx((400.0, 400.0), abs=0.02)


def test_a_side_of_several_edges_has_its_corners_at_its_own_ends() -> None:
    """The same corners as of a side of one edge, and none at the joint."""
    garment = flared(0.2 * np.tan(np.radians(8.0)))
    front, back = garment.pieces[""]
    hem, side, top, centre = front.edges
    joint = side.points.mean(axis=0)
    halves = [
        replace(side, name="low", points=np.stack([side.points[0], joint])),
        replace(side, name="high", points=np.stack([joint, side.points[1]])),
    ]
    chain = tuple(SeamSide(piece="front", edge=half.name) for half in halves)
    (seam,) = garment.seams
    parted = replace(
        garment,
        pieces={"": [replace(front, edges=[hem, *halves, top, centre]), back]},
        seams=[replace(seam, sides=(chain, seam.sides[1]))],
    )
    whole, by_parts = (
        {corner.place: corner.after_deg for corner in draft_garment(each).corners} for each in (garment, parted)
    )
    assert by_parts == pytest.approx(whole, abs=0.05)


def test_corners_that_are_meant_stay() -> None:
    """A point of 60 degrees is no edge that runs on."""
    garment = flared(0.2 * np.tan(np.radians(25.0)))
    assert draft_garment(garment).corners == ()
    pieces = garment.pieces[""]
    curves = {(piece.name, edge.name): chords(edge.points) for piece in pieces for edge in piece.edges}
    assert true_corners(pieces, garment.seams, curves)[0] == curves


@pytest.mark.parametrize("degrees", [-9.0, 4.0, 9.0])
def test_a_sewn_curve_keeps_its_length(degrees: float) -> None:
    """An arc of an armhole's size is turned by the whole angle within 3 mm, and keeps its length and its far half."""
    around = np.linspace(0.0, 1.6, 30)
    arc = fit_curve(0.1 * np.column_stack([np.cos(around), np.sin(around)]))
    free, _ = turned_end(arc, np.radians(degrees), 0.06, keep_length=False)
    kept, move = turned_end(arc, np.radians(degrees), 0.06, keep_length=True)
    for curve in (free, kept):
        (x, y), (u, v) = arc.bezier[0, 1] - arc.bezier[0, 0], curve.bezier[0, 1] - curve.bezier[0, 0]
        assert np.degrees(np.arctan2(x * v - y * u, x * u + y * v)) == pytest.approx(degrees, abs=0.01)
        assert np.abs(curve.sample()[-1] - arc.sample()[-1]).max() < 1e-12
        away = np.hypot(*curve.sample().T) - 0.1
        assert np.abs(away[curve.sample() @ [0.0, 1.0] > 0.062]).max() < 1.2e-4
    assert abs(free.length - arc.length) > 1.5e-4
    assert kept.length == pytest.approx(arc.length, abs=5e-5)
    assert 0.0 < move <= 0.003


def test_the_move_is_bounded() -> None:
    """A turn that would need more than 3 mm is not made as a whole."""
    line = chords(np.array([[0.0, 0.0], [0.5, 0.0]]))
    curve, move = turned_end(line, np.radians(40.0), 0.06, keep_length=False)
    assert move == pytest.approx(0.003, rel=0.01)
    assert np.abs(curve.sample()[:, 1]).max() == pytest.approx(0.003, rel=0.02)


def test_a_seam_is_walked_by_its_length() -> None:
    """Equal sides end together, and their notches meet; a longer side shows by how much it is, a bent one is laid along the other."""
    (walked,) = walk_seams(draft_garment(flared(0.0)))
    assert (walked.report.difference_mm, walked.report.notches_mm) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert walked.notches[0] == pytest.approx(walked.notches[1], abs=1e-9)
    front, back = flared(0.0).pieces[""]
    side = np.array([[0.2, 0.0], [0.21, 0.2], [0.2, 0.403]])
    edges = [replace(edge, points=side) if edge.name == "side" else edge for edge in back.edges]
    edges[2] = replace(edges[2], points=np.array([[0.2, 0.403], [0.0, 0.4]]))
    garment = replace(flared(0.0), pieces={"": [front, replace(back, edges=edges)]})
    (walked,) = walk_seams(draft_garment(garment))
    longer = 1000 * (np.hypot(0.01, 0.2) + np.hypot(0.01, 0.203) - 0.4)
    assert walked.report.difference_mm == pytest.approx(longer, abs=0.6)
    assert walked.report.notches_mm == pytest.approx(0.0, abs=1e-3)
    assert walked.notches[0] == pytest.approx(walked.notches[1], abs=1e-6)
