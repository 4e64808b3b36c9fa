"""Candidates for a cut, each with its price: along feature lines near some places, straight from the border to them, and inwards.

A candidate runs from the border to a place, from border to border, or, where the place is at the border, from there inwards. Places are
peaks of the energy, or where the cloth does not fit. Peaks that mirror each other (two busts) make pairs: a pattern maker cuts both or
none. What a candidate would do is foretold by a crack in the laid piece (`warpflat.flat.cutting.crack`), so that few have to be tried.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.cutting.crack import LaidCloth, Price
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.surface.energy_map import place_in_words, smooth_to_vertices
from warpflat.flat.surface.half_edges import border_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import path_length
from warpflat.flat.surface.paths.geodesic import distance_from
from warpflat.flat.surface.paths.trace import SurfacePath, polyline_path

__all__ = ["Candidate", "find_candidates", "find_peaks", "peaks_in_words"]

Ids = NDArray[np.int64]


# Lengths are shares of the piece's diagonal.
_SMOOTHING = 0.02
_APART = 0.15
_REACH = 0.12
_SHORTEST = 0.04
# A peak counts from this share of the highest peak's density.
_NEARLY_AS_HIGH = 0.7
_MOST_PEAKS = 4
# Two cuts whose lengths agree to this share mirror each other.
_ALIKE = 0.03
# A cut from a place at the border ends after such shares of the way to the middle of the cloth.
_INWARDS = {"inward": 0.8, "short inward": 0.4}
# A piece whose edges are all within this share of their lengths is flat but for rounding.
_FREE_OF_STRAIN = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A cut that could be made.

    Attributes:
        name: what it is called.
        paths: vertices of the uncut surface along its edges, from the border inwards; of what is drawn those that are nearest.
        drawn: paths that need not follow edges, to be worked into the mesh first; none if it runs along edges.
        places: the numbers of the places at which it ends.
        price: what it would do, without a trial.
        table: that makes it as one of a scene's `[[cuts]]`; none of a pair.
        has_twin: whether another one mirrors it, so that both are also a pair.
    """

    name: str
    paths: tuple[IntArray, ...]
    price: Price
    drawn: tuple[SurfacePath, ...] = ()
    places: tuple[int, ...] = ()
    table: Mapping[str, Any] | None = None
    has_twin: bool = False


def find_peaks(result: Flattening) -> tuple[int, ...]:
    """Return the vertices of the uncut surface where the smoothed energy density inside a piece peaks, highest first."""
    surface, size = result.surface, _diagonal(result.surface)
    # On the cut surface energy does not spread across a crack; copies of a vertex are then put together again.
    apart = smooth_to_vertices(result.network.surface, result.face_energy_density, smoothing_length=_SMOOTHING * size)
    density = np.zeros(len(surface.vertices))
    np.maximum.at(density, result.vertex_origin, apart)
    density[_border(result)] = -1.0
    chosen: list[int] = []
    for vertex in np.argsort(-density, kind="stable").tolist():
        if density[vertex] <= 0 or (chosen and density[vertex] < _NEARLY_AS_HIGH * density[chosen[0]]):
            break
        gap = np.linalg.norm(surface.vertices[chosen] - surface.vertices[vertex], axis=1)
        if len(chosen) < _MOST_PEAKS and gap.min(initial=np.inf) > _APART * size:
            chosen.append(vertex)
    return tuple(chosen)


