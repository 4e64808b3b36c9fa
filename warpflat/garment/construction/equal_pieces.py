"""Pieces that are equal, such as the gores of a ball: one is drawn, and cut as often as there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise, product

import numpy as np

from warpflat.core import FloatArray, arc_lengths, points_at_lengths, resample
from warpflat.garment.construction.edges import SAME_LINE
from warpflat.pattern import Pattern, Piece, Seam, SeamSide, line_name

__all__ = ["Copy", "draw_equal_pieces_once", "drawn_sides", "run_back"]

# Outlines are equal if they lie on each other within this [m], and this share of their size, after a rigid motion; grains are
# within this [rad].
_SAME_OUTLINE, _SHARE, _SAME_GRAIN = 1.5e-3, 0.01, np.radians(3.0)
# So many ways of laying all copies are tried until their seams run alike.
_MOST_WAYS = 256
# Places along each edge at which outlines are compared.
_SAMPLES = 33


@dataclass(frozen=True, kw_only=True)
class Copy:
    """A piece that is cut by another one's pattern.

    Attributes:
        of: the piece that is drawn.
        edges: the edge of that piece for each of its own.
        turned: whether it is cut turned over.
        copy: its number among the copies, from 0.
        points: the other piece's edges, each as it lies here [m].
        apart: distance of both outlines [m].
    """

    of: str
    edges: Mapping[str, str]
    turned: bool
    copy: int = 0
    points: Mapping[str, FloatArray] = field(default_factory=dict)
    apart: float = 0.0

    def drawn(self, part: SeamSide) -> SeamSide:
        """Return what is sewn at one of its edges as the edge of the piece that is drawn."""
        return SeamSide(
            piece=self.of,
            edge=self.edges[part.edge],
            reversed=part.reversed != self.turned,
            mirrored=part.mirrored != self.turned,
            copy=self.copy,
        )


def draw_equal_pieces_once(pattern: Pattern, called: str = "") -> tuple[Pattern, tuple[str, ...]]:
    """Return the pattern with one piece drawn for several that are equal, and a note on each such piece.

    Equal are pieces of one name, up to left, right and a number, whose outlines lie on each other within 1.5 mm after a rigid
    motion that keeps the grain. They are averaged. Seams name the copies at which they are sewn, and run the same way along an edge that
    is drawn once, so that its notches serve for all.

    Args:
        pattern: in one size.
        called: how the names of the pieces begin that may be drawn once.
    """
    (size, pieces), *others = pattern.pieces.items()
    if others or len(pieces) < 2:
        return pattern, ()
    sewn = [side for seam in pattern.seams for side in seam.stretches]
    unlike = {side.piece for seam in pattern.seams if seam.ease or seam.openings for side in seam.stretches}
    unlike |= {side.piece for seam in pattern.seams if max(map(len, seam.sides)) > 1 for side in seam.stretches}
    free = [
        piece
        for piece in pieces
        if piece.name.startswith(called) and not (piece.darts or piece.holes or piece.on_fold or piece.name in unlike)
    ]
    at_seams = {side.place for side in sewn}
    copies: dict[str, list[Copy]] = {}
    for number, head in enumerate(free):
        if head.name in copies or any(ways[0].of == head.name for ways in copies.values()):
            continue
        group = [
            (piece, ways)
            for piece in free[number + 1 :]
            if piece.name not in copies
            and _stem(piece) == _stem(head)
            # What is sewn at one is sewn at all: the notches of an edge are those of all its copies.
            and (
                ways := [
                    way
                    for way in _laid_on(piece, head)
                    if all(
                        ((piece.name, own) in at_seams) == ((head.name, edge) in at_seams)
                        for own, edge in way.edges.items()
                    )
                ]
            )
        ]
        pairs = head.quantity % 2 == 0 and head.paired
        if not pairs and sum(ways[0].turned for _, ways in group) != sum(not ways[0].turned for _, ways in group) + 1:
            # Of single pieces as many are cut turned over as not, or none.
            group = [(piece, ways) for piece, ways in group if not ways[0].turned]
        counts = {False: 1, True: 1 if pairs else 0}
        for piece, ways in group:
            kind = ways[0].turned and not pairs
            copies[piece.name] = [
                replace(way, copy=counts[kind]) for way in ways if pairs or way.turned == ways[0].turned
            ]
            counts[kind] += 1
    if not copies:
        return pattern, ()
    # A gore lies on another one upside down and turned over, too: its seams may run alike only so.
    for row in islice(product(*copies.values()), _MOST_WAYS):
        chosen = dict(zip(copies, row, strict=True))
        seams = _run_alike([replace(seam, sides=drawn_sides(seam, chosen)) for seam in pattern.seams])
        if seams is not None:
            break
    else:
        return pattern, ()
    drawn, notes = list[Piece](), list[str]()
    for piece in (piece for piece in pieces if piece.name not in chosen):
        own = {name: copy for name, copy in chosen.items() if copy.of == piece.name}
        if own:
            piece, moved = _averaged(piece, list(own.values()))
            count = piece.quantity * (1 + len(own))
            paired = (piece.quantity % 2 == 0 and piece.paired) or any(copy.turned for copy in own.values())
            if paired and _laid_on(piece, piece, turned=True):
                # Turned over it is itself.
                paired = False
            piece = replace(piece, quantity=count, paired=paired)
            words = f"{piece.name}: cut {count} times, it serves for {', '.join(own)} too"
            if moved > SAME_LINE:
                words += f"; they are averaged, which moves their outlines by at most {1e3 * moved:.1f} mm"
            notes.append(words)
        drawn.append(piece)
    return replace(pattern, pieces={size: tuple(drawn)}, seams=seams), tuple(notes)


def _stem(piece: Piece) -> tuple[str, str, str, int]:
    """Return what equal pieces have in common beside their outlines."""
    return line_name(piece.name), piece.role, piece.fabric, piece.quantity


def _laid_on(piece: Piece, head: Piece, *, turned: bool | None = None) -> list[Copy]:
    """Return how a piece lies on another one, the nearest way first, and those turned over last."""
    if len(piece.edges) != len(head.edges) or piece.grain is None or head.grain is None:
        return []
    goal = np.concatenate([_samples(edge.points) for edge in head.edges])
    middle = goal.mean()
    within = min(_SAME_OUTLINE, _SHARE * 2.0 * float(np.abs(goal - middle).max()))
    found: list[Copy] = []
    for over in (False, True) if turned is None else (turned,):
        edges = [
            replace(edge, points=(edge.points * [-1.0, 1.0])[::-1] if over else edge.points)
            for edge in (piece.edges[::-1] if over else piece.edges)
        ]
        grain = _complex(piece.grain * [-1.0, 1.0] if over else piece.grain)
        for first in range(len(edges)):
            row = [*edges[first:], *edges[:first]]
            if any(
                (one.kind, one.width) != (two.kind, two.width) or abs(one.length - two.length) > 2.0 * within
                for one, two in zip(row, head.edges, strict=True)
            ):
                continue
            here = np.concatenate([_samples(edge.points) for edge in row])
            turn = ((goal - middle) * np.conj(here - here.mean())).sum()
            turn /= max(abs(turn), 1e-300)
            apart = float(np.abs(goal - middle - turn * (here - here.mean())).max())
            way = turn * (grain[1] - grain[0]) * np.conj(np.diff(_complex(head.grain))[0])
            # Up or down the grain.
            aside = min(abs(np.angle(way)), np.pi - abs(np.angle(way)))
            if apart > within or aside > _SAME_GRAIN:
                continue
            laid = [middle + turn * (_complex(edge.points) - here.mean()) for edge in row]
            found.append(
                Copy(
                    of=head.name,
                    edges={edge.name: two.name for edge, two in zip(row, head.edges, strict=True)},
                    copy=0,
                    turned=over,
                    points={
                        two.name: np.stack([points.real, points.imag], axis=1)
                        for points, two in zip(laid, head.edges, strict=True)
                    },
                    apart=apart,
                )
            )
    return sorted(found, key=lambda one: (one.turned, one.apart))


def _complex(points: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    return np.asarray(points[:, 0] + 1j * points[:, 1])


def _samples(points: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    return _complex(resample(points, np.linspace(0.0, 1.0, _SAMPLES)))


def _averaged(head: Piece, copies: Sequence[Copy]) -> tuple[Piece, float]:
    """Return a piece with the mean outline of all its copies, and how far that is from any of them at most [m]."""
    moved, edges = 0.0, []
    for edge in head.edges:
        arc = arc_lengths(edge.points)
        rows = [edge.points]
        for copy in copies:
            other = copy.points[edge.name]
            rows.append(points_at_lengths(other, arc * (arc_lengths(other)[-1] / arc[-1])))
        mean = np.mean(rows, axis=0)
        moved = max(moved, float(np.linalg.norm(np.array(rows) - mean, axis=2).max()))
        edges.append(replace(edge, points=mean))
    if moved <= SAME_LINE:
        return head, moved
    for edge, following in pairwise([*edges, edges[0]]):
        # The corner of both is one point, bit for bit.
        following.points[0] = edge.points[-1]
    return replace(head, edges=edges), moved


def drawn_sides(seam: Seam, copies: Mapping[str, Copy]) -> tuple[tuple[SeamSide, ...], tuple[SeamSide, ...]]:
    """Return the sides of a seam between pieces that are drawn, and their copies by name."""
    one, other = (
        tuple(copies[part.piece].drawn(part) if part.piece in copies else part for part in side) for side in seam.sides
    )
    return one, other


def run_back(side: Sequence[SeamSide]) -> tuple[SeamSide, ...]:
    """Return a side of a seam, run the other way."""
    return tuple(replace(part, reversed=not part.reversed) for part in reversed(side))


def _run_alike(seams: Sequence[Seam]) -> tuple[Seam, ...] | None:
    """Return the seams, each along an edge in the direction in which others run along its copies; None if they cannot."""
    way: dict[tuple[str, str], bool] = {}
    # A row of several edges, as a waist's, keeps its order: two of them may be one edge and its mirror image.
    single = [row[0] for seam in seams for row in seam.sides if len(row) == 1]
    copied = {s.place for s in single if not s.is_drawn}
    waiting = list(enumerate(seams))
    made: dict[int, Seam] = {}
    while waiting:
        # Next one whose direction others say.
        number, seam = next((one for one in waiting if any(s.place in way for s in one[1].stretches)), waiting[0])
        waiting.remove((number, seam))
        known = [s for s in seam.stretches if s.place in way]
        if known and known[0].reversed != way[known[0].place]:
            seam = replace(seam, sides=(run_back(seam.sides[0]), run_back(seam.sides[1])))
        for s in seam.stretches:
            if s.place in copied and way.setdefault(s.place, s.reversed) != s.reversed:
                return None
        made[number] = seam
    return tuple(made[number] for number in range(len(seams)))
