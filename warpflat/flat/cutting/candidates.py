"""Candidates for a cut: along feature lines near the peaks of the energy, along free paths that follow it, and inwards from the border.

A candidate runs from the border to a peak, from border to border, or, where the peak is at the border, from there inwards.
Peaks that mirror each other (two busts) make pairs: a pattern maker cuts both or none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import points_at_lengths
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.surface.curvature import curvature_tensors
from warpflat.flat.surface.energy_map import EnergyMap, energy_map, energy_peak, smooth_to_vertices
from warpflat.flat.surface.half_edges import border_edges, edge_faces
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import EdgeGraph, path_length
from warpflat.flat.surface.paths.geodesic import distance_from
from warpflat.flat.surface.paths.trace import SurfacePath, polyline_path

__all__ = ["Candidate", "Peaks", "find_candidates", "find_peaks"]


# Lengths are shares of the piece's diagonal.
_SMOOTHING = 0.02
_APART = 0.15
_REACH = 0.12
_SHORTEST = 0.04
_STRAY = 0.01
# A peak counts from this share of the highest peak's density.
_NEARLY_AS_HIGH = 0.7
_MOST_PEAKS = 4
# Two cuts whose lengths agree to this share mirror each other.
_ALIKE = 0.03
# A cut from a peak at the border ends after such shares of the way inwards.
_INWARDS = {"inward": 0.8, "short inward": 0.4}
# A piece whose edges are all within this share of their lengths is flat but for rounding.
_FREE_OF_STRAIN = 1e-6
# A free path costs this many times more where there is no energy than at the peak.
_COST_RATIO = 20.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A cut that could be made.

    Attributes:
        name: what it is called.
        paths: vertices of the uncut surface along its edges, from the border inwards; empty if the path must be worked
            into the mesh first.
        drawn: paths that need not follow edges.
        peaks: the numbers of the peaks at which it ends.
        has_twin: whether another one mirrors it, so that both are also a pair.
    """

    name: str
    paths: tuple[IntArray, ...] = ()
    drawn: tuple[SurfacePath, ...] = ()
    peaks: tuple[int, ...] = ()
    has_twin: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Peaks:
    """Maxima of the energy density inside a piece, away from its border.

    Attributes:
        map: of the uncut surface, see `warpflat.flat.surface.energy_map`.
        vertices: of the uncut surface, highest first.
        words: the place of each.
    """

    map: EnergyMap
    vertices: tuple[int, ...]
    words: tuple[str, ...] = field(default=())


def find_peaks(result: Flattening, *, landmarks: Mapping[str, int] | None = None) -> Peaks:
    """Find the highest points of the smoothed energy density inside a piece.

    Args:
        result: the flattened piece.
        landmarks: named vertices of its surface, for the words.
    """
    surface = result.surface
    size = _diagonal(surface)
    # On the cut surface energy does not spread across a crack; copies of a vertex are then put together again.
    apart = energy_map(result.network.surface, result.face_energy_density, smoothing_length=_SMOOTHING * size)
    density = np.zeros(len(surface.vertices))
    np.maximum.at(density, result.vertex_origin, apart.vertex_density)
    on_border = _border(result)
    chosen = _highest(surface, np.where(on_border, -1.0, density), apart=_APART * size)
    whole = energy_map(
        surface, result.face_energy_density, smoothing_length=_SMOOTHING * size, landmarks=dict(landmarks or {})
    )
    spikes = np.zeros((len(chosen), len(surface.vertices)))
    spikes[np.arange(len(chosen)), chosen] = 1.0
    words = tuple(energy_peak(surface, spike, landmarks=dict(landmarks or {})).words for spike in spikes)
    return Peaks(map=whole, vertices=tuple(chosen), words=words)


