"""Sides of a seam as long as each other once they are drawn."""

from __future__ import annotations

import numpy as np
import pytest
from polygons import corners_of, polygon, sewn

from warpflat.core.arrays import FloatArray
from warpflat.pattern.drafting.curves import chords, fit_curve
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.fitting import SHIFT, equal_sides
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam


def arc(radius: float, turn: float, count: int) -> FloatArray:
    at = np.linspace(-0.5 * turn, 0.5 * turn, count)
    return radius * np.column_stack([np.sin(at), np.cos(at) - np.cos(0.5 * turn)])


def seam(ease: float = 0.0) -> Seam:
    return sewn("a.e", "b.e", "s", ease=ease)


def square(name: str, role: str = "shell") -> Piece:
    return polygon(name, corners_of(0.1, 0.1), names=("e", "right", "top", "left"), role=role)


PIECES = (square("a"), square("b"))


def test_a_straight_strip_is_stretched():
    pieces = (square("a", "strip"), square("b"))
    curves = {(piece.name, edge.name): chords(edge.points) for piece in pieces for edge in piece.edges}
    curves["b", "e"] = chords(np.array([[0.0, 0.0], [0.1102, 0.0]]))
    made = equal_sides(pieces, [seam(0.1)], curves)
    assert made["a", "e"].length == pytest.approx(0.1102 / 1.1, abs=1e-9)
    assert made["a", "top"].length == pytest.approx(0.1102 / 1.1, abs=1e-9)
    assert made["a", "left"].length == pytest.approx(0.1, abs=1e-12)
    assert np.array_equal(made["a", "e"].nodes[-1], made["a", "right"].nodes[0])
    assert made["b", "e"] is curves["b", "e"]


@pytest.mark.parametrize(("ease", "apart"), [(0.0, 2e-4), (0.05, -2e-4)])
def test_the_curve_that_bends_takes_up_the_difference(ease: float, apart: float):
    second = fit_curve(arc(0.06, 2.0, 25))
    wanted = (second.length + apart) / (1.0 + ease)
    curves = {("a", "e"): chords(np.array([[0.0, 0.0], [wanted, 0.0]])), ("b", "e"): second}
    made = equal_sides(PIECES, [seam(ease)], curves)
    assert made["b", "e"].length == pytest.approx(second.length + apart, abs=2e-5)
    # It keeps near, and its ends and their directions stay.
    before, after = (curve.sample() for curve in (second, made["b", "e"]))
    assert np.array_equal(before[[0, -1]], after[[0, -1]])
    assert np.linalg.norm(second.bezier[:, [0, 3]] - made["b", "e"].bezier[:, [0, 3]], axis=2).max() < SHIFT
    for curve in made.values():
        joints = np.diff(curve.bezier, axis=1)
        ahead, behind = (d / np.linalg.norm(d, axis=1)[:, None] for d in (joints[1:, 0], joints[:-1, 2]))
        assert np.abs(ahead - behind).max(initial=0.0) < 1e-6
    first, last = ((c.bezier[0, 1] - c.bezier[0, 0]) @ [1.0, 1.0j] for c in (second, made["b", "e"]))
    assert np.angle(last / first) == pytest.approx(0.0, abs=1e-6)


def test_the_first_side_bends_where_the_second_is_an_s():
    """The bumps of an S would cancel: what one half gains the other half loses."""
    x = np.linspace(0.0, 0.2, 41)
    second, first = fit_curve(np.column_stack([x, 0.012 * np.sin(10.0 * np.pi * x)])), fit_curve(arc(0.09, 2.0, 25))
    ease = (second.length + 1.2e-4) / first.length - 1.0
    made = equal_sides(PIECES, [seam(ease)], {("a", "e"): first, ("b", "e"): second})
    lengths = [made[name, "e"].length for name in "ab"]
    assert lengths[1] - (1.0 + ease) * lengths[0] == pytest.approx(0.0, abs=2e-5)
    assert np.linalg.norm(first.bezier[:, [0, 3]] - made["a", "e"].bezier[:, [0, 3]], axis=2).max() < SHIFT


def test_a_long_edge_of_many_slight_bends_takes_up_the_difference_in_as_many_places():
    """A side seam bends to and fro at hip, waist and bust: few bumps would cancel."""
    x = np.linspace(0.0, 0.7, 141)
    second = fit_curve(np.column_stack([x, 0.006 * np.sin(8.0 * np.pi * x / 0.7)]))
    curves = {("a", "e"): chords(np.array([[0.0, 0.0], [second.length + 7e-5, 0.0]])), ("b", "e"): second}
    made = equal_sides(PIECES, [seam()], curves)["b", "e"]
    assert made.length == pytest.approx(second.length + 7e-5, abs=2e-5)
    assert np.linalg.norm(second.bezier[:, [0, 3]] - made.bezier[:, [0, 3]], axis=2).max() < SHIFT


def test_what_would_have_to_move_far_stays():
    second = fit_curve(arc(0.5, 0.2, 25))
    curves = {("a", "e"): chords(np.array([[0.0, 0.0], [second.length + 4e-4, 0.0]])), ("b", "e"): second}
    assert equal_sides(PIECES, [seam()], curves)["b", "e"] is second


def test_coarse_cap_and_armhole_are_equally_long():
    """Chords of 15 mm on a radius of 60 mm: curves that keep near them are longer than the chords, by as much as they bend."""
    cap, hole = arc(0.06, 2.6, 11), arc(0.09, 26.0 / 15.0, 9)
    hole *= np.linalg.norm(np.diff(cap, axis=0), axis=1).sum() / np.linalg.norm(np.diff(hole, axis=0), axis=1).sum()
    pieces = []
    for name, line in (("a", cap), ("b", hole)):
        low = np.array([[line[-1, 0], -0.1], [line[0, 0], -0.1]])
        rows = {"e": line, "right": [line[-1], low[0]], "low": low, "left": [low[1], line[0]]}
        edges = [Edge(name=each, points=np.asarray(points)[::-1]) for each, points in reversed(rows.items())]
        pieces.append(Piece(name=name, edges=edges))
    (report,) = draft_garment(Pattern(name="x", pieces={"": pieces}, seams=[seam()]), true=False).seams
    assert abs(report.difference_mm) < 0.02
