"""Pockets: patches with their places marked, and bags in a seam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import arc_lengths, points_at_lengths
from warpflat.core.text import find_unused_name, other_side
from warpflat.garment.mark_openings import with_notches
from warpflat.pattern.piece_parts import Edge
from warpflat.pattern.pieces import Pattern, Piece, Seam, SeamSide

__all__ = ["Pocket", "add_pockets"]

# Hem of a patch pocket, and how much lower its middle lies than its lower corners [m].
_HEM, _POINT = 0.030, 0.015
# A bag runs past both ends of its opening [m].
_PAST = 0.020
# An opening ends this far above the lower end of its seam [m].
_CLEAR = 0.030


@dataclass(frozen=True, kw_only=True)
class Pocket:
    """A pocket.

    Attributes:
        kind: "patch", sewn onto a piece, or "inseam", bags in a seam.
        where: the piece of a patch, the seam of bags.
        width, height: of a patch; depth and length of the opening of a bag [m].
        line: a line across the piece on which a patch's upper edge lies.
        below: how far a patch lies below its line, an opening below the upper end of its seam [m].
        from_centre: distance of a patch's inner side from the centre line [m].
    """

    kind: str
    where: str
    width: float
    height: float
    line: str = ""
    below: float = 0.0
    from_centre: float = 0.07


def add_pockets(pattern: Pattern, pockets: Sequence[Pocket]) -> Pattern:
    """Return a pattern with pockets: their pieces, their places on pieces, their notches in seams.

    Raises:
        InputError: there is no such piece, line or seam, or a pocket does not lie on its piece.
    """
    for number, pocket in enumerate(pockets):
        try:
            pattern = _with_patch(pattern, pocket) if pocket.kind == "patch" else _with_bags(pattern, pocket)
        except InputError as error:
            raise InputError(f"pockets[{number}]: {error}") from None
    return pattern


def _with_patch(pattern: Pattern, pocket: Pocket) -> Pattern:
    """Return a pattern with a patch pocket and its place, on both sides of a piece that has both."""
    import shapely

    pattern.piece(pocket.where, pattern.sample)
    title = find_unused_name(f"{pocket.where}_pocket", {piece.name for piece in pattern.pieces[pattern.sample]})
    pieces = {}
    for size, row in pattern.pieces.items():
        made = list[Piece]()
        count = 0
        for piece in row:
            if piece.name != pocket.where:
                made.append(piece)
                continue
            grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
            up = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
            across = np.array([up[1], -up[0]])
            known = {**{edge.name: edge.points for edge in piece.edges}, **piece.internal_lines}
            centre = next((points for name, points in known.items() if name.startswith("centre")), None)
            if centre is None:
                raise InputError(f"piece {piece.name!r} has no centre line to place a pocket from")
            if pocket.line not in known:
                raise InputError(f"piece {piece.name!r} has no line {pocket.line!r}; {nearest(pocket.line, known)}")
            x0, level = float((centre @ across).mean()), known[pocket.line]
            order = np.argsort(level @ across)
            lines, marks = dict(piece.internal_lines), dict(piece.marks)
            body = shapely.Polygon(piece.outline)
            for side in (1.0, -1.0):
                # The patch on this side of the centre line, from its upper right corner leftwards.
                middle = x0 + side * (pocket.from_centre + 0.5 * pocket.width)
                top = float(np.interp(middle, (level @ across)[order], (level @ up)[order])) - pocket.below
                half, low = 0.5 * pocket.width, top - pocket.height
                corners = [(half, top), (-half, top), (-half, low), (0.0, low - _POINT), (half, low)]
                place = np.array([(middle + x) * across + y * up for x, y in corners])
                if not body.contains(shapely.Polygon(place)):
                    continue
                count += 1
                # Side by side, so that its corners stay sharp.
                for ends in pairwise([*place[1:], place[0]]):
                    lines[find_unused_name("pocket", lines)] = np.array(ends)
                for corner in place[:2]:
                    marks[find_unused_name("pocket corner", marks)] = corner
            if not count:
                raise InputError(
                    f"a pocket {1e3 * pocket.width:.0f} by {1e3 * pocket.height:.0f} mm does not lie on {piece.name!r} there"
                )
            made.append(replace(piece, internal_lines=lines, marks=marks))
            count *= piece.quantity * (2 if piece.on_fold else 1)
        # The piece of a patch pocket.
        like = next(p for p in row if p.name == pocket.where)
        half, low = 0.5 * pocket.width, -pocket.height
        patch = np.array([(half, 0.0), (-half, 0.0), (-half, low), (0.0, low - _POINT), (half, low)])
        names = ["upper", "left side", "lower left", "lower right", "right side"]
        edges = [
            Edge(
                name=name, points=patch[[k, (k + 1) % 5]], kind="hem" if k == 0 else "cut",
                allowance=_HEM if k == 0 else 0.010,
            )
            for k, name in enumerate(names)
        ]  # fmt: skip
        made.append(
            Piece(
                name=title, size=like.size, fabric=like.fabric, quantity=count, edges=edges, role="pocket", paired=False
            )
        )
        pieces[size] = made
    return replace(pattern, pieces=pieces)


def _with_bags(pattern: Pattern, pocket: Pocket) -> Pattern:
    """Return a pattern with the bags of a pocket in a seam, and on the other side's too, and notches where they open."""
    names = {pocket.where, other_side(pocket.where)}
    opened = [seam for seam in pattern.seams if seam.name in names]
    if not opened or any(len(row) > 1 for seam in opened for row in seam.sides):
        raise InputError(
            f"no seam {pocket.where!r} between two edges; {nearest(pocket.where, [seam.name for seam in pattern.seams])}"
        )
    # Of halves, and of pieces that are cut in pairs, one seam is listed for both sides.
    sewn = [pattern.piece(side.piece, pattern.sample) for row in opened[0].sides for side in row]
    both = 4 if len(opened) == 2 or any(piece.on_fold or piece.quantity % 2 == 0 for piece in sewn) else 2
    title = find_unused_name("pocket_bag", {piece.name for piece in pattern.pieces[pattern.sample]})
    seams = list(pattern.seams)
    for number, seam in enumerate(seams):
        if seam.name not in names:
            continue
        # Notches at both ends of the opening.
        side, by_size = seam.sides[0][0], {}
        for size in pattern.pieces:
            points, with_seam = _downwards(pattern.piece(side.piece, size), side)
            whole = float(arc_lengths(points)[-1])
            stretch = np.array([pocket.below, pocket.below + pocket.height])
            if stretch[1] > whole - _CLEAR:
                raise InputError(
                    f"the pocket ends {1e3 * stretch[1]:.0f} mm along {seam.name!r}, which is {1e3 * whole:.0f} mm long"
                )
            shares = stretch / whole if with_seam else 1.0 - stretch / whole
            by_size[size] = with_notches(seam.of_size(size), shares.tolist(), whole)
        seams[number] = replace(seam, notches=by_size[pattern.sample], size_notches=by_size)
    pieces = {}
    for size, row in pattern.pieces.items():
        side = opened[0].sides[0][0]
        piece = next(each for each in row if each.name == side.piece)
        # A bag: its straight edge along the seam, its rim deeper below the opening than above.
        points, _ = _downwards(piece, side)
        start = max(0.0, pocket.below - _PAST)
        edge = points_at_lengths(points, np.array([start, pocket.below + pocket.height + _PAST]))
        length = float(np.linalg.norm(edge[1] - edge[0]))
        deep = pocket.width
        # In the frame of the bag the seam runs upwards along x = 0, the cloth lies to its left.
        turn = np.linspace(0.0, np.pi / 2, 9)
        low = -0.35 * length
        radius = min(0.4 * deep, 0.4 * length)
        upper = np.array([-deep + radius, length - radius]) + radius * np.column_stack([-np.sin(turn), np.cos(turn)])
        lower = np.array([-deep + radius, low + radius]) + radius * np.column_stack([-np.cos(turn), -np.sin(turn)])
        around = np.vstack([[0.0, length], upper, lower, [-0.02, low], [0.0, 0.0]])
        past = pocket.below - start
        ends = {"pocket opening": length - past, "pocket opening end": length - past - pocket.height}
        pieces[size] = (
            *row,
            Piece(
                name=title,
                size=piece.size,
                fabric=piece.fabric,
                quantity=both,
                role="pocket",
                edges=[
                    Edge(name="opening", points=np.array([[0.0, 0.0], [0.0, length]]), kind="cut", allowance=0.010),
                    Edge(name="rim", points=around),
                ],
                internal_lines={name: np.array([[-0.012, y], [0.0, y]]) for name, y in ends.items()},
                grain=np.array([[-0.5 * deep, 0.1 * length], [-0.5 * deep, 0.7 * length]]),
            ),
        )
    rim = SeamSide(piece=title, edge="rim")
    words = find_unused_name("pocket bag", {seam.name for seam in seams})
    seams.append(Seam(name=words, sides=((rim,), (replace(rim, mirrored=True),))))
    return replace(pattern, pieces=pieces, seams=seams)


def _downwards(piece: Piece, side: SeamSide) -> tuple[FloatArray, bool]:
    """Return the points of an edge from its upper end, and whether the seam runs that way."""
    points = piece.edge(side.edge).points
    grain = np.array([0.0, 1.0]) if piece.grain is None else piece.grain[1] - piece.grain[0]
    down = bool((points[-1] - points[0]) @ grain < 0.0)
    return (points if down else points[::-1]), down != side.reversed
