"""Finishing pieces derived from a pattern's own free edges: facings, bands, waistbands and bindings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import arc_lengths, points_at_lengths
from warpflat.core.text import find_unused_name, without_side
from warpflat.garment.free_edges import FreeChain, free_chain, free_edges
from warpflat.pattern.pieces import DEFAULT_ALLOWANCE, Edge, Garment, Piece, Seam, SeamSide

__all__ = ["FINISHES", "Finishing", "finish_edges"]

#: By kind the width of a finishing piece [m]; of bands that of the finished band, which is cut twice as wide and folded.
FINISHES = {"facing": 0.06, "band": 0.02, "waistband": 0.035, "binding": 0.035}


@dataclass(frozen=True, kw_only=True)
class Finishing:
    """A finishing of free edges.

    Attributes:
        kind: one of `FINISHES`.
        edge: name of the edges, without their side: "neck", "armhole", "waist".
        width: [m].
        share: length of a band over that of its edge; it is stretched as it is sewn.
        overlap: by how much a waistband runs past one end [m].
    """

    kind: str
    edge: str
    width: float
    share: float = 1.0
    overlap: float = 0.0

    @property
    def name(self) -> str:
        """Return what its pieces are called."""
        return {"waistband": "waistband", "band": f"{self.edge}_band"}.get(self.kind, f"{self.edge}_{self.kind}")


def finish_edges(pattern: Garment, finishing: Sequence[Finishing], *, gaps: Collection[str] = ()) -> Garment:
    """Return a pattern with the pieces that finish its edges, and the seams that join them.

    Args:
        pattern: with all its openings.
        finishing: what is wanted.
        gaps: names of seams that an opening leaves open at their upper end; a band ends there.

    Raises:
        InputError: no free edge has the name, or a facing cannot be drawn there.
    """
    for number, wish in enumerate(finishing):
        found = [place for place in free_edges(pattern) if without_side(place[1]).rstrip(" 0123456789") == wish.edge]
        if not found:
            known = {without_side(edge).rstrip(" 0123456789") for _, edge in free_edges(pattern)}
            raise InputError(f"finishing[{number}]: no free edge {wish.edge!r}; {nearest(wish.edge, known)}")
        try:
            if wish.kind == "facing":
                pattern = _with_facings(pattern, wish, found, gaps)
            else:
                pattern = _with_strip(pattern, wish, free_chain(pattern, found, gaps))
        except InputError as error:
            raise InputError(f"finishing[{number}]: {error}") from None
    return pattern


def _with_strip(pattern: Garment, wish: Finishing, chain: FreeChain) -> Garment:
    """Return a pattern with a straight strip along a chain of free edges."""
    name = find_unused_name(wish.name, {piece.name for piece in pattern.pieces[pattern.sample]})
    sided = any(without_side(side.edge) != side.edge for side in chain.sides)
    ring = chain.closed and not wish.overlap
    pieces = {}
    for size, row in pattern.pieces.items():
        length = wish.share * sum(pattern.piece(side.piece, size).edge(side.edge).length for side in chain.sides)
        strip = _strip(wish, name, length, row[0], quantity=2 if sided else 1, ring=ring)
        pieces[size] = (*row, strip)
    taken = {seam.name for seam in pattern.seams}
    words = name.replace("_", " ")
    seams = [
        *pattern.seams,
        Seam(
            name=find_unused_name(words, taken), sides=((SeamSide(piece=name, edge="lower"),), chain.sides),
            ease=1.0 / wish.share - 1.0,
        ),
    ]  # fmt: skip
    if ring:
        ends = (SeamSide(piece=name, edge="right end"),), (SeamSide(piece=name, edge="left end", reversed=True),)
        seams.append(Seam(name=find_unused_name(f"{words} ends", taken), sides=ends))
    return replace(pattern, pieces=pieces, seams=seams)


def _strip(wish: Finishing, name: str, length: float, like: Piece, *, quantity: int, ring: bool) -> Piece:
    """Return a strip of one size; its grain runs along a waistband, across a band and aslant over a binding."""
    folded = wish.kind != "binding"
    high, whole = wish.width * (2 if folded else 1), length + wish.overlap
    corners = [[0.0, 0.0], [length, 0.0], [whole, 0.0], [whole, high], [0.0, high]]
    names = ["lower", "overlap", "right end", "upper", "left end"]
    edges = []
    for i, edge in enumerate(names):
        ends = np.array([corners[i], corners[(i + 1) % len(corners)]])
        if np.linalg.norm(ends[1] - ends[0]) > 0.0:
            sewn = edge == "lower" or (ring and edge.endswith("end"))
            # What is turned in has an allowance too, and no seam; a binding's other edge is folded over as it is cut.
            turned_in = 0.0 if wish.kind == "binding" and edge == "upper" else DEFAULT_ALLOWANCE["seam"]
            edges.append(
                Edge(name=edge, points=ends, kind="seam" if sewn else "cut", allowance=None if sewn else turned_in)
            )
    along = {"waistband": [1.0, 0.0], "band": [0.0, 1.0], "binding": [0.7071, 0.7071]}[wish.kind]
    middle, reach = np.array([0.5 * whole, 0.5 * high]), 0.4 * (whole if wish.kind == "waistband" else high)
    grain = middle + np.outer([-reach, reach], along)
    lines = {"fold line": np.array([[0.0, wish.width], [whole, wish.width]])} if folded else {}
    return Piece(
        name=name, size=like.size, fabric=like.fabric, quantity=quantity, edges=edges, internal_lines=lines, grain=grain,
        paired=False,
    )  # fmt: skip


def _with_facings(
    pattern: Garment, wish: Finishing, places: Sequence[tuple[str, str]], gaps: Collection[str]
) -> Garment:
    """Return a pattern with a facing along each of some free edges, joined as the pieces themselves are."""
    names: dict[tuple[str, str], str] = {}
    taken = {piece.name for piece in pattern.pieces[pattern.sample]}
    for piece, edge in places:
        names[piece, edge] = find_unused_name(f"{piece}_{edge}_facing".replace(" ", "_"), taken)
        taken.add(names[piece, edge])
    pieces = {
        size: (*row, *(_facing(pattern.piece(piece, size), edge, wish.width, name) for (piece, edge), name in names.items()))
        for size, row in pattern.pieces.items()
    }  # fmt: skip
    seams, called = list(pattern.seams), {seam.name for seam in pattern.seams}
    parts = {
        (piece, neighbour): name
        for (piece, edge), name in names.items()
        for neighbour in _neighbours(pattern.piece(piece, pattern.sample), edge)
    }
    for (piece, edge), name in names.items():
        words = find_unused_name(name.replace("_", " "), called)
        sides = (SeamSide(piece=piece, edge=edge),), (SeamSide(piece=name, edge=edge),)
        seams.append(Seam(name=words, sides=sides))
        called.add(words)
    # Beside a zip that runs out into the edge the facing's ends are turned in.
    for seam in (seam for seam in pattern.seams if seam.name not in gaps):
        both = [row[0] for row in seam.sides]
        if all(len(row) == 1 for row in seam.sides) and all((side.piece, side.edge) in parts for side in both):
            first, second = (replace(side, piece=parts[side.piece, side.edge]) for side in both)
            words = find_unused_name(f"{seam.name} of {wish.edge} facing", called)
            seams.append(Seam(name=words, sides=((first,), (second,))))
            called.add(words)
    return replace(pattern, pieces=pieces, seams=seams)


def _neighbours(piece: Piece, name: str) -> tuple[str, str]:
    """Return the names of the edges before and after one."""
    names = [edge.name for edge in piece.edges]
    at = names.index(name)
    return names[at - 1], names[(at + 1) % len(names)]


def _facing(piece: Piece, name: str, width: float, title: str) -> Piece:
    """Return the facing of an edge: its line, as much of both neighbours as it is wide, and the line at that distance.

    Raises:
        InputError: a dart ends in the edge, or the facing would not lie within the piece.
    """
    import shapely

    edge, (before, after) = piece.edge(name), (piece.edge(each) for each in _neighbours(piece, name))
    if "dart" in (before.kind, after.kind):
        raise InputError(f"a dart ends in {piece.name}.{name}: give it a band or a binding instead of a facing")
    if min(before.length, after.length) <= width:
        raise InputError(f"the edges beside {piece.name}.{name} are shorter than the facing is wide")
    last, first = _start(after.points, width), _start(before.points[::-1], width)[::-1]
    inner = np.asarray(shapely.LineString(edge.points).offset_curve(width).coords)[::-1]
    body = shapely.Polygon(piece.outline)
    # Near the corners the line leads to where the neighbours end.
    near = np.minimum(*(np.linalg.norm(inner - end, axis=1) for end in (last[-1], first[0])))
    inner = inner[(near > 0.25 * width) & shapely.contains(body, shapely.points(inner))]
    inner = np.vstack([last[-1:], inner, first[:1]])
    edges = [
        replace(edge, vertices=None),
        replace(after, points=last, vertices=None),
        Edge(name="inner edge", points=inner, kind="cut"),
        replace(before, points=first, vertices=None),
    ]
    try:
        return Piece(
            name=title, size=piece.size, fabric=piece.fabric, quantity=piece.quantity, edges=edges, paired=piece.paired,
            grain=_grain(edges, piece),
        )  # fmt: skip
    except InputError:
        raise InputError(f"no facing {1e3 * width:.0f} mm wide can be drawn along {piece.name}.{name}") from None


def _start(points: FloatArray, length: float) -> FloatArray:
    """Return the first part of a line, of a given length [m]."""
    at = arc_lengths(points)
    return np.vstack([points[at < length - 1e-6], points_at_lengths(points, np.array([length]))])


def _grain(edges: Sequence[Edge], piece: Piece) -> FloatArray:
    """Return a grain line of the piece's direction in the middle of a facing's outline."""
    grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
    along = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
    middle = np.concatenate([edges[0].points, edges[2].points]).mean(axis=0)
    return middle + np.outer([-0.02, 0.02], along)