def find_candidates(result: Flattening, peaks: Peaks | None = None) -> tuple[Candidate, ...]:
    """Find cuts worth comparing on a flattened piece, cut before or not.

    Each feature line that passes near a peak, from each of its ends on the border to that peak and as a whole; one free
    path per peak from there to the border; from the border near a peak two ways inwards; and the pairs of those that mirror each other.

    Raises:
        InputError: the piece stores no energy away from its border, so there is nowhere to cut to.
    """
    peaks = peaks or find_peaks(result)
    if not peaks.vertices or result.layout_measures["length_error"] < _FREE_OF_STRAIN:
        raise InputError(f"piece {result.surface.name!r} stores no strain energy inside: there is nothing to cut for")
    found: list[Candidate] = []
    for name, line in result.surface.lines.items():
        found += _along_line(result, name, np.asarray(line, dtype=np.int32), peaks)
    for number in range(len(peaks.vertices)):
        free = _free_path(result, number, peaks)
        found += [] if free is None else [free]
        if free is None or _cut_length(result.surface, free) < _REACH * _diagonal(result.surface):
            found += _cuts_inwards(result, number, peaks)
    seen: set[tuple[int, ...]] = set()
    names: dict[str, int] = {}
    singles = []
    for one in found:
        key = tuple(sorted(v for path in one.paths for v in path.tolist()))
        if key and key in seen:
            continue
        seen.add(key)
        names[one.name] = names.get(one.name, 0) + 1
        if names[one.name] > 1:
            one = Candidate(name=f"{one.name} ({names[one.name]})", paths=one.paths, drawn=one.drawn, peaks=one.peaks)
        singles.append(one)
    # Pairs of cuts of one length that lead to two peaks and share no vertex, each pair as one cut, with both names.
    pairs = []
    for a, b in combinations(singles, 2):
        if not (a.peaks and b.peaks) or set(a.peaks) & set(b.peaks) or bool(a.drawn) != bool(b.drawn):
            continue
        lengths = _cut_length(result.surface, a), _cut_length(result.surface, b)
        shared = {int(v) for path in a.paths for v in path} & {int(v) for path in b.paths for v in path}
        if shared or abs(lengths[0] - lengths[1]) > _ALIKE * max(lengths):
            continue
        # Two cuts that mirror each other have ends at equal distances across.
        (begin, tip), (other_begin, other_tip) = (
            result.surface.vertices[one.paths[0][[0, -1]]] if one.paths else one.drawn[0].points[[0, -1]]
            for one in (a, b)
        )
        across = np.linalg.norm(begin - other_tip) - np.linalg.norm(tip - other_begin)
        if abs(across) > _ALIKE * _diagonal(result.surface):
            continue
        along = a.name.rpartition(" from ")[0]
        same = along and b.name.startswith(f"{along} from ")
        both = Candidate(
            name=f"{a.name} and {b.name.removeprefix(along + ' from ')}" if same else f"{a.name} + {b.name}",
            paths=a.paths + b.paths,
            drawn=a.drawn + b.drawn,
            peaks=tuple(sorted({*a.peaks, *b.peaks})),
        )
        pairs.append((both, (a.name, b.name)))
    twins = {name for pair in pairs for name in pair[1]}
    return (*(pair for pair, _ in pairs), *(replace(one, has_twin=one.name in twins) for one in singles))


def _diagonal(surface: Surface) -> float:
    return float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))


def _border(result: Flattening) -> BoolArray:
    """Return for each vertex of the uncut surface (#V) whether it is on the border or on a crack; the tip of a dart is on neither."""
    edges = border_edges(result.faces)
    flags = np.zeros(len(result.surface.vertices), dtype=bool)
    flags[result.vertex_origin[edges.ravel()]] = True
    return flags