def find_candidates(result: Flattening, places: Sequence[int] | None = None) -> tuple[Candidate, ...]:
    """Find cuts worth comparing on a flattened piece, cut before or not.

    Each feature line that passes near a place, from each of its ends on the border to there and as a whole; for each place the best of
    the straight cuts from the border around it, or from the border two ways inwards; and the pairs of those that mirror each other.

    Args:
        result: the piece.
        places: vertices of its uncut surface; the peaks of its energy if not given.

    Raises:
        InputError: the piece stores no energy away from its border, so there is nowhere to cut to.
    """
    places = find_peaks(result) if places is None else places
    if not len(places) or result.layout_measures["length_error"] < _FREE_OF_STRAIN:
        raise InputError(f"piece {result.surface.name!r} stores no strain energy inside: there is nothing to cut for")
    laid = LaidCloth(result.network, result.positions)
    found: dict[tuple[int, ...], tuple[Candidate, Ids]] = {}
    names: dict[str, int] = {}
    lines = (
        one
        for name, line in result.surface.lines.items()
        for one in _along_line(result, laid, name, np.asarray(line, dtype=np.int32), places)
    )
    straight = (one for number in range(len(places)) for one in _straight(result, laid, number, places))
    for one, row in (*lines, *straight):
        key = tuple(sorted(row.tolist()))
        if key not in found:
            names[one.name] = names.get(one.name, 0) + 1
            found[key] = replace(one, name=f"{one.name} ({names[one.name]})") if names[one.name] > 1 else one, row
    # Pairs of cuts of one length that lead to two places and share no vertex, each pair as one cut, with both names.
    pairs, size = [], _diagonal(result.surface)
    for (a, row), (b, other) in combinations(found.values(), 2):
        if not (a.places and b.places) or set(a.places) & set(b.places) or bool(a.drawn) != bool(b.drawn):
            continue
        # Two cuts that mirror each other are as long and have ends at equal distances across.
        (begin, tip), (other_begin, other_tip) = (result.surface.vertices[one.paths[0][[0, -1]]] for one in (a, b))
        across = np.linalg.norm(begin - other_tip) - np.linalg.norm(tip - other_begin)
        lengths = [sum(path.length for path in one.drawn) or path_length(result.surface, one.paths) for one in (a, b)]
        alike = abs(lengths[0] - lengths[1]) <= _ALIKE * max(lengths) and abs(across) <= _ALIKE * size
        if not alike or np.isin(row, other).any():
            continue
        along = a.name.rpartition(" from ")[0]
        same = along and b.name.startswith(f"{along} from ")
        both = Candidate(
            name=f"{a.name} and {b.name.removeprefix(along + ' from ')}" if same else f"{a.name} + {b.name}",
            paths=a.paths + b.paths,
            price=laid.price([row, other]),
            drawn=a.drawn + b.drawn,
            places=tuple(sorted({*a.places, *b.places})),
        )
        pairs.append((both, (a.name, b.name)))
    twins = {name for pair in pairs for name in pair[1]}
    return (*(pair for pair, _ in pairs), *(replace(one, has_twin=one.name in twins) for one, _ in found.values()))


def peaks_in_words(result: Flattening) -> tuple[str, ...]:
    """Return the places of the peaks of a piece's energy as sentences, highest first; of two that mirror each other by a line more."""
    surface, peaks = result.surface, find_peaks(result)
    words = [place_in_words(surface, vertex) for vertex in peaks]
    for lines in range(3, len(surface.lines) + 1):
        alike = [number for number, place in enumerate(words) if words.count(place) > 1]
        for number in alike:
            words[number] = place_in_words(surface, peaks[number], lines=lines)
    return tuple(words)


def _diagonal(surface: Surface) -> float:
    return float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))


def _border(result: Flattening) -> BoolArray:
    """Return for each vertex of the uncut surface (#V) whether it is on the border or on a crack; the tip of a dart is on neither."""
    edges = border_edges(result.faces)
    flags = np.zeros(len(result.surface.vertices), dtype=bool)
    flags[result.vertex_origin[edges.ravel()]] = True
    return flags


def _along_line(
    result: Flattening, laid: LaidCloth, name: str, line: IntArray, places: Sequence[int]
) -> Iterator[tuple[Candidate, Ids]]:
    """Yield the parts of an uncut line from the border to the places near it, and the whole line, with their rows in the layout."""
    surface, size = result.surface, _diagonal(result.surface)
    on_border = _border(result)
    rim = {int(v) for v in border_edges(surface.faces).ravel()}
    if line[0] == line[-1] or np.count_nonzero(on_border[line[1:-1]]) > 0.5 * (len(line) - 2):
        return
    points = surface.vertices[line]

    def priced(
        title: str, path: IntArray, part: Sequence[float] = (), places: tuple[int, ...] = ()
    ) -> Iterator[tuple[Candidate, Ids]]:
        row = laid.row_of(result.vertex_origin, path)
        if row is not None:
            table = {"line": name} | ({"part": list(part)} if part else {})
            yield Candidate(name=title, paths=(path,), price=laid.price([row]), places=places, table=table), row

    passes = False
    for number, place in enumerate(places):
        distance = np.linalg.norm(points - surface.vertices[place], axis=1)
        station = int(np.argmin(distance))
        if distance[station] > _REACH * size or on_border[line[station]]:
            continue
        passes = True
        for part, end in ((line[: station + 1], "its start"), (line[station:][::-1], "its end")):
            # The cut begins at the vertex of a border or a crack that is nearest to the place.
            outwards = np.flatnonzero(on_border[part[::-1]])
            if not len(outwards):
                continue
            row = part[len(part) - 1 - int(outwards[0]) :]
            if path_length(surface, [row]) <= _SHORTEST * size:
                continue
            others = [other for k, other in enumerate(places) if k != number]
            if any(_distance(surface, row, other) < _REACH * size for other in others):
                # It would run through another place to this one; the part up to that is a candidate of its own.
                continue
            # It is named after the border line that it begins on.
            begins = (
                border
                for border, along in surface.lines.items()
                if border != name and row[0] in along and all(int(v) in rim for v in along)
            )
            whole = polyline_length(points)
            first, last = (
                polyline_length(points[: int(np.flatnonzero(line == v)[0]) + 1]) / whole for v in row[[0, -1]]
            )
            yield from priced(f"{name} from {next(begins, end)}", row, (round(first, 4), round(last, 4)), (number,))
    if passes and on_border[line[[0, -1]]].all():
        yield from priced(f"{name}, whole", line)


