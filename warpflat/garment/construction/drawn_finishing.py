"""Finishing pieces as they are worn, for the line drawing: strips that stand off the edges that they are sewn to.

Each is a grid of points, rows from the edge outwards, with lines on it: folds of pleats and flounces, gathers, a placket.
Widths are those of the finishing. How far a flounce stands out, and where a fold shows, is drawn as sewers draw it, and not computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import BoolArray, FloatArray, IntArray, arc_lengths, other_side, unit
from warpflat.flat import grid_quads, triangulate, vertex_normals
from warpflat.garment.construction.collars import STANDS
from warpflat.garment.mannequin.slicer import UP
from warpflat.pattern import ViewedPiece, line_name

if TYPE_CHECKING:
    from warpflat.flat import Surface
    from warpflat.garment.construction.details import FinishingTable
    from warpflat.garment.construction.form_garment import FormGarment

__all__ = ["Rises", "finishing_views", "lost_along"]

# Ends of edges that are nearer than this are sewn to each other [m]; points of a chain lie so far apart.
_MEET, _STEP = 0.012, 0.004
# What is narrower in the view than this [m] is a sliver at the silhouette.
_SLIVER = 0.015
# What a strip stands out for each length that it falls: in pleats, for each share that is gathered, and for each full turn of a flounce;
# at most so much.
_PLEATS_OUT, _GATHERS_OUT, _FLOUNCE_OUT, _MOST_OUT = 0.05, 0.12, 0.45, 0.6
# Folds of a flounce for each full turn and of gathers for each length [m], and by how much the hem rises and falls with them [m].
_FOLDS_A_TURN, _GATHER_STEP, _WAVE = 14.0, 0.03, 0.006
# Where a fold of a flounce begins, and where a gather ends, as shares of the width.
_FOLD_FROM, _GATHER_TO = 0.35, 0.4
# A binding shows so wide; half the width of a placket [m].
_BOUND, _PLACKET = 0.008, 0.014
# A hood: height above the neck and half of its width, as shares of the length of the neck edge, and where the neck widens into it.
_HOOD_HIGH, _HOOD_WIDE, _HOOD_NECK = 0.72, 0.27, 0.35


#: By piece and edge the lengths along the edge from its start, and how wide a strip is cut off there [m].
Rises = Mapping[tuple[str, str], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, kw_only=True)
class _Chain:
    """An edge of the garment all along, across its pieces.

    Attributes:
        points: #P by 3 [m].
        out: #P by 3, unit, away from the body.
        beyond: #P by 3, unit, along the cloth and off its edge.
        closed: whether it is a ring.
    """

    points: FloatArray
    out: FloatArray
    beyond: FloatArray
    closed: bool

    def from_front(self) -> _Chain:
        """Return a ring that begins and ends in its front, or the chain itself if it is none."""
        if not self.closed:
            return self
        first = int((self.points[:, 2] - 4.0 * np.abs(self.points[:, 0])).argmax())
        return replace(self.begun_at(first), closed=False)

    def begun_at(self, first: int) -> _Chain:
        """Return a ring that begins at another point."""
        rows = [np.concatenate([row[first:-1], row[: first + 1]]) for row in (self.points, self.out, self.beyond)]
        return replace(self, points=rows[0], out=rows[1], beyond=rows[2])


@dataclass(frozen=True, kw_only=True)
class _Sheet:
    """A finishing piece: rows of points, #R by #P by 3 [m], the outward normals of its columns, and lines, each with its columns."""

    rows: FloatArray
    out: FloatArray
    lines: tuple[tuple[FloatArray, FloatArray], ...] = ()
    outlined: bool = True


def lost_along(garment: FormGarment, piece: str, edge: str, rises: Rises) -> FloatArray:
    """Return how far the end of the cloth lies from each vertex of an edge (#V by 3 [m]): slanted, or shorter by more than is sewn on."""
    surface, ids = garment.form.pieces[piece].surface, garment.form.pieces[piece].edges[edge]
    for wish in garment.finishing:
        if isinstance(wish.shorten, float) and wish.shorten > wish.width and wish.edge == line_name(edge):
            return -wish.shorten * _off_edge(surface, ids, surface.vertices[ids])[1]
    return np.outer(_rise_along(garment, piece, edge, rises), UP)


