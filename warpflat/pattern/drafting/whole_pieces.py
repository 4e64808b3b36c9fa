"""Pieces as they are sewn: halves unfolded, pairs cut twice, and every seam on both sides of the body."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from warpflat.core import FloatArray, InputError
from warpflat.pattern.drafting.drafted_darts import fisheye_legs
from warpflat.pattern.drafting.piece_parts import Edge, Hole
from warpflat.pattern.drafting.pieces import Piece, Place, Seam, SeamSide
from warpflat.pattern.drafting.polygons import mirror_image

__all__ = ["MIRRORED", "hole_edges", "turn_over", "whole_pieces"]

#: Ends the name of a piece that is cut turned over, and of an edge beyond the fold.
MIRRORED = " mirrored"
_OTHER_SIDE = {"left arm": "right arm", "right arm": "left arm"}


def whole_pieces(
    pieces: Iterable[Piece], seams: Sequence[Seam], *, unsewn: bool = False
) -> tuple[dict[str, Piece], list[Seam], list[str]]:
    """Unfold halves on the fold, cut pairs twice, and repeat their seams on the other side.

    Args:
        pieces: of one size.
        seams: between them.
        unsewn: whether pieces that no seam joins are kept.

    Returns:
        The whole pieces by name, each as often as it is cut; their seams, without flags for mirrored sides, those of darts among them;
        notes.

    Raises:
        InputError: a piece has two folds, or a seam names what is not cut.
    """
    given = {piece.name: piece for piece in pieces}
    sides = [side for seam in seams for side in seam.stretches]
    asked = {side.piece for side in sides if side.mirrored}
    sewn = set(given) if unsewn else {side.piece for side in sides}
    halves = {name for name, piece in given.items() if piece.on_fold}
    twice = {
        name for name, p in given.items() if name not in halves and (name in asked or (p.quantity == 2 and p.paired))
    }
    # A cuff is sewn to each of two sleeves, whether it is cut turned over or not.
    pairs = [{side.piece for side in seam.stretches} for seam in seams]
    flagged = {side.piece for seam in seams if any(each.mirrored for each in seam.stretches) for side in seam.stretches}
    for name in [each for each in given if each not in halves | twice | flagged]:
        others = set().union(*(pair for pair in pairs if name in pair)) - {name}
        if given[name].quantity % 2 == 0 and others and others <= twice:
            twice.add(name)
    whole = {name: _unfolded(piece) if name in halves else piece for name, piece in given.items() if name in sewn}
    drawn = {name: name for name in whole}
    for side in sides:
        if side.copy:
            # Where it is worn, no other copy says.
            title = _copy_name(side)
            whole[title] = replace(given[side.piece], name=title, placement=None)
            drawn[title] = side.piece
    # The other side of a half is unfolded already.
    over = {_copy_name(side) for side in sides if side.mirrored and side.piece not in halves} | (twice & sewn)
    for piece in [whole[name] for name in whole if name in over]:
        whole[piece.name + MIRRORED] = replace(turn_over(piece), name=piece.name + MIRRORED)
        drawn[piece.name + MIRRORED] = drawn[piece.name]
    for name, piece in whole.items():
        # What is there more than once shares what is cut of it.
        if (count := list(drawn.values()).count(drawn[name])) > 1:
            also = {cloth: max(number // count, 1) for cloth, number in piece.also.items()}
            whole[name] = replace(piece, quantity=max(piece.quantity // count, 1), paired=False, also=also)
    found: list[Seam] = []
    taken: set[Place] = set()
    # Seams on the other side of the body.
    flipped = []
    for seam in seams:
        if all(side.piece in halves | twice for side in seam.stretches):
            one, other = (tuple(replace(side, mirrored=not side.mirrored) for side in row) for row in seam.sides)
            flipped.append(replace(seam, name=seam.name + MIRRORED, sides=(one, other)))
    for seam in (*seams, *flipped):
        plain = replace(seam, sides=(_named(seam.sides[0], halves), _named(seam.sides[1], halves)))
        edges = {side.place for side in plain.stretches}
        if seam in flipped and edges & taken:
            continue
        for side in plain.stretches:
            if side.piece not in whole:
                raise InputError(f"seam {seam.name!r}: {side.piece!r} is not cut; its piece needs a quantity of 2")
        taken |= edges
        found.append(plain)
    for piece in whole.values():
        found += piece.dart_seams
        for eye in (hole for hole in piece.holes if hole.kind == "dart"):
            left = SeamSide(piece=piece.name, edge=f"{eye.name} left")
            right = SeamSide(piece=piece.name, edge=f"{eye.name} right", reversed=True)
            found.append(Seam(name=f"{piece.name}.{eye.name}", sides=((left,), (right,))))
    left_out = sorted(set(given) - sewn)
    notes = [f"left out, as no seam joins them: {', '.join(left_out)}"] if left_out else []
    return whole, found, notes


def turn_over(piece: Piece) -> Piece:
    """Return a piece that is cut turned over, mirrored at x = 0."""
    across, flip = np.array([[0.0, 0.0], [0.0, 1.0]]), np.diag([-1.0, 1.0, 1.0])
    return replace(
        piece,
        **_image(piece, piece.edges, across, ""),
        grain=None if piece.grain is None else mirror_image(piece.grain, across),
        at=_OTHER_SIDE.get(piece.at, piece.at),
        placement=None if piece.placement is None else flip @ piece.placement @ flip,
    )


def hole_edges(hole: Hole) -> list[Edge]:
    """Return the two edges of a hole inside a piece; a fish-eye dart's run from tip to tip, and back."""
    if hole.kind == "dart":
        first, second = fisheye_legs(hole.points)
        return [Edge(name=f"{hole.name} left", points=first), Edge(name=f"{hole.name} right", points=second[::-1])]
    ring, half = np.concatenate([hole.points, hole.points[:1]]), len(hole.points) // 2
    return [Edge(name=f"{hole.name} {k + 1}", points=p) for k, p in enumerate((ring[: half + 1], ring[half:]))]