def _distance(surface: Surface, path: IntArray, vertex: int) -> float:
    return float(np.linalg.norm(surface.vertices[path] - surface.vertices[vertex], axis=1).min())


def _straight(
    result: Flattening, laid: LaidCloth, number: int, places: Sequence[int]
) -> Iterator[tuple[Candidate, Ids]]:
    """Yield straight cuts to a place, with their rows in the layout: that from the border around it which releases most for its length.

    Of a place near the border two lead from there inwards.
    """
    surface, size, flat = result.surface, _diagonal(result.surface), laid.positions
    quads = bool(surface.is_quad.all())
    place = int(np.flatnonzero(result.vertex_origin == places[number])[0])

    def priced(title: str, row: Ids | None) -> Iterator[tuple[Candidate, Ids]]:
        if row is None or path_length(surface, [path := result.vertex_origin[row]]) <= _SHORTEST * size:
            return
        drawn: tuple[SurfacePath, ...] = ()
        if not quads:
            # On triangles, whose edges lead nowhere in particular, it is drawn.
            with suppress(InputError):
                drawn = (polyline_path(surface, path[[0, -1]].tolist()),)
        ends = [[round(x, 5) for x in surface.vertices[end].tolist()] for end in path[[0, -1]]]
        table = dict(zip(("from", "to"), ends, strict=True))
        cost = laid.price([row])
        yield Candidate(name=title, paths=(path,), price=cost, drawn=drawn, places=(number,), table=table), row

    if not laid.border[place]:
        rows = [laid.dart(mouth, place) for mouth in dict.fromkeys(laid.mouths(place))]
        around = [
            one for row in rows for one in priced(f"free path {_last_number(result, 'free path') + number + 1}", row)
        ]
        # Sheared quads give way along their diagonals, which a crack in the membrane does not know: of theirs the shortest.
        yield from sorted(around, key=lambda one: one[0].price.length if quads else -one[0].price.per_metre)[:1]
    rim = np.flatnonzero(laid.border & np.isin(result.vertex_origin, border_edges(surface.faces)))
    start = laid.nearest(rim, flat[place])
    made = (path for one in result.cuts for path in one.paths)
    if np.linalg.norm(flat[start] - flat[place]) > _REACH * size or any(
        _distance(surface, path, int(result.vertex_origin[start])) < _REACH * size for path in made
    ):
        # Beside an earlier cut it would leave a strip.
        return
    # The cloth along a border is too long or too short because of what lies behind it: that is what a cut has to reach.
    inner = np.flatnonzero(~laid.border)
    middle = inner[distance_from(surface, np.unique(border_edges(surface.faces)))[result.vertex_origin[inner]].argmax()]
    for kind, share in _INWARDS.items():
        tip = laid.nearest(inner, (1.0 - share) * flat[start] + share * flat[middle])
        yield from priced(f"{kind} {_last_number(result, 'inward') + number + 1}", laid.dart(start, tip))


def _last_number(result: Flattening, kind: str) -> int:
    """Return the highest number in the names of lines and cuts of a kind; 0 if there is none."""
    names = " ".join([*result.surface.lines, *(made.name for made in result.cuts)])
    return max((int(found) for found in re.findall(rf"\b{kind} (\d+)", names)), default=0)
