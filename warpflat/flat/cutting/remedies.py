"""Remedies: cuts that would help where a garment does not fit, or would lie over itself, each tried on its piece."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.flattening.fit_report import Remedy
from warpflat.flat.flattening.progress import CONTACT
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.fit import Misfit, WornFit, assess_fit
from warpflat.flat.solver.contact import Barrier
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.injective import border_edges_of
from warpflat.flat.surface.paths.lines import line_between

__all__ = ["advise", "contact_note", "cut_between_contacts", "remedies"]

# A line that passes within this distance of the place can take the dart for it [m].
_NEARBY = 0.03
# So many cuts are tried, and so many kept.
_MOST_TRIALS, _KEPT = 8, 3
# Nobody sews a dart shorter than this [m].
_LEAST_CUT = 0.025
# Tolerances of a trial are looser by this factor: what it is asked for settles long before the energy.
_TRIAL_TOLERANCE = 20.0


def advise(result: Flattening) -> Flattening:
    """Look for cuts that would help where a piece does not fit, and return the piece with them in `remedies`.

    Where a way of wearing was asked for, up to eight cuts are made and relaxed on trial, and the best three are kept. Otherwise
    the three nearest are named and none is tried. A note names the cut that would spare the piece a contact that costs much.
    """
    note = contact_note(result)
    if note is not None:
        result = replace(result, notes=(*result.notes, note))
    found = remedies(result, result.fit, trial=result.wear is not None)
    return result.with_remedies(found) if found else result


def remedies(result: Flattening, fit: WornFit, *, trial: bool = True) -> list[Remedy]:
    """Find darts and seams for the worst places: along lines that pass by, and straight from the border.

    A piece that fits unsewn gets none. Cuts of a sewn piece are tried on the unsewn piece and compared with it.

    Args:
        result: a flattened piece.
        fit: how it sits.
        trial: make each cut, relax, and keep those that help, best first; else all of them, nearest first.
    """
    unsewn = result.unsewn or result
    if fit.within_limits or unsewn.fit.within_limits:
        return []
    found: list[Remedy] = []
    # One by one, since a path over a large mesh takes a while.
    paths = (remedy for misfit in fit.held_regions[:4] for remedy in _candidates(result, misfit))
    while len(found) < (_MOST_TRIALS if trial else _KEPT) and (remedy := next(paths, None)) is not None:
        known = any(np.array_equal(remedy.path, other.path) for other in found)
        if not known and remedy.length >= _LEAST_CUT:
            found.append(remedy)
    if not trial:
        return found
    options = unsewn.options
    quick = replace(
        options,
        energy_tolerance=min(_TRIAL_TOLERANCE * options.energy_tolerance, 1.0),
        residual_tolerance=_TRIAL_TOLERANCE * options.residual_tolerance,
        max_steps=min(options.max_steps, unsewn.stages[-1].steps + 2000),
        gap_mm=0.0,
    )
    helpful = []
    for remedy in found:
        # A path that meets a cut which was made before is refused.
        with suppress(InputError):
            opened = cut(unsewn, CutPlan(name="trial", paths=(remedy.path,)), relax=quick)
            outside = assess_fit(opened.network, opened.positions).outside
            if outside < 0.9 * unsewn.fit.outside:
                helpful.append((outside, replace(remedy, outside=outside)))
    return [remedy for _, remedy in sorted(helpful, key=lambda tried: tried[0])[:_KEPT]]


def _candidates(result: Flattening, misfit: Misfit) -> Iterator[Remedy]:
    """Yield darts and seams along the feature lines that pass near the place that relieves a misfit, then darts from the border to it."""
    border, points = border_of(result.surface), result.surface.vertices
    worst = int(result.vertex_origin[misfit.relieved_at])
    for name, line in result.surface.lines.items():
        row = np.asarray(line)
        if len(row) < 2 or np.isin(row, border).all():
            continue
        nearest = int(np.argmin(np.linalg.norm(points[row] - points[worst], axis=1)))
        if np.linalg.norm(points[row[nearest]] - points[worst]) > _NEARBY:
            continue
        dart = min(row[: nearest + 1], row[nearest:][::-1], key=len)
        if len(dart) > 2 and dart[0] in border and not np.isin(dart[1:], border).any():
            # The shares of the line's length between which it lies, from its mouth.
            share = polyline_length(points[dart]) / polyline_length(points[row])
            part = [0.0, round(share, 4)] if dart[0] == row[0] else [1.0, round(1.0 - share, 4)]
            yield _remedy(result, dart, f"a dart along {name}", {"line": name, "part": part})
        if row[0] in border and row[-1] in border and not np.isin(row[1:-1], border).any():
            yield _remedy(result, row, f"a seam along {name}", {"line": name})
    if worst in border:
        # A short cut at the border relieves nothing: it has to reach behind the region.
        inside = np.setdiff1d(result.vertex_origin[result.faces[misfit.faces].ravel()], border)
        if len(inside) == 0:
            return
        worst = int(inside[np.argmax(np.linalg.norm(points[inside] - points[worst], axis=1))])
    # From the nearest vertex of the border, and from the nearest in a direction more than 72 degrees from that.
    away = points[border] - points[worst]
    distance = np.linalg.norm(away, axis=1)
    first = int(np.argmin(distance))
    cosine = away @ away[first] / np.maximum(distance * distance[first], 1e-300)
    others = np.flatnonzero(cosine < 0.3)
    feet = [first, *([int(others[np.argmin(distance[others])])] if len(others) else [])]
    for foot in feet:
        try:
            path = line_between(result.surface, int(border[foot]), worst)
        except InputError:
            continue
        # A shortest path may run along the border first.
        last = int(np.flatnonzero(np.isin(path, border))[-1])
        if len(path) - last > 1:
            ends = ([round(x, 5) for x in points[path[at]].tolist()] for at in (last, -1))
            yield _remedy(result, path[last:], "a dart from the border", dict(zip(("from", "to"), ends, strict=True)))


def _remedy(result: Flattening, path: NDArray[np.integer], what: str, table: Mapping[str, Any]) -> Remedy:
    points = result.surface.vertices[path]
    length = polyline_length(points)
    start, end = (f"({', '.join(f'{100 * x:.0f}' for x in point)})" for point in (points[0], points[-1]))
    return Remedy(
        words=f"{what}, {100 * length:.1f} cm, from {start} to {end} cm",
        path=path.astype(np.int32),
        length=length,
        table=table,
    )


def contact_note(result: Flattening) -> str | None:
    """Return a note on a contact that costs more than the share of the energy that is allowed, with the cut that would restore it.

    The cut is made on trial. None if contact costs less, or if the cut does not help.
    """
    last = result.stages[-1]
    if last.name != CONTACT or len(result.stages) < 2:
        return None
    free = result.stages[-2].model_energy_j
    if result.contact_energy <= result.options.contact_share * free:
        return None
    path = cut_between_contacts(result)
    piece = result.unsewn or result
    options = piece.options
    quick = replace(
        options,
        energy_tolerance=min(_TRIAL_TOLERANCE * options.energy_tolerance, 1.0),
        residual_tolerance=_TRIAL_TOLERANCE * options.residual_tolerance,
        gap_mm=0.0,
    )
    try:
        opened = None if path is None else cut(piece, CutPlan(name="trial", paths=(path,)), relax=quick)
    except InputError:
        opened = None  # The path meets a cut that was made before.
    price = f"contact costs more than {100 * options.contact_share:.3g} % of the energy"
    if (
        path is None
        or opened is None
        or opened.overlap
        or opened.stages[-1].model_energy_j >= piece.stages[-1].model_energy_j
    ):
        return f"{price}; no single cut across the piece was found that would restore it"
    surface = result.surface
    first, end = (int(surface.input_index[vertex]) for vertex in (path[0], path[-1]))
    return (
        f"{price}; a cut of {100 * polyline_length(surface.vertices[path]):.1f} cm from vertex {first} to vertex {end} would restore it "
        f"({1e3 * opened.stages[-1].model_energy_j:.3g} instead of {1e3 * piece.stages[-1].model_energy_j:.3g} mJ, no overlap)"
    )


def cut_between_contacts(result: Flattening) -> IntArray | None:
    """Return a cut across a piece between the two places of its border that press on each other; None if none do.

    They part their border loop into two arcs. The cut is the shortest path along edges inside between the middle halves of both; where
    they lie on two loops, between these.

    Returns:
        Vertices of the uncut surface.
    """
    surface, positions = result.network.surface, result.positions
    edges = border_edges_of(surface)
    touch = Barrier(surface, 1e-3 * result.options.gap_mm, 1.0)(positions).vertices
    if len(touch) == 0:
        return None
    at = np.full(len(surface.vertices), -1)
    at[edges.tail] = np.arange(len(edges.tail))
    a, b = at[touch[:, 0]], at[touch[:, 1]]
    one_loop = edges.first[a] == edges.first[b]
    apart = np.abs(a - b)
    around = np.where(one_loop, np.minimum(apart, edges.count[a] - apart), np.iinfo(np.int32).max)
    low, high = sorted(int(end[around.argmax()]) for end in (a, b))
    loops = [np.arange(edges.first[end], edges.first[end] + edges.count[end]) for end in (low, high)]
    if edges.first[low] == edges.first[high]:
        turn = np.roll(loops[0], -(low - loops[0][0]))
        halves = []
        for arc in (edges.tail[turn[: high - low]], edges.tail[turn[high - low :]]):
            station = arc_lengths(surface.vertices[arc])
            middle = np.abs(station - 0.5 * station[-1]) <= 0.25 * station[-1]
            halves.append(arc[middle] if middle.any() else arc[len(arc) // 2 : len(arc) // 2 + 1])
    else:
        halves = [edges.tail[loop] for loop in loops]
    sources, targets = halves
    he = half_edges_of(surface)
    on_border = np.zeros(len(surface.vertices), dtype=bool)
    on_border[border_of(surface)] = True
    ends = np.zeros(len(surface.vertices), dtype=bool)
    ends[sources] = ends[targets] = True
    inside = he.edges[(~on_border | ends)[he.edges].all(axis=1) & ~on_border[he.edges].all(axis=1)]
    length = np.linalg.norm(surface.vertices[inside[:, 1]] - surface.vertices[inside[:, 0]], axis=1)
    graph = csr_array((length, inside.T), shape=(len(on_border), len(on_border)))
    far, before, _ = dijkstra(graph, directed=False, indices=sources, min_only=True, return_predecessors=True)
    end = int(targets[far[targets].argmin()])
    if not np.isfinite(far[end]):
        return None
    path = [end]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    # A path through an end of the same side would touch the border twice.
    row = np.array(path, dtype=np.int32)
    return None if on_border[row[1:-1]].any() else result.vertex_origin[row]