def _off_edge(surface: Surface, ids: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the normals at an edge's vertices, and the ways along the cloth and off the edge, which lies at some points (#V by 3)."""
    out = vertex_normals(surface.vertices, triangulate(surface.faces)[0])[ids]
    beyond = unit(np.cross(np.gradient(points, axis=0), out))
    away = surface.vertices[ids] - surface.vertices.mean(axis=0)
    return out, beyond if (away * beyond).sum() >= 0.0 else -beyond


def _rise_along(garment: FormGarment, piece: str, edge: str, rises: Rises) -> FloatArray:
    """Return how wide a strip slanted edges lose at each vertex of an edge [m]."""
    # Of a pair the left piece is drawn, which runs the other way.
    turned = (piece, edge) not in rises
    arc, wide = rises.get((other_side(piece), other_side(edge)) if turned else (piece, edge), ((0.0,), (0.0,)))
    at = arc_lengths(garment.positions[piece][garment.form.pieces[piece].edges[edge]])
    return np.interp(at[-1] - at if turned else at, arc, wide)


def finishing_views(garment: FormGarment, sign: float, rises: Rises) -> tuple[list[ViewedPiece], list[ViewedPiece]]:
    """Return the finishing pieces of a form as they are seen: what lies behind all other pieces, and what lies before them.

    Args:
        garment: on its body.
        sign: 1 from the front, -1 from the back.
        rises: of its slanted edges.
    """
    behind, before = list[ViewedPiece](), list[ViewedPiece]()
    for wish in garment.finishing:
        for chain in _chains(garment, wish.edge, rises):
            for sheet in _sheets(wish, chain):
                near = sign * sheet.out[:, 2] > 0.0
                if sheet.outlined:
                    behind += _seen(sheet, ~near, sign, lines=False)
                before += _seen(sheet, near, sign, lines=True)
    return behind, before


def _seen(sheet: _Sheet, shown: BoolArray, sign: float, *, lines: bool) -> list[ViewedPiece]:
    """Return the columns of a sheet that are shown, as they are seen."""
    import shapely

    flat, found = sheet.rows[:, :, :2] * [sign, 1.0], list[ViewedPiece]()
    runs = np.split(np.arange(len(shown)), np.flatnonzero(np.diff(shown.astype(int))) + 1)
    for run in (run for run in runs if shown[run[0]]):
        # Halves that meet in the silhouette share a column.
        run = np.arange(max(run[0] - 1, 0), min(run[-1] + 2, len(shown)))
        part = flat[:, run]
        if sheet.outlined and np.ptp(part[:, :, 0]) < _SLIVER and len(run) < len(shown):
            continue
        rings = []
        if sheet.outlined:
            cells = part.reshape(-1, 2)[
                grid_quads(np.arange(part[..., 0].size, dtype=np.int32).reshape(part.shape[:2]))
            ]
            whole = shapely.union_all(shapely.make_valid(shapely.polygons(cells)), grid_size=1e-5).buffer(1e-4)
            rings = [
                np.asarray(each.exterior.coords)[:-1]
                for each in shapely.get_parts(whole)
                if each.geom_type == "Polygon"
            ]
        drawn = []
        for points, columns in sheet.lines if lines else ():
            inside = (columns >= run[0]) & (columns <= run[-1])
            drawn += [points[inside, :2] * [sign, 1.0]] if inside.sum() > 1 else []
        found.append(ViewedPiece(outlines=tuple(rings), lines=tuple(drawn)))
    return found


def _chains(garment: FormGarment, called: str, rises: Rises) -> Iterator[_Chain]:
    """Yield the edges of a name, as high as slanted ones lie, joined where they meet in space."""
    form = garment.form
    rows = list[tuple[FloatArray, FloatArray, FloatArray]]()
    for name, piece in form.pieces.items():
        for edge, ids in piece.edges.items():
            if line_name(edge) != called:
                continue
            points = piece.surface.vertices[ids] + np.outer(_rise_along(garment, name, edge, rises), UP)
            out, beyond = _off_edge(piece.surface, ids, points)
            rows.append((points, out, beyond))
            if form.half:
                rows.append((points * [-1.0, 1.0, 1.0], out * [-1.0, 1.0, 1.0], beyond * [-1.0, 1.0, 1.0]))
    while rows:
        here = rows.pop(0)
        for at_end in (True, False):
            while rows:
                end = here[0][-1 if at_end else 0]
                gaps = [min(np.linalg.norm(row[0][0] - end), np.linalg.norm(row[0][-1] - end)) for row in rows]
                if min(gaps) > _MEET:
                    break
                other = rows.pop(int(np.argmin(gaps)))
                first = np.linalg.norm(other[0][0] - end) <= np.linalg.norm(other[0][-1] - end)
                if first != at_end:
                    other = other[0][::-1], other[1][::-1], other[2][::-1]
                both = zip(here, other, strict=True) if at_end else zip(other, here, strict=True)
                here = tuple(np.concatenate(pair) for pair in both)  # type: ignore[assignment]
        closed = bool(np.linalg.norm(here[0][0] - here[0][-1]) < _MEET)
        arc = arc_lengths(here[0])
        kept = np.concatenate([[True], np.diff(arc) > 1e-6])
        arc, here = arc[kept], (here[0][kept], here[1][kept], here[2][kept])
        places = np.linspace(0.0, arc[-1], max(int(arc[-1] / _STEP), 8))
        points, out, beyond = (
            np.column_stack([np.interp(places, arc, row[:, axis]) for axis in range(3)]) for row in here
        )
        chain = _Chain(points=points, out=unit(out), beyond=unit(beyond), closed=closed)
        # A ring begins in the silhouette, where its near side ends.
        yield chain.begun_at(int(points[:, 0].argmax())) if closed else chain


def _sheets(wish: FinishingTable, chain: _Chain) -> Iterator[_Sheet]:
    """Yield what is drawn of a finishing along one chain."""
    columns = np.arange(len(chain.points), dtype=float)
    level = unit(chain.out * [1.0, 0.0, 1.0])
    if isinstance(wish.shorten, float):
        chain = replace(chain, points=chain.points - wish.shorten * chain.beyond)
    if wish.kind in ("waistband", "band", "cuff"):
        width = -wish.width if wish.shaped else wish.width
        yield _Sheet(rows=np.stack([chain.points, chain.points + width * chain.beyond]), out=chain.out)
    elif wish.kind in ("casing", "binding"):
        line = chain.points - (_BOUND if wish.kind == "binding" else wish.width) * chain.beyond
        yield _Sheet(rows=np.stack([chain.points, line]), out=chain.out, lines=((line, columns),), outlined=False)
    elif wish.kind in ("ruffle", "flounce"):
        yield _falling(wish, chain, columns, level)
    elif wish.kind == "hood":
        yield _hood(chain.from_front())
    elif wish.kind == "collar":
        yield from _collar(wish, chain, level)


def _falling(wish: FinishingTable, chain: _Chain, columns: FloatArray, level: FloatArray) -> _Sheet:
    """Return a ruffle or flounce as it falls from its edge: with pleats, gathers or folds."""
    arc = arc_lengths(chain.points)
    out = {True: _PLEATS_OUT, False: min(_MOST_OUT, _GATHERS_OUT * wish.share)}[bool(wish.pleat)]
    folds = max(2, round(arc[-1] / (wish.pleat or _GATHER_STEP)))
    if wish.kind == "flounce":
        out, folds = min(_MOST_OUT, _FLOUNCE_OUT * wish.turns), max(4, round(_FOLDS_A_TURN * wish.turns))
    hem = chain.points + wish.width * unit(chain.beyond + out * level)
    if not wish.pleat:
        hem = hem + _WAVE * np.sin(2.0 * np.pi * folds * arc / arc[-1])[:, None] * chain.beyond
    lines = []
    for place in (np.arange(folds) + 0.25) * arc[-1] / folds:
        column = float(np.interp(place, arc, columns))
        high, low = (
            np.array([np.interp(column, columns, row[:, axis]) for axis in range(3)]) for row in (chain.points, hem)
        )
        share = [0.0, 1.0] if wish.pleat else [0.0, _GATHER_TO] if wish.kind == "ruffle" else [_FOLD_FROM, 1.0]
        lines.append((high + np.outer(share, low - high), np.full(2, column)))
    return _Sheet(rows=np.stack([chain.points, hem]), out=chain.out, lines=tuple(lines))


def _collar(wish: FinishingTable, chain: _Chain, level: FloatArray) -> Iterator[_Sheet]:
    """Yield a collar as it stands or is turned down, and the placket below it."""
    if wish.style == "turtleneck":
        yield _Sheet(rows=np.stack([chain.points, chain.points + 0.5 * wish.width * UP]), out=level)
        return
    chain = chain.from_front()
    level = unit(chain.out * [1.0, 0.0, 1.0])
    arc = arc_lengths(chain.points)
    # From nothing in the middle to one at both ends, in the front.
    ends = np.clip(np.abs(2.0 * arc / arc[-1] - 1.0) * 4.0 - 3.0, 0.0, 1.0)[:, None]
    if wish.style == "stand":
        rows = [chain.points, chain.points + wish.width * (UP - 0.2 * level)]
    elif wish.style == "flat":
        wide = wish.width * np.sqrt(np.clip(1.0 - 0.7 * ends**4, 0.0, 1.0))
        rows = [chain.points, chain.points - wide * chain.beyond + 0.004 * chain.out]
    else:
        stand, fall = wish.width, wish.fall
        if wish.style == "convertible":
            stand, fall = STANDS * wish.width, (1.0 - STANDS) * wish.width
        inwards = np.sign(0.5 * arc[-1] - arc)[:, None] * unit(np.gradient(chain.points, axis=0))
        top = chain.points + stand * (1.0 - (wish.style == "convertible") * ends) * UP
        long = fall * 1.2 + ends * (wish.point - fall * 1.2)
        rows = [top, top + long * unit(-UP + 0.5 * level + 0.7 * ends * inwards)]
    yield _Sheet(rows=np.stack(rows), out=level)
    if wish.placket:
        top, down = chain.points[0], np.array([0.0, -wish.placket, 0.0])
        side = np.array([_PLACKET, 0.0, 0.0])
        box = np.array([top - side, top - side + down, top + side + down, top + side])
        yield _Sheet(
            rows=box[[[0, 3], [1, 2]]], out=np.tile([0.0, 0.0, 1.0], (2, 1)), lines=((box, np.array([0.0, 0.0, 1.0, 1.0])),),
            outlined=False,
        )  # fmt: skip


def _hood(chain: _Chain) -> _Sheet:
    """Return a hood as it is worn up: over the head, open in front."""
    girth = arc_lengths(chain.points)[-1]
    share = arc_lengths(chain.points) / girth
    middle = chain.points.mean(axis=0)
    high, wide = _HOOD_HIGH * girth, _HOOD_WIDE * girth
    # From one front edge around the back to the other.
    turn = np.pi * (0.80 - 1.60 * share) * (1.0 if chain.points[len(share) // 4, 0] > middle[0] else -1.0)
    around = np.column_stack([np.sin(turn), np.zeros(len(turn)), -np.cos(turn)])
    rows = [chain.points]
    for up in np.linspace(0.0, 1.0, 15)[1:]:
        radius = (
            wide * np.sqrt(max(1.0 - ((up - _HOOD_NECK) / (1.0 - _HOOD_NECK)) ** 2, 0.0)) if up > _HOOD_NECK else wide
        )
        ring = middle + up * high * UP + radius * around
        blend = min(up / _HOOD_NECK, 1.0)
        rows.append((1.0 - blend) * (chain.points + up * high * UP) + blend * ring)
    grid = np.stack(rows)
    columns = np.arange(len(share), dtype=float)
    front = [(grid[:, end], np.full(len(rows), columns[end])) for end in (0, -1)]
    seam = grid[:, len(share) // 2], np.full(len(rows), columns[len(share) // 2])
    return _Sheet(rows=grid, out=around, lines=(*front, seam))
