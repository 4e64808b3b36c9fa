"""Halves unfolded, and pieces cut turned over: what a mirror image turns round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from polygons import polygon

from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Piece, Seam, SeamSide
from warpflat.pattern.drafting.whole_pieces import MIRRORED, whole_pieces


def darted(*, on_fold: bool) -> Piece:
    """A piece with a dart in its hem, half on the fold or cut twice."""
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.11, 0.1], [0.12, 0.0], [0.2, 0.0], [0.2, 0.3], [0.0, 0.3]])
    names = ("hem 1", "leg to the tip", "leg to the hem", "hem 2", "side", "top", "centre")
    kinds = ("hem", "dart", "dart", "hem", "cut", "cut", "fold" if on_fold else "cut")
    edges = [
        Edge(name=name, points=corners[[k, (k + 1) % 7]], kind=kind)
        for k, (name, kind) in enumerate(zip(names, kinds, strict=True))
    ]
    dart = Dart(name="dart", left="leg to the tip", right="leg to the hem")
    return Piece(name="front", edges=edges, darts=[dart], quantity=1 if on_fold else 2, paired=not on_fold)


@pytest.mark.parametrize("on_fold", [True, False])
def test_a_mirrored_dart_runs_from_the_border_to_its_tip_and_back(on_fold: bool) -> None:
    whole, seams, _ = whole_pieces([darted(on_fold=on_fold)], [], unsewn=True)
    names = {"front"} if on_fold else {"front", "front" + MIRRORED}
    assert set(whole) == names
    darts = [(piece, dart) for piece in whole.values() for dart in piece.darts]
    assert len(darts) == len(seams) == 2
    tips = []
    for piece, dart in darts:
        left, right = piece.edge(dart.left).points, piece.edge(dart.right).points
        np.testing.assert_array_equal(left[-1], right[0])
        order = [edge.name for edge in piece.edges]
        assert order.index(dart.right) == order.index(dart.left) + 1
        assert [left[0, 1], left[-1, 1], right[-1, 1]] == pytest.approx([0.0, 0.1, 0.0])
        tips.append(left[-1, 0])
    assert tips == pytest.approx([0.11, -0.11])
    for piece in whole.values():
        x, y = np.concatenate([edge.points[:-1] for edge in piece.edges]).T
        assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0.0, "counter-clockwise"


def test_both_sides_of_a_half_lie_at_its_levels_and_the_half_stays_as_it_was() -> None:
    corners = np.array([(0.1, 0.03), (0.31, 0.07), (0.27, 0.4), (0.13, 0.53)])
    half = polygon(
        "front",
        corners,
        names=("hem", "side", "waist", "fold"),
        kinds=("hem", "seam", "cut", "fold"),
        levels={"waist": "waist"},
    )
    for edge in half.edges:
        edge.points.flags.writeable = False
    whole = whole_pieces([half], [], unsewn=True)[0]["front"]
    assert whole.levels == {"waist": "waist", "waist" + MIRRORED: "waist"}
    assert {edge.name for edge in whole.edges} > set(whole.levels)


def test_a_band_around_both_sides_of_a_half_makes_no_second_one() -> None:
    half = polygon("front", [(0, 0), (0.2, 0), (0.2, 0.4), (0, 0.4)], kinds=("hem", "seam", "seam", "fold"))
    band = polygon("band", [(0, 0), (0.4, 0), (0.4, 0.1), (0, 0.1)], quantity=1)
    side = SeamSide(piece="front", edge="e2")
    around = (side, replace(side, reversed=True, mirrored=True))
    seam = Seam(name="band", sides=((SeamSide(piece="band", edge="e0"),), around))
    whole, (found,), _ = whole_pieces([half, band], [seam])
    assert set(whole) == {"front", "band"}
    assert [each.place for each in found.sides[1]] == [("front", "e2"), ("front", "e2" + MIRRORED)]
