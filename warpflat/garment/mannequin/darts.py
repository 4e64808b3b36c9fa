"""Darts of a form: which stretch of the grid is slit, from the border of a piece to the dart's tip, or between two tips inside."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest
from warpflat.garment.mannequin.halves import is_side
from warpflat.garment.mannequin.layout import Layout, joined_runs

__all__ = [
    "FormDart",
    "PlacedDart",
    "cloth_of",
    "grid_line",
    "lies_left",
    "longest_run",
    "place_darts",
    "standard_darts",
]

#: Where darts end unless they say otherwise [mm]: before the bust point along the bust line; below the bust's level in the
#: front; below it in the back, where it stands for the shoulder blades' level; below the waist in skirts. Aldrich, Metric
#: Pattern Cutting, and the usual 2 to 3 cm from the bust point. Below the shoulder in the back: Joseph-Armstrong's 3 inches.
_TIPS = {"bust": 25.0, "front": 20.0, "back": 20.0, "front skirt": 100.0, "back skirt": 130.0, "back shoulder": 75.0}
#: A skirt's second dart lies half-way from the first to the side and is this share as long.
_SECOND = 0.9


@dataclass(frozen=True, kw_only=True)
class FormDart:
    """A dart as it is asked for.

    Attributes:
        name: of the dart; with its mirror image "NAME left" and "NAME right".
        piece: name of the piece that gets it.
        line: the feature line along which it lies.
        at: the line on which its mouth lies, where the line along which it lies has two ends on the border; None for the side
            or the waist.
        towards: another line: it lies between the two, at the share `between` of the way. Only for lines that run up and down.
        between: 0 to 1.
        part: shares of the line's length within the piece, from the mouth, 0 or 1, to the tip; between the two tips of a fish-eye dart;
            None for the default.
        tip_mm: of a dart with one tip, how far before the bust point, or below the waist in a skirt or the shoulder in a back, it ends
            [mm]; None for the default.
        mirrored: its mirror image is a dart, too, in the same piece or in the mirror image of that.
        mouth_mm: how wide it opens at the border, or half-way between two tips [mm]; None leaves it to the cloth.
        like: name of another dart of the piece that opens as wide; None leaves it to the cloth.
        pleat_mm: it is a pleat, sewn this far from its mouth [mm], and hangs open below; None for a dart.
    """

    name: str
    piece: str
    line: str
    at: str | None = None
    towards: str | None = None
    tip_mm: float | None = None
    mouth_mm: float | None = None
    like: str | None = None
    pleat_mm: float | None = None
    between: float = 0.5
    part: tuple[float, float] | None = None
    mirrored: bool = True

    @property
    def place(self) -> tuple[str, str, str | None, str | None]:
        """Where it lies: no piece has two darts there."""
        return self.piece, self.line, self.towards, self.at

    @property
    def parts_piece(self) -> bool:
        """Whether it is a cut along the whole line, which parts its piece."""
        return self.part is not None and set(self.part) == {0.0, 1.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedDart:
    """A dart on a form's grid.

    Attributes:
        name, piece: names.
        asked: what was asked for.
        row: the mannequin's vertices from the mouth to the tip; of a fish-eye dart from its upper tip to its lower one.
        to_point: distance from the tip to the bust point or to the bust's level along the line [m]; None where it points to
            neither.
    """

    name: str
    piece: str
    asked: FormDart
    row: IntArray
    to_point: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cloth:
    """A piece on the grid: its inner mesh edges, in both directions, and the vertices of its border."""

    inner: frozenset[tuple[int, int]]
    border: frozenset[int]


def place_darts(
    layout: Layout,
    vertices: FloatArray,
    bricks: Mapping[str, Sequence[str]],
    darts: Sequence[FormDart],
    opened: Mapping[str, Sequence[str]] | None = None,
) -> tuple[PlacedDart, ...]:
    """Find the grid vertices of darts.

    Args:
        layout, vertices: of the form, #V by 3 [m].
        bricks: by piece, both sides of the body.
        darts: what is asked for.
        opened: by piece, the lines along which it is cut open; darts may begin there.

    Raises:
        InputError: an unknown piece or line, a line that does not run from the border into the piece, or two darts of one name.
    """
    if not darts:
        return ()
    cloths = {name: cloth_of(layout, chosen, (opened or {}).get(name, ())) for name, chosen in bricks.items()}
    found: list[PlacedDart] = []
    for dart in darts:
        where = f"dart {dart.name!r}"
        if dart.piece not in cloths:
            raise InputError(f"{where}: no piece {dart.piece!r}; {nearest(dart.piece, cloths)}")
        cloth = cloths[dart.piece]
        run = longest_run(grid_line(layout, dart), cloth)
        if not run or not {run[0], run[-1]} & cloth.border:
            raise InputError(f"{where}: line {dart.line!r} does not run from the border into piece {dart.piece!r}")
        point: int | None = None
        if dart.part is not None:
            low, high = dart.part
            if low == high:
                raise InputError(f"{where}: part = [{low:g}, {high:g}] has no length; give two different shares")
            # A dart from the end of the run has its mouth there.
            if 1.0 in (low, high):
                run, low, high = run[::-1], 1.0 - low, 1.0 - high
            arc = arc_lengths(vertices[run])
            begin, end = (int(np.abs(arc - share * arc[-1]).argmin()) for share in sorted((low, high)))
            row = run[begin : max(begin + 1, end) + 1]
        elif dart.at is None and (waist := _waist_of_fisheye(layout, run)) is not None:
            row = _default_fisheye(layout, vertices, run, waist, dart)
        else:
            run, point, length = _default_run(layout, vertices, cloth, run, dart)
            arc = arc_lengths(vertices[run])
            # One mesh edge short of the point at least: tips that meet there part the cloth.
            last = int(np.abs(arc - length).argmin())
            row = run[: max(1, last if point is None else min(last, run.index(point) - 1)) + 1]
        row_ids = np.array(row, np.int32)
        if not _holds(cloth, row_ids):
            raise InputError(
                f"{where}: it must begin at the border of piece {dart.piece!r}, or inside, and end two mesh edges away inside it"
            )
        to_point = None
        if point is not None:
            whole = vertices[run[: run.index(point) + 1]]
            to_point = float(arc_lengths(whole)[-1] - arc_lengths(vertices[row_ids])[-1])
        placed = PlacedDart(name=dart.name, piece=dart.piece, asked=dart, row=row_ids, to_point=to_point)
        image = layout.mirror[placed.row]
        partner = next((name for name, cloth in cloths.items() if _holds(cloth, image)), None)
        if dart.mirrored and partner is not None and not np.array_equal(image, placed.row):
            side, other = ("left", "right") if lies_left(layout, placed.row) else ("right", "left")
            found.append(replace(placed, name=f"{dart.name} {side}"))
            found.append(replace(placed, name=f"{dart.name} {other}", piece=partner, row=image))
        else:
            found.append(placed)
    seen: set[tuple[str, str]] = set()
    for each in found:
        if (each.piece, each.name) in seen:
            raise InputError(f"piece {each.piece!r}: dart {each.name!r} occurs twice; give each a name of its own")
        seen.add((each.piece, each.name))
    return tuple(found)


def standard_darts(layout: Layout, bricks: Mapping[str, Sequence[str]]) -> tuple[FormDart, ...]:
    """Return the darts of a pattern book's block that fit the pieces (Aldrich, Metric Pattern Cutting for Women's Wear).

    Bust and waist darts in the front bodice, a waist dart in the back; in the skirt one a side in front, two in the back.

    Args:
        layout: the grid.
        bricks: by piece, both sides of the body.
    """
    found: list[FormDart] = []
    for piece, chosen in bricks.items():
        cloth = cloth_of(layout, chosen)
        if _bust_mouth(layout, cloth) is not None:
            found.append(FormDart(name="bust dart", piece=piece, line="bust"))
        for face in ("front", "back"):
            dart = FormDart(name="waist dart", piece=piece, line=f"princess {face} left")
            run = longest_run(grid_line(layout, dart), cloth)
            at_waist = {int(run[at]) for at in (0, -1)} & set(layout.lines["waist"].tolist()) if len(run) else set()
            if at_waist or _waist_of_fisheye(layout, run) is not None:
                found.append(dart)
            if at_waist and int(run[-1]) in at_waist and face == "back":
                found.append(replace(dart, name="second waist dart", towards="side left", like=dart.name))
    return tuple(found)


def cloth_of(layout: Layout, bricks: Sequence[str], opened: Sequence[str] = ()) -> _Cloth:
    """Return a piece of bricks on the grid, cut along the lines along which it is opened."""
    return _cloth_of(layout, tuple(bricks), tuple(opened))


@functools.lru_cache(maxsize=32)  # one piece is asked for dozens of times while darts are looked for
def _cloth_of(layout: Layout, bricks: tuple[str, ...], opened: tuple[str, ...]) -> _Cloth:
    cut, inside = layout.edges_along(*opened), layout.edges_of(bricks, inside=True)
    border = layout.edges_of(bricks) - inside | cut
    return _Cloth(
        inner=frozenset(ends for edge in inside - cut for ends in (edge, edge[::-1])),
        border=frozenset(itertools.chain.from_iterable(border)),
    )


def _holds(cloth: _Cloth, row: IntArray) -> bool:
    """Return whether a row begins on the border of a piece, or two edges of the mesh long inside, and runs on inside."""
    ids = row.tolist()
    begins = ids[0] in cloth.border or len(ids) > 2
    return begins and cloth.border.isdisjoint(ids[1:]) and cloth.inner.issuperset(itertools.pairwise(ids))


def lies_left(layout: Layout, row: IntArray) -> bool:
    """Return whether a row lies on the left of the body."""
    left = np.concatenate([grid.ravel() for name, grid in layout.bricks.items() if is_side(name, "left")])
    return bool(np.isin(row, left).all())


def grid_line(layout: Layout, dart: FormDart) -> list[int]:
    """Return the vertices of the line along which a dart lies, a closed one without its repeated first vertex."""
    for name in (dart.line, *([] if dart.towards is None else [dart.towards])):
        if name not in layout.lines:
            raise InputError(f"dart {dart.name!r}: line {name!r} is unknown: {nearest(name, layout.lines)}")
    line = layout.lines[dart.line].tolist()
    if dart.towards is None:
        return line
    ends = []
    for name in (dart.line, dart.towards):
        columns = [np.flatnonzero(row == v) for row in layout.rings for v in (layout.lines[name][:1])]
        here = np.unique(np.concatenate(columns))
        if len(here) != 1:
            raise InputError(f"dart {dart.name!r}: line {name!r} does not run up and down the trunk; leave out towards")
        ends.append(int(here[0]))
    return layout.rings[:, round((1.0 - dart.between) * ends[0] + dart.between * ends[1])].tolist()


def longest_run(line: Sequence[int], cloth: _Cloth) -> list[int]:
    """Return the longest stretch of a line inside a piece."""
    return max(joined_runs(edge for edge in itertools.pairwise(line) if edge in cloth.inner), key=len, default=[])


def _waist_of_fisheye(layout: Layout, run: Sequence[int]) -> int | None:
    """Return where in a run that goes on below the waist, as in a dress, the waist lies between two tips; None if nowhere."""
    waist, bust = (set(layout.lines[level].tolist()) for level in ("waist", "bust"))
    at = next((place for place, vertex in enumerate(run) if vertex in waist), 0)
    return at if 0 < at < len(run) - 1 and any(vertex in bust for vertex in run) else None


def _default_fisheye(layout: Layout, vertices: FloatArray, run: list[int], waist: int, dart: FormDart) -> list[int]:
    """Return the fish-eye dart of a dress: its upper tip where a bodice's waist dart ends, its lower one where a skirt's does.

    Raises:
        InputError: it has a `tip_mm`, which is of a dart with one tip.
    """
    if dart.tip_mm is not None:
        raise InputError(
            f"dart {dart.name!r}: it has two tips in piece {dart.piece!r}; in place of tip_mm give both, as part = [0.3, 0.6]"
        )
    if vertices[run[0], 1] < vertices[run[-1], 1]:
        run, waist = run[::-1], len(run) - 1 - waist
    face = "front" if "front" in dart.line else "back"
    bust = next(place for place, vertex in enumerate(run) if vertex in set(layout.lines["bust"].tolist()))
    arc = arc_lengths(vertices[run])
    ends = arc[bust] + _tip(dart, face), arc[waist] + _tip(dart, f"{face} skirt")
    upper, lower = (int(np.abs(arc - end).argmin()) for end in ends)
    return run[max(upper, bust + 1) : min(lower, len(run) - 2) + 1]


def _bust_mouth(layout: Layout, cloth: _Cloth) -> list[int] | None:
    """Return the run of the bust line from the left side of a front piece; None if it does not run from there to a bust point."""
    run = longest_run(layout.lines["bust"].tolist(), cloth)
    side = int(layout.rings[layout.level_row["bust"], layout.quarter])
    if side not in (run[0], run[-1]) if run else True:
        return None
    run = run if run[0] == side else run[::-1]
    apex = int(layout.rings[layout.level_row["bust"], layout.to_princess])
    return run if apex in run[2:-1] else None


def _default_run(
    layout: Layout, vertices: FloatArray, cloth: _Cloth, run: list[int], dart: FormDart
) -> tuple[list[int], int | None, float]:
    """Return a run from the mouth, the vertex that the dart points to (None for a plain length), and the dart's length [m]."""
    waist = set(layout.lines["waist"].tolist())
    if dart.at is not None:
        # The run begins on the line on which the mouth of the dart is to lie.
        if dart.at not in layout.lines:
            raise InputError(f"dart {dart.name!r}: line {dart.at!r} is unknown: {nearest(dart.at, layout.lines)}")
        there = set(layout.lines[dart.at].tolist())
        if not {run[0], run[-1]} & there:
            ends = sorted({name for end in (run[0], run[-1]) for name in _lines_at(layout, end)} - {dart.line})
            raise InputError(
                f"dart {dart.name!r}: line {dart.line!r} does not end at {dart.at!r} in piece {dart.piece!r}; it ends at "
                f"{', '.join(ends)}"
            )
        run = run if run[0] in there else run[::-1]
    elif dart.line == "bust":
        run = _bust_mouth(layout, cloth) or run
    elif run[-1] in waist and run[0] not in waist:
        run = run[::-1]
    face = "front" if "front" in dart.line else "back"
    shoulder = any(line.startswith("shoulder") for line in _lines_at(layout, run[0]))
    if shoulder and face == "back":
        return run, None, _tip(dart, "back shoulder")
    # Darts point to a vertex inside the run: a bust point along the bust line, else that of the bust's level.
    row = layout.rings[layout.level_row["bust"]]
    apexes = {int(row[layout.to_princess]), int(layout.mirror[row[layout.to_princess]])}
    pointed = apexes if dart.line == "bust" else set(layout.lines["bust"].tolist())
    point = next((vertex for vertex in run[2:-1] if vertex in pointed), None)
    if point is not None and (dart.line == "bust" or shoulder or run[0] in waist):
        reach = float(arc_lengths(vertices[run[: run.index(point) + 1]])[-1])
        return run, point, reach - _tip(dart, "bust" if dart.line == "bust" else face)
    if run[0] in waist and point is None:
        short = _SECOND if dart.towards is not None else 1.0
        return run, None, _tip(dart, f"{face} skirt") * (short if dart.tip_mm is None else 1.0)
    raise InputError(
        f"dart {dart.name!r}: no usual dart lies along {dart.line!r} in piece {dart.piece!r}; give its part, "
        "from the mouth to the tip, as part = [0, 0.3]"
    )


def _lines_at(layout: Layout, vertex: int) -> list[str]:
    return [line for line, ids in layout.lines.items() if vertex in ids]


def _tip(dart: FormDart, kind: str) -> float:
    return 1e-3 * (_TIPS[kind] if dart.tip_mm is None else dart.tip_mm)
