"""Flounces: parts of a ring that fall from an edge, longer at their hem than where they are sewn; a circle skirt is a long one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby, pairwise

import numpy as np

from warpflat.core import FloatArray, InputError, find_unused_name
from warpflat.garment.construction.facings import centre_notch
from warpflat.garment.construction.free_edges import FreeChain, chain_length, neighbour
from warpflat.garment.construction.strips import CLOTH_WIDTH, Strip, panel_count, strip_edges, swept
from warpflat.pattern import Pattern, Piece, Seam, SeamSide

__all__ = ["with_flounce"]

# A panel turns by no more [rad]: beyond that its sides would meet.
_MOST_TURN = np.radians(330.0)
# Allowance of its hem [m]: a curved hem cannot be turned up far.
_HEM = 0.010


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
    taken = {piece.name for piece in pattern.pieces[pattern.sample]}
    called_seams, seams = {seam.name for seam in pattern.seams}, list(pattern.seams)
    pieces = {size: list(row) for size, row in pattern.pieces.items()}
    # What of the chain lies on one piece, or on both copies of one that lies on the fold, gets one panel.
    groups = [
        list(row)
        for _, row in groupby(chain.sides, key=lambda side: (side.piece, _fold(pattern, side) or side.mirrored))
    ]
    if chain.closed and len(groups) > 1 and _group_key(pattern, groups[0]) == _group_key(pattern, groups[-1]):
        groups[0] = [*groups.pop(), *groups[0]]
    # By piece its panel, and the names of that one's right and left end.
    panels: dict[str, tuple[str, tuple[str, str]]] = {}
    # By panel how many it is parted into.
    counts: dict[str, int] = {}
    for group in groups:
        name = group[0].piece
        if name in panels:
            continue
        title = find_unused_name(f"{name}_{called}_flounce".replace(" ", "_"), taken)
        taken.add(title)
        own = [side for side in group if side.mirrored == group[0].mirrored]
        own = own[::-1] if own[0].reversed else own
        sample = pattern.piece(name, pattern.sample)
        beside = [neighbour(sample, own[0].edge, 0)[0], neighbour(sample, own[-1].edge, 1)[0]]
        # Named as what runs on beyond it, without number.
        words = [each.rstrip(" 0123456789") for each in beside]
        ends = (words[0], words[1] if words[1] != words[0] else f"{words[1]} 2")
        panels[name] = title, ends
        folded = [sample.edge(each).kind == "fold" for each in beside]
        whole = 2.0 if any(folded) else 1.0
        lengths = {
            size: whole * chain_length(pattern, FreeChain(sides=tuple(own), closed=False), size) for size in pieces
        }
        around = {size: 2.0 * np.pi * turns / chain_length(pattern, chain, size) for size in pieces}

        margins = {size: 2.0 * pattern.piece(name, size).edge(own[0].edge).width for size in pieces}
        widths_of = [
            partial(_sector_width, width=width, length=lengths[size], around=around[size], margin=margins[size])
            for size in pieces
        ]
        count = 1 if any(folded) else max(panel_count(width_of, cloth_width) for width_of in widths_of)
        counts[title] = count
        for size, row in pieces.items():
            piece = pattern.piece(name, size)
            turn = lengths[size] / count * around[size]
            if turn > _MOST_TURN:
                raise InputError(
                    f"a flounce of {turns:g} turns would go around {np.degrees(turn):.0f} degrees in one piece "
                    f"at {name!r}; at most {np.degrees(_MOST_TURN):.0f} can be cut: take fewer turns"
                )
            # Of a panel on the fold half is drawn.
            lower, upper = _sector(lengths[size] / count, around[size], width)
            if any(folded):
                middle = len(lower) // 2
                kept = slice(0, middle + 1) if folded[0] else slice(middle, None)
                lower, upper = lower[kept], upper[kept]
            # Sewn with right sides together, its edge runs against those of the piece: what follows there comes first here.
            kinds = {
                "upper": "hem",
                "right end": "fold" if folded[0] else "seam",
                "left end": "fold" if folded[1] else "seam",
            }
            allowance = piece.edge(own[0].edge).width
            widths = {key: 0.0 if kinds.get(key) == "fold" else allowance for key in ("lower", "right end", "left end")}
            names = {"lower": called, "upper": "hem", "right end": ends[0], "left end": ends[1]}
            # It hangs down.
            edges = [
                replace(edge, name=names[edge.name], points=-edge.points)
                for edge in strip_edges(lower, upper, kinds=kinds, allowance={**widths, "upper": _HEM})
            ]
            middle_line = -0.5 * (lower[len(lower) // 2] + upper[len(upper) // 2])
            row.append(
                Piece(
                    name=title, size=size, fabric=piece.fabric, quantity=piece.quantity * count, edges=edges,
                    paired=piece.paired,
                    grain=middle_line + np.outer([-0.3 * width, 0.3 * width], [0.0, 1.0]),
                )
            )  # fmt: skip
        seam = find_unused_name(title.replace("_", " "), called_seams)
        called_seams.add(seam)
        shell = tuple(SeamSide(piece=name, edge=side.edge) for side in own)
        notches = centre_notch(sample)
        seams.append(
            Seam(
                name=seam,
                sides=(
                    shell,
                    tuple(SeamSide(piece=title, edge=called, reversed=True, copy=copy) for copy in range(count)),
                ),
                notches=notches if count == 1 else None,
            )
        )
        for copy in range(count - 1):
            # What is last along the shell meets what is first of the next one.
            ends_here = (
                (SeamSide(piece=title, edge=ends[1], reversed=True, copy=copy),),
                (SeamSide(piece=title, edge=ends[0], copy=copy + 1),),
            )
            seam = find_unused_name(f"{title.replace('_', ' ')} ends", called_seams)
            called_seams.add(seam)
            seams.append(Seam(name=seam, sides=ends_here))
    joined = set[frozenset[tuple[str, str, bool]]]()
    for group, other in pairwise([*groups, groups[0]] if chain.closed else groups):
        sides = (
            _panel_end(panels, counts, group[-1], ahead=True),
            _panel_end(panels, counts, other[0], ahead=False),
        )
        for turned in (False, True):
            key = frozenset((side.piece, side.edge, side.mirrored != turned) for side in sides)
            if key in joined:
                break
        else:
            joined.add(frozenset((side.piece, side.edge, side.mirrored) for side in sides))
            if all(side.mirrored for side in sides):
                sides = (replace(sides[0], mirrored=False), replace(sides[1], mirrored=False))
            title = next((side.edge for side in sides if not side.mirrored), sides[0].edge)
            seam = find_unused_name(f"{title} of the flounce", called_seams)
            called_seams.add(seam)
            seams.append(Seam(name=seam, sides=((sides[0],), (sides[1],))))
    return replace(pattern, pieces=pieces, seams=seams)


def _sector(length: float, around: float, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the inner and the outer edge of a sector: of that length and width [m], turning by so much along it [rad/m]."""
    return swept(Strip(length=length, height=width, turn=-0.5 * length * around, even=True))


def _sector_width(count: int, *, length: float, around: float, width: float, margin: float) -> float:
    """Return how wide across the cloth one of so many equal parts of a sector is, with its allowances [m]."""
    return float(np.ptp(np.vstack(_sector(length / count, around, width))[:, 0])) + margin


def _fold(pattern: Pattern, side: SeamSide) -> bool:
    return pattern.piece(side.piece, pattern.sample).on_fold


def _group_key(pattern: Pattern, group: Sequence[SeamSide]) -> tuple[str, bool]:
    return group[0].piece, _fold(pattern, group[0]) or group[0].mirrored


def _panel_end(
    panels: Mapping[str, tuple[str, tuple[str, str]]], counts: Mapping[str, int], side: SeamSide, *, ahead: bool
) -> SeamSide:
    """Return the end of a panel at one end of a side of the chain, from the shell downwards."""
    title, ends = panels[side.piece]
    # Along the piece's own direction its last edge is met by the panel's left end, which runs upwards.
    last = ahead != side.reversed
    copy = counts[title] - 1 if last else 0
    return SeamSide(piece=title, edge=ends[int(last)], mirrored=side.mirrored, reversed=last, copy=copy)
