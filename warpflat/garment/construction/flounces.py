"""Flounces: parts of a ring that fall from an edge, longer at their hem than where they are sewn; a circle skirt is a long one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np

from warpflat.core import FloatArray, InputError
from warpflat.garment.construction.edges import (
    beside,
    free_piece_name,
    new_piece,
    redrawn,
    sewn,
)
from warpflat.garment.construction.facings import centre_notch
from warpflat.garment.construction.free_edges import FreeChain, chain_allowance, chain_length
from warpflat.garment.construction.strips import NARROW, Strip, panel_count, strip_edges, swept
from warpflat.pattern import CLOTH_WIDTH, Edge, Pattern, Piece, SeamSide, unnumbered

__all__ = ["with_flounce"]

# A panel turns by no more [rad]: beyond that its sides would meet.
_MOST_TURN = np.radians(330.0)


@dataclass(frozen=True, kw_only=True)
class _Panel:
    """What falls from one piece.

    Attributes:
        name: of its piece.
        ends: names of its right and left end.
        count: of equal parts, of which one is drawn.
    """

    name: str
    ends: tuple[str, str]
    count: int

    def end(self, side: SeamSide, *, ahead: bool) -> SeamSide:
        """Return the end of the panel at one end of a side of the chain, from the shell downwards."""
        # Along the piece's own direction its last edge is met by the panel's left end, which runs upwards.
        last = ahead != side.reversed
        copy = self.count - 1 if last else 0
        return SeamSide(piece=self.name, edge=self.ends[int(last)], mirrored=side.mirrored, reversed=last, copy=copy)


def with_flounce(
    pattern: Pattern, chain: FreeChain, width: float, turns: float, called: str, cloth_width: float = CLOTH_WIDTH
) -> Pattern:
    """Return a pattern with a flounce along a chain of free edges, a panel for each piece, sewn where the pieces are.

    The panels are sectors of one ring, whose inner edges are as long as the edges that they are sewn to. A panel that is wider than the
    cloth is parted into equal ones, of which one is drawn; half a panel on the fold stays whole.

    Args:
        pattern: with all its openings.
        chain: the edges.
        width: of the flounce [m].
        turns: how many times all of it goes around: 1 is a full circle, 0.5 half of one.
        called: the name of the edges without side and number.
        cloth_width: usable width of the cloth [m].

    Raises:
        InputError: a panel would go around too far.
    """
    # What of the chain lies on one piece, or on both copies of one that lies on the fold, gets one panel.
    groups = [list(row) for _, row in groupby(chain.sides, key=lambda side: _one_panel(pattern, side))]
    if chain.closed and len(groups) > 1 and _one_panel(pattern, groups[0][0]) == _one_panel(pattern, groups[-1][0]):
        groups[0] = [*groups.pop(), *groups[0]]
    panels = dict[str, _Panel]()
    for group in groups:
        if group[0].piece not in panels:
            pattern, panels[group[0].piece] = _with_panel(pattern, chain, group, width, turns, called, cloth_width)
    joined = set[frozenset[tuple[str, str, bool]]]()
    for group, other in pairwise([*groups, groups[0]] if chain.closed else groups):
        sides = panels[group[-1].piece].end(group[-1], ahead=True), panels[other[0].piece].end(other[0], ahead=False)
        places = [
            frozenset((side.piece, side.edge, side.mirrored != turned) for side in sides) for turned in (False, True)
        ]
        if joined.isdisjoint(places):
            joined.add(places[0])
            if all(side.mirrored for side in sides):
                sides = replace(sides[0], mirrored=False), replace(sides[1], mirrored=False)
            title = next((side.edge for side in sides if not side.mirrored), sides[0].edge)
            pattern = sewn(pattern, f"{title} of the flounce", *sides)
    return pattern


def _with_panel(
    pattern: Pattern,
    chain: FreeChain,
    group: Sequence[SeamSide],
    width: float,
    turns: float,
    called: str,
    cloth_width: float,
) -> tuple[Pattern, _Panel]:
    """Return a pattern with the panel along those sides of a chain that lie on one piece, and the panel; see :func:`with_flounce`."""
    name = group[0].piece
    title = free_piece_name(pattern, f"{name}_{called}_flounce".replace(" ", "_"))
    own = [side for side in group if side.mirrored == group[0].mirrored]
    own = own[::-1] if own[0].reversed else own
    sample = pattern.piece(name, pattern.sample)
    neighbours = beside(sample, *(side.edge for side in own))
    # Named as what runs on beyond it, without number.
    words = [unnumbered(each) for each in neighbours]
    ends = (words[0], words[1] if words[1] != words[0] else f"{words[1]} 2")
    folded = [sample.edge(each).kind == "fold" for each in neighbours]
    whole, row = (2.0 if any(folded) else 1.0), FreeChain(sides=tuple(own), closed=False)
    lengths = {size: whole * chain_length(pattern, row, size) for size in pattern.pieces}
    allowances = {size: chain_allowance(pattern, row, size) for size in pattern.pieces}
    # How far it turns along the chain [rad/m].
    around = {size: 2.0 * np.pi * turns / chain_length(pattern, chain, size) for size in pattern.pieces}

    def widest(count: int) -> float:
        sectors = {size: np.vstack(_sector(length / count, around[size], width)) for size, length in lengths.items()}
        return max(float(np.ptp(sector[:, 0])) + 2.0 * allowances[size] for size, sector in sectors.items())

    count = 1 if any(folded) else panel_count(widest, cloth_width)

    def draw(piece: Piece) -> Piece:
        size, length = piece.size, lengths[piece.size] / count
        turn = length * around[size]
        if turn > _MOST_TURN:
            raise InputError(
                f"a flounce of {turns:g} turns would go around {np.degrees(turn):.0f} degrees in one piece "
                f"at {name!r}; at most {np.degrees(_MOST_TURN):.0f} can be cut: take fewer turns"
            )
        lower, upper = _sector(length, around[size], width)
        if any(folded):
            # Half of a panel on the fold is drawn.
            middle = len(lower) // 2
            kept = slice(0, middle + 1) if folded[0] else slice(middle, None)
            lower, upper = lower[kept], upper[kept]
        # Sewn with right sides together, its edge runs against those of the piece: what follows there comes first here.
        # A curved hem cannot be turned up far.
        named = {"lower": (called, "seam", allowances[size]), "upper": ("hem", "hem", NARROW)}
        for key, end, on_fold in zip(("right end", "left end"), ends, folded, strict=True):
            named[key] = (end, "fold", 0.0) if on_fold else (end, "seam", allowances[size])
        # It hangs down.
        edges = [
            Edge(name=as_named, points=-edge.points, kind=kind, allowance=allowance)
            for edge in strip_edges(lower, upper)
            for as_named, kind, allowance in [named[edge.name]]
        ]
        middle_line = -0.5 * (lower[len(lower) // 2] + upper[len(upper) // 2])
        grain = middle_line + np.outer([-0.3 * width, 0.3 * width], [0.0, 1.0])
        quantity = piece.quantity * count
        return new_piece(title, piece, edges, "shell", quantity=quantity, paired=piece.paired, grain=grain)

    pattern = redrawn(pattern, name, draw)
    pattern = sewn(
        pattern,
        title,
        tuple(SeamSide(piece=name, edge=side.edge) for side in own),
        tuple(SeamSide(piece=title, edge=called, reversed=True, copy=copy) for copy in range(count)),
        notches=centre_notch(sample) if count == 1 else None,
    )
    for copy in range(count - 1):
        # What is last along the shell meets what is first of the next one.
        last = SeamSide(piece=title, edge=ends[1], reversed=True, copy=copy)
        pattern = sewn(pattern, f"{title} ends", last, SeamSide(piece=title, edge=ends[0], copy=copy + 1))
    return pattern, _Panel(name=title, ends=ends, count=count)


def _sector(length: float, around: float, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the inner and the outer edge of a sector: of that length and width [m], turning by so much along it [rad/m]."""
    return swept(Strip(length=length, height=width, turn=-0.5 * length * around, even=True))


def _one_panel(pattern: Pattern, side: SeamSide) -> tuple[str, bool]:
    """Return what sides have in common that get one panel: their piece, and its copy, unless both are one on the fold."""
    return side.piece, pattern.piece(side.piece, pattern.sample).on_fold or side.mirrored