def _along_line(result: Flattening, name: str, line: IntArray, peaks: Peaks) -> list[Candidate]:
    """Return the parts of an uncut line from the border to the peaks near it, and the whole line."""
    surface, size = result.surface, _diagonal(result.surface)
    on_border = _border(result)
    rim = {int(v) for v in border_edges(surface.faces).ravel()}
    if line[0] == line[-1] or np.count_nonzero(on_border[line[1:-1]]) > 0.5 * (len(line) - 2):
        return []
    points = surface.vertices[line]
    found: list[Candidate] = []
    passes_peak = False
    for number, peak in enumerate(peaks.vertices):
        distance = np.linalg.norm(points - surface.vertices[peak], axis=1)
        station = int(np.argmin(distance))
        if distance[station] > _REACH * size or on_border[line[station]]:
            continue
        passes_peak = True
        for part, end in ((line[: station + 1], "its start"), (line[station:][::-1], "its end")):
            # The cut begins at the vertex of a border or a crack that is nearest to the peak.
            outwards = np.flatnonzero(on_border[part[::-1]])
            if not len(outwards):
                continue
            path = part[len(part) - 1 - int(outwards[0]) :]
            if path_length(surface, [path]) <= _SHORTEST * size or not _is_free(result, path):
                continue
            others = [other for k, other in enumerate(peaks.vertices) if k != number]
            if any(_distance(surface, path, other) < _REACH * size for other in others):
                # It would run through another peak to this one; the part up to that is a candidate of its own.
                continue
            # It is named after the border line that it begins on.
            begins = (
                border
                for border, row in surface.lines.items()
                if border != name and path[0] in row and all(int(v) in rim for v in row)
            )
            found.append(Candidate(name=f"{name} from {next(begins, end)}", paths=(path,), peaks=(number,)))
    crosses = on_border[line[[0, -1]]].all() and not on_border[line[1:-1]].any()
    if passes_peak and crosses and _is_free(result, line):
        found.append(Candidate(name=f"{name}, whole", paths=(line,)))
    return found


def _distance(surface: Surface, path: IntArray, vertex: int) -> float:
    return float(np.linalg.norm(surface.vertices[path] - surface.vertices[vertex], axis=1).min())


def _is_free(result: Flattening, path: IntArray) -> bool:
    """Return whether a path has cloth on both sides and touches earlier cuts at its ends only."""
    taken = {int(v) for made in result.cuts for other in made.paths for v in other}
    edges, beside = edge_faces(result.surface.faces)
    inside = {(int(a), int(b)) for (a, b), faces in zip(edges, beside, strict=True) if faces[1] >= 0}
    steps = {(min(a, b), max(a, b)) for a, b in pairwise(path.tolist())}
    return steps <= inside and not taken & set(path[1:-1].tolist())


def _free_path(result: Flattening, number: int, peaks: Peaks) -> Candidate | None:
    """Return the path from the border to a peak that follows the energy (Wang, Smith and Yuen 2002); None if there is none.

    A stretch of edge costs its length, less where much energy lies along it. On triangles, whose edges lead nowhere in
    particular, the path is then drawn as straight as the surface allows.
    """
    from scipy.sparse.csgraph import dijkstra

    cut_surface = result.network.surface
    peak = peaks.vertices[number]
    graph = EdgeGraph(cut_surface)
    density = peaks.map.vertex_density[result.vertex_origin]
    along = density[graph.edges].mean(axis=1) / max(float(density.max()), np.finfo(float).tiny)
    matrix = graph.matrix(graph.length / (1.0 / _COST_RATIO + (1.0 - 1.0 / _COST_RATIO) * along))
    cost, before = dijkstra(matrix, indices=peak, return_predecessors=True)
    rim = np.unique(border_edges(cut_surface.faces))
    goal = int(rim[np.argmin(cost[rim])])
    if not np.isfinite(cost[goal]):
        return None
    chain = [goal]
    while chain[-1] != peak:
        chain.append(int(before[chain[-1]]))
    path = result.vertex_origin[np.array(chain)]
    # Everything before the last vertex of the border would run along it.
    last = int(np.flatnonzero(np.isin(chain, rim)).max())
    path = path[last:]
    surface = result.surface
    if len(path) < 2 or path_length(surface, [path]) < _SHORTEST * _diagonal(surface) or not _is_free(result, path):
        return None
    name = f"free path {_last_number(result, 'free path') + number + 1}"
    if surface.is_quad.all():
        return Candidate(name=name, paths=(path,), peaks=(number,))
    stops = _corners(surface.vertices[path], _STRAY * _diagonal(surface))
    try:
        drawn = polyline_path(surface, [int(path[k]) for k in stops])
    except InputError:
        return Candidate(name=name, paths=(path,), peaks=(number,))
    return Candidate(name=name, drawn=(drawn,), peaks=(number,))


