"""Remedies: cuts that would help where a garment does not fit, or would lie over itself."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.flat.cutting.candidates import find_candidates
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.cutting.ledger import evaluate
from warpflat.flat.flattening.fit_report import Remedy
from warpflat.flat.flattening.keep_apart import costs_much
from warpflat.flat.flattening.progress import CONTACT
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.fit import WornFit
from warpflat.flat.solver.contact import Barrier
from warpflat.flat.solver.options import coarse_options
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.injective import border_edges_of

__all__ = ["advise", "contact_note", "cut_between_contacts", "remedies"]

# Cuts to so many places are priced, and so many are named.
_PLACES, _KEPT = 4, 3
# Nobody sews a dart shorter than this [m].
_LEAST_CUT = 0.025
# A cut helps that leaves no more than this share of what was beyond the limits.
_HELPS = 0.9
# How a note on a contact begins.
_CONTACT_COSTS = "contact costs more than"


def advise(result: Flattening) -> Flattening:
    """Look for cuts that would help where a piece does not fit, and return the piece with them in `remedies`.

    Of darts and seams to the worst places the three are named that promise to bring most cloth back within its limits. Where a way of
    wearing was asked for, each of them is made and relaxed on trial, and those that help are kept. A note names the cut that would spare
    the piece a contact that costs much.
    """
    costs = tuple(filter(None, [contact_note(result)]))
    notes = (*(note for note in result.notes if not note.startswith(_CONTACT_COSTS)), *costs)
    if notes != result.notes:
        result = replace(result, notes=notes, relaxation_notes=(*result.relaxation_notes, *costs))
    found = remedies(result, result.fit, trial=result.wear is not None)
    return result.with_remedies(found) if found or result.remedies else result


def remedies(result: Flattening, fit: WornFit, *, trial: bool = True) -> list[Remedy]:
    """Find the darts and seams to the worst places that promise most.

    A piece that fits unsewn gets none. Cuts of a sewn piece are tried on the unsewn piece and compared with it.

    Args:
        result: a flattened piece.
        fit: how it sits.
        trial: make each cut, relax, and keep those that help, best first; else as many as are named, by what they promise for their length.
    """
    unsewn = result.unsewn or result
    if fit.within_limits or unsewn.fit.within_limits:
        return []
    places = dict.fromkeys(int(result.vertex_origin[misfit.relieved_at]) for misfit in fit.held_regions[:_PLACES])
    found, helpful = list[Remedy](), list[Remedy]()
    with suppress(InputError):
        able = [
            one for one in find_candidates(unsewn, list(places)) if one.price.opens and one.price.length >= _LEAST_CUT
        ]
        for one in sorted(able, key=lambda one: -one.price.relieved / one.price.length):
            if one.table is None or len(found) == _KEPT:
                continue
            what = (
                f"a {'dart' if one.places else 'seam'} along {one.table['line']}"
                if "line" in one.table
                else "a dart from the border"
            )
            points = result.surface.vertices[one.paths[0]]
            start, end = (f"({', '.join(f'{100 * x:.0f}' for x in point)})" for point in points[[0, -1]])
            length = one.drawn[0].length if one.drawn else polyline_length(points)
            words = f"{what}, {100 * length:.1f} cm, from {start} to {end} cm"
            found.append(Remedy(words=words, path=one.paths[0], length=length, table=one.table))
            if not trial:
                continue
            # A path that meets a cut which was made before is refused.
            with suppress(InputError):
                outside = evaluate(unsewn, one, relax=coarse_options(unsewn.options)).outside_after
                if outside < _HELPS * unsewn.fit.outside:
                    helpful.append(replace(found[-1], outside=outside))
    return sorted(helpful, key=lambda tried: tried.outside or 0.0) if trial else found


def contact_note(result: Flattening) -> str | None:
    """Return a note on a contact that costs more than the share of the energy that is allowed, with the cut that would restore it.

    The cut is made on trial. None if contact costs less, or if the cut does not help.
    """
    last = result.stages[-1]
    if last.name != CONTACT or len(result.stages) < 2:
        return None
    if not costs_much(result.network, result.options, result.stages[-2].model_energy_j, last.model_energy_j):
        return None
    path = cut_between_contacts(result)
    piece = result.unsewn or result
    try:
        opened = (
            None
            if path is None
            else cut(piece, CutPlan(name="trial", paths=(path,)), relax=coarse_options(piece.options))
        )
    except InputError:
        opened = None  # The path meets a cut that was made before.
    price = f"{_CONTACT_COSTS} {100 * result.options.contact_share:.3g} % of the energy"
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