def _named(chain: Sequence[SeamSide], halves: set[str]) -> tuple[SeamSide, ...]:
    """Return a chain whose mirrored sides are named: a mirrored outline runs the other way."""
    found = []
    for side in chain:
        if side.copy and not side.mirrored:
            side = replace(side, piece=_copy_name(side), copy=0)
        if side.mirrored:
            piece = side.piece if side.piece in halves else _copy_name(side) + MIRRORED
            edge = side.edge + MIRRORED if side.piece in halves else side.edge
            side = SeamSide(piece=piece, edge=edge, reversed=not side.reversed)
        found.append(side)
    return tuple(found)


def _copy_name(side: SeamSide) -> str:
    """Return the name of a side's piece, and which of its copies it is."""
    return f"{side.piece} copy {side.copy + 1}" if side.copy else side.piece


def _unfolded(piece: Piece) -> Piece:
    """Return the whole of a half on the fold."""
    folds = [k for k, edge in enumerate(piece.edges) if edge.kind == "fold"]
    if len(folds) > 1:
        raise InputError(f"piece {piece.name!r} has {len(folds)} folds; a half has one")
    fold = piece.edges[folds[0]].points
    edges = [*piece.edges[folds[0] + 1 :], *piece.edges[: folds[0]]]
    other = _image(piece, edges, fold, MIRRORED)
    # Corners on the fold are one point, bit for bit.
    other["edges"][0].points[0], other["edges"][-1].points[-1] = edges[-1].points[-1], edges[0].points[0]
    return replace(
        piece,
        edges=[*edges, *other["edges"]],
        darts=[*piece.darts, *other["darts"]],
        holes=[*piece.holes, *other["holes"]],
        internal_lines={**piece.internal_lines, **other["internal_lines"]},
        marks={**piece.marks, **other["marks"]},
        levels={**piece.levels, **{edge + MIRRORED: level for edge, level in piece.levels.items()}},
    )


def _image(piece: Piece, edges: Sequence[Edge], line: FloatArray, ending: str) -> dict[str, Any]:
    """Return the mirror images at a straight line (#L by 2 [m]) of some of a piece's edges, and of what lies within it, by field.

    Args:
        piece: of which they are.
        edges: that follow each other.
        line: in which they are mirrored.
        ending: of their names.
    """
    return {
        "edges": [
            replace(e, name=e.name + ending, points=mirror_image(e.points, line)[::-1], vertices=None)
            for e in edges[::-1]
        ],
        "darts": [
            replace(d, name=d.name + ending, left=d.right + ending, right=d.left + ending, fold_to=None)
            for d in piece.darts
        ],
        "holes": [
            replace(hole, name=hole.name + ending, points=mirror_image(hole.points, line)[::-1]) for hole in piece.holes
        ],
        "internal_lines": {name + ending: mirror_image(each, line) for name, each in piece.internal_lines.items()},
        "marks": {name + ending: mirror_image(mark, line) for name, mark in piece.marks.items()},
    }