def _cuts_inwards(result: Flattening, number: int, peaks: Peaks) -> list[Candidate]:
    """Return straight cuts from the border near a peak towards the curved part of the piece.

    The cloth along a border is too long or too short because of the curvature behind it; that is what a cut has to reach.
    """
    surface, size = result.surface, _diagonal(result.surface)
    outside = np.unique(border_edges(surface.faces))
    start = int(
        outside[np.argmin(np.linalg.norm(surface.vertices[outside] - surface.vertices[peaks.vertices[number]], axis=1))]
    )
    made = [path for one in result.cuts for path in one.paths]
    if any(_distance(surface, path, start) < _REACH * size for path in made):
        # It would leave a strip between itself and that cut.
        return []
    # The curved part: where the Gaussian curvature times the distance to the border peaks.
    tensor = curvature_tensors(surface)
    trace = np.trace(tensor, axis1=1, axis2=2)
    gauss = np.abs(0.5 * (trace**2 - np.einsum("vij,vji->v", tensor, tensor)))
    used = surface.faces >= 0
    of_faces = np.where(used, gauss[surface.faces], 0.0).sum(axis=1) / used.sum(axis=1)
    value = smooth_to_vertices(surface, of_faces, smoothing_length=2 * _SMOOTHING * size) * distance_from(
        surface, outside
    )
    # Only what is higher than its neighbours, not what lies high on the flank of a peak.
    a, b = EdgeGraph(surface).edges.T
    is_peak = np.ones(len(value), dtype=bool)
    is_peak[a[value[a] < value[b]]] = is_peak[b[value[b] < value[a]]] = False
    curved = _highest(surface, np.where(is_peak, value, 0.0), apart=_APART * size)
    if not curved:
        return []
    nearest = np.argmin(np.linalg.norm(surface.vertices[curved] - surface.vertices[start], axis=1))
    found = []
    for kind, share in _INWARDS.items():
        try:
            whole = polyline_path(surface, [start, curved[nearest]])
            point = points_at_lengths(whole.points, share * whole.length)
            tip = int(np.argmin(np.linalg.norm(surface.vertices - point, axis=1)))
            drawn = polyline_path(surface, [start, tip])
        except InputError:
            continue
        if drawn.length > _SHORTEST * size:
            name = f"{kind} {_last_number(result, 'inward') + number + 1}"
            found.append(Candidate(name=name, drawn=(drawn,), peaks=(number,)))
    return found


def _highest(surface: Surface, height: FloatArray, *, apart: float) -> list[int]:
    """Return the vertices where a positive value peaks, highest first.

    Args:
        surface: with #V vertices.
        height: #V, the value.
        apart: least distance between two of them [m].
    """
    chosen: list[int] = []
    for vertex in np.argsort(-height, kind="stable").tolist():
        if height[vertex] <= 0 or (chosen and height[vertex] < _NEARLY_AS_HIGH * height[chosen[0]]):
            break
        gap = [float(np.linalg.norm(surface.vertices[vertex] - surface.vertices[other])) for other in chosen]
        if len(chosen) < _MOST_PEAKS and min(gap, default=np.inf) > apart:
            chosen.append(vertex)
    return chosen


def _last_number(result: Flattening, kind: str) -> int:
    """Return the highest number in the names of lines and cuts of a kind; 0 if there is none."""
    names = " ".join([*result.surface.lines, *(made.name for made in result.cuts)])
    return max((int(found) for found in re.findall(rf"\b{kind} (\d+)", names)), default=0)


def _corners(points: FloatArray, stray: float) -> list[int]:
    """Return the points of a polyline that a simpler one needs to stay within a distance of it (Ramer 1972)."""
    kept = {0, len(points) - 1}
    open_parts = [(0, len(points) - 1)]
    while open_parts:
        a, b = open_parts.pop()
        if b - a < 2:
            continue
        chord = points[b] - points[a]
        length = max(float(np.linalg.norm(chord)), np.finfo(float).tiny)
        off = np.linalg.norm(np.cross(points[a + 1 : b] - points[a], chord / length), axis=1)
        if off.max() > stray:
            middle = a + 1 + int(np.argmax(off))
            kept.add(middle)
            open_parts += [(a, middle), (middle, b)]
    return sorted(kept)


def _cut_length(surface: Surface, one: Candidate) -> float:
    return path_length(surface, one.paths) + sum(path.length for path in one.drawn)
