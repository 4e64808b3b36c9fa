"""Which lines of a drawing are outlines of pieces: decided here for DXF and SVG alike, in metres of cloth."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, InputError, find_unused_name, format_count, off_line, quote_value
from warpflat.flat import join_labels
from warpflat.pattern.drafting.outline_edges import boundary_edges
from warpflat.pattern.drafting.piece_parts import FOLD_STRAIGHT
from warpflat.pattern.drafting.pieces import Piece

__all__ = [
    "ENDS_MEET",
    "MOST_POINTS",
    "TOO_MANY",
    "DrawnLine",
    "Outlines",
    "boundary_pieces",
    "by_size",
    "check_closed",
    "close_lines",
    "counted",
    "find_outlines",
    "left_out",
    "read_grain",
    "read_quantity",
    "simple_ring",
]

#: Ends of lines that are nearer to each other than this [m] meet.
ENDS_MEET = 5e-5
#: Points of a drawing, at most: a pattern of several sizes has some ten thousand; and what is said of more.
MOST_POINTS = 1_000_000
TOO_MANY = f"the drawing has more than {MOST_POINTS:,} points; leave out all but the pattern"
# Cloth of this area [m2] at most is left out where an outline crosses itself at a corner: an allowance's width, squared.
_CORNER = 1e-4
# A line that crosses itself about so many times is a scribble.
_SCRIBBLE = 1e6
# A closed line around no more than this [m2] is a mark, or a line to and fro.
_POINT = 1e-6
# A line whose ends lack less than this share of its length to meet, a side at most, is an outline that does not close, if it goes
# around this share of the largest piece.
_NEARLY_CLOSED, _LEAST_SHARE = 0.4, 0.1
# A line within another one is the other's own, such as its sewing line, where it is nowhere farther from it than this [m].
_BESIDE = 0.04
# The frame of a page has the page's sides but for this share.
_FRAME = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnLine:
    """A line of a drawing.

    Attributes:
        points: #P by 2 [m]; the first of a closed line is not repeated.
        closed: whether it closes.
        name: that the drawing gives it; "" for none.
        group: the name of the group in which it lies.
        by_hand: whether a person has named it, so that it is a piece wherever it lies.
    """

    points: FloatArray
    closed: bool
    name: str = ""
    group: str = ""
    by_hand: bool = False

    @property
    def path(self) -> FloatArray:
        """Points (#P by 2 [m]) from its first to its last; the first of a closed line is both."""
        return np.concatenate([self.points, self.points[:1]]) if self.closed else self.points


@dataclass(frozen=True, kw_only=True, eq=False)
class Outlines:
    """The outlines that lines form.

    Attributes:
        rings: closed lines, the largest first; a ring that several lines form has its group's name, or the first name of these.
        chains: the lines that do not close, joined where their ends meet, named likewise.
    """

    rings: list[DrawnLine]
    chains: list[DrawnLine]


def close_lines(lines: Sequence[DrawnLine], fold: FloatArray | None = None) -> Outlines:
    """Return the closed lines, and those that open lines form whose ends meet within `ENDS_MEET`, or lie on a fold (2 by 2 [m])."""
    import shapely

    rings = [line for line in lines if line.closed and len(line.points) > 2]
    open_lines = [line for line in lines if not line.closed and len(line.points) > 1]
    if not open_lines:
        return Outlines(rings=_largest_first(rings), chains=[])
    ends = np.concatenate([line.points[[0, -1]] for line in open_lines])
    # Those in one cell of a fine grid are as one, as in the middle of a star; the first of all that meet gives their place.
    _, sample, cell = np.unique(np.floor(ends / (0.25 * ENDS_MEET)), axis=0, return_index=True, return_inverse=True)
    pairs = cKDTree(ends[sample]).query_pairs(ENDS_MEET, output_type="ndarray")
    node = join_labels(len(sample), *pairs.T)[cell.ravel()]
    place = ends[np.unique(node, return_index=True)[1]][node].reshape(-1, 2, 2)
    strings: Any = [
        shapely.LineString(np.concatenate([at[:1], line.points[1:-1], at[1:]]))
        for at, line in zip(place, open_lines, strict=True)
    ]
    # A line that is drawn twice is one.
    unique = list({shapely.to_wkb(shapely.normalize(string)): string for string in strings}.values())
    merged = shapely.get_parts(shapely.line_merge(shapely.MultiLineString(unique)))
    closed = shapely.is_closed(merged)
    # Where more than two lines meet, the areas between them are outlines.
    areas, *rest = shapely.polygonize_full(merged[~closed])
    # The lines of a ring or a chain all belong to one net, which names it.
    net = join_labels(int(node.max()) + 1, *node.reshape(-1, 2).T)
    at_place = {tuple(point): net[number] for point, number in zip(place.reshape(-1, 2).tolist(), node, strict=True)}
    of_net: dict[int, list[DrawnLine]] = {}
    for line, number in zip(open_lines, node[::2], strict=True):
        of_net.setdefault(int(net[number]), []).append(line)
    named: dict[int, tuple[str, bool]] = {}
    for number, own in of_net.items():
        groups = {line.group for line in own}
        group = groups.pop() if len(groups) == 1 else ""
        one = next((line for line in own if line.name), own[0])
        named[number] = group or one.name, bool(group) or one.by_hand

    def drawn(string: Any, *, closed: bool) -> DrawnLine:
        points = np.asarray(string.coords)[:-1] if closed and string.is_closed else np.asarray(string.coords)
        number = next(int(at_place[key]) for point in points.tolist() if (key := tuple(point)) in at_place)
        name, by_hand = named[number]
        return DrawnLine(points=points, closed=closed, name=name, by_hand=by_hand)

    rings += [drawn(ring, closed=True) for ring in merged[closed]]
    rings += [drawn(area.exterior, closed=True) for area in shapely.get_parts(areas)]
    chains = list[DrawnLine]()
    for string in (each for part in rest for each in shapely.get_parts(shapely.line_merge(part))):
        ends_on = fold is not None and (off_line(np.asarray(string.coords)[[0, -1]], fold) <= FOLD_STRAIGHT).all()
        closes = bool(ends_on and len(string.coords) > 2)
        (rings if closes else chains).append(drawn(string, closed=closes))
    return Outlines(rings=_largest_first([ring for ring in rings if len(ring.points) > 2]), chains=chains)


def simple_ring(points: FloatArray, where: str) -> FloatArray:
    """Return the outer ring of a closed line (#P by 2 [m]), which may cross itself at a corner, but not farther in.

    Raises:
        InputError: it has no area, or more cloth than at a corner lies beyond where it crosses itself.
    """
    import shapely

    polygon = shapely.Polygon(points)
    if polygon.is_valid and polygon.area > 0.0:
        return points
    # A line of length L drawn at random within an area A crosses itself L^2 / (pi A) times (Santalo, Integral Geometry).
    if polygon.length**2 > _SCRIBBLE * np.pi * polygon.convex_hull.area > 0.0:
        raise InputError(
            f"{where}: its outline crosses itself all over, {polygon.length:.0f} m of it; a piece has one outer line"
        )
    faces = shapely.get_parts(shapely.polygonize([shapely.node(shapely.LinearRing(points))]))
    parts = sorted(shapely.get_parts(shapely.union_all(faces)), key=lambda part: -part.area)
    if not parts or parts[0].area <= 0.0:
        raise InputError(f"{where}: its outline has no area; a boundary is a closed line")
    if sum(part.area for part in parts[1:]) > _CORNER:
        x, y = np.asarray(shapely.intersection(parts[0].exterior, parts[1].exterior).centroid.coords)[0]
        raise InputError(
            f"{where}: its outline crosses itself at ({1e3 * x:.1f}, {1e3 * y:.1f}) mm, beyond a corner; a piece has one outer line"
        )
    return np.asarray(parts[0].exterior.coords)[:-1]


def read_grain(line: DrawnLine) -> FloatArray:
    """Return the ends of a grain line, 2 by 2 [m], the lower one first: pieces are drawn as they are worn, whichever way it runs."""
    ends = line.points[[0, -1]]
    return ends[::-1] if ends[1, 1] < ends[0, 1] else ends


def read_quantity(text: str) -> int:
    """Return how often a piece is cut, as a file has it; 1 where it is no number from 1 to 999."""
    return int(text) if re.fullmatch(r"\s*0*[1-9][0-9]{0,2}\s*", text) else 1


def boundary_pieces(rings: Sequence[DrawnLine], allowance: float | None, where: str, taken: set[str]) -> list[Piece]:
    """Return the pieces of which a drawing has the outlines alone, called by their names or "piece_1" and so on.

    Args:
        rings: the outlines.
        allowance: from them to the sewing lines [m]; none if not given.
        where: what messages begin with.
        taken: names of other pieces; theirs are added.

    Raises:
        InputError: nothing is left within the allowance, or there are too many points.
    """
    pieces = []
    for number, ring in enumerate(rings, start=1):
        name = find_unused_name(ring.name or f"piece_{number}", taken)
        taken.add(name)
        pieces.append(Piece(name=name, edges=boundary_edges(ring.points, allowance, f"{where}: {name}")))
    return pieces


def by_size(pieces: Iterable[Piece]) -> dict[str, list[Piece]]:
    """Return pieces by their sizes."""
    sizes: dict[str, list[Piece]] = {}
    for piece in pieces:
        sizes.setdefault(piece.size, []).append(piece)
    return sizes


def counted(names: Sequence[str]) -> str:
    """Return names in their order, those that occur more than once with their number: "HATCH (3), IMAGE"."""
    count = {name: names.count(name) for name in dict.fromkeys(names)}
    return ", ".join(f"{name} ({number})" if number > 1 else name for name, number in count.items())


def left_out(names: Sequence[str], what: str, where: str = "") -> str:
    """Return the sentence that some lines were left out, with the names that they have: "2 open lines were left out: 'yoke'"."""
    known = ", ".join(quote_value(name) for name in dict.fromkeys(names) if name)
    verb = "was" if len(names) == 1 else "were"
    return f"{format_count(len(names), what)}{where} {verb} left out" + (f": {known}" if known else "")


def find_outlines(
    lines: Sequence[DrawnLine],
    where: str,
    *,
    page: tuple[float, float] | None = None,
    fold: FloatArray | None = None,
) -> tuple[list[DrawnLine], list[str]]:
    """Return the outlines of the pieces among the lines of a drawing, the largest first, and what was left out, a sentence each.

    A closed line is a piece unless it lies within another; then it is one if a person has named it, and if it is not the other's
    own line, such as the sewing line within the cutting line. A rectangle of the page's size around other closed lines is a frame.

    Args:
        lines: of the drawing.
        where: what messages begin with.
        page: the sides of the page [m]; None where the drawing has none.
        fold: 2 by 2 [m], a line of symmetry, which closes what is open along it.

    Raises:
        InputError: an outline does not close, or crosses itself elsewhere than at a corner.
    """
    import shapely

    found = close_lines(lines, fold)
    notes, frames = list[str](), list[int]()
    rings = [ring for ring in found.rings if shapely.Polygon(ring.points).convex_hull.area > _POINT]
    if len(rings) < len(found.rings):
        notes.append(f"left out as too small for pieces: {format_count(len(found.rings) - len(rings), 'closed line')}")
    if page is not None and len(rings) > 1:
        for k, ring in enumerate(rings):
            polygon, sides = shapely.Polygon(ring.points), np.ptp(ring.points, axis=0)
            full = polygon.is_valid and polygon.area >= (1.0 - 0.01 * _FRAME) * sides.prod()
            if full and (np.abs(sides / page - 1.0) <= _FRAME).all():
                frames.append(k)
        frames = frames if len(frames) < len(rings) else []
        names = [quote_value(rings[k].name) if rings[k].name else "a closed line" for k in frames]
        notes += [f"{name} has the page's size and was taken for its frame" for name in names]
    rings = [ring for k, ring in enumerate(rings) if k not in frames]
    whole = [simple_ring(ring.points, f"{where}: {ring.name}" if ring.name else where) for ring in rings]
    polygons = np.array([shapely.Polygon(ring) for ring in whole])
    tree, taken = shapely.STRtree(polygons), np.zeros(len(rings), dtype=bool)
    wide: dict[int, Any] = {}
    within = list[str]()
    for number, (ring, polygon) in enumerate(zip(rings, polygons, strict=True)):
        around = tree.query(polygon.representative_point())
        around = around[taken[around]]
        for other in around.tolist():
            if other not in wide:
                wide[other] = polygons[other].buffer(FOLD_STRAIGHT, quad_segs=2)
                shapely.prepare(wide[other])
        others = [other for other in around.tolist() if wide[other].covers(polygon)]
        own = [k for k in others if shapely.hausdorff_distance(polygon.exterior, polygons[k].exterior) <= _BESIDE]
        taken[number] = not others or (ring.by_hand and not own)
        if not taken[number]:
            within.append(ring.name)
    if within:
        notes.append(left_out(within, "closed line", " within pieces"))
    check_closed([chain.points for chain in found.chains], list(polygons[taken]), where)
    if found.chains:
        notes.append(left_out([chain.name for chain in found.chains], "open line"))
    groups = Counter(ring.group for ring, kept in zip(rings, taken.tolist(), strict=True) if kept)
    # The only piece of a group has its name, whether its outline is one line or several.
    pieces = [
        DrawnLine(
            points=points,
            closed=True,
            name=ring.group if ring.group and groups[ring.group] == 1 and not ring.by_hand else ring.name,
        )
        for ring, points, kept in zip(rings, whole, taken.tolist(), strict=True)
        if kept
    ]
    return pieces, notes


def check_closed(chains: Sequence[FloatArray], pieces: Sequence[Any], where: str) -> None:
    """Refuse open lines (#P by 2 [m]) that nearly go around a piece, beside the closed ones (polygons): the piece would be lost.

    Raises:
        InputError: there are some.
    """
    import shapely

    tree, least = shapely.STRtree(pieces), _LEAST_SHARE * max((each.area for each in pieces), default=0.0)
    for points in chains:
        chain = shapely.LineString(points)
        gap, area = float(np.linalg.norm(points[-1] - points[0])), float(shapely.convex_hull(chain).area)
        round_something = len(points) > 2 and area > max(least, _LEAST_SHARE * (0.25 * chain.length) ** 2)
        if not round_something or gap >= _NEARLY_CLOSED * chain.length:
            continue
        # One point decides whether it lies within another.
        if not any(pieces[k].intersects(chain.centroid) for k in tree.query(chain.centroid)):
            at = ", ".join(f"{1e3 * x:.0f}" for x in points[0])
            raise InputError(
                f"{where}: an outline is open by {1e3 * gap:.1f} mm at ({at}) mm; join its ends, for a piece is a closed line"
            )


def _largest_first(rings: Sequence[DrawnLine]) -> list[DrawnLine]:
    import shapely

    return sorted(rings, key=lambda ring: -shapely.Polygon(ring.points).convex_hull.area)
