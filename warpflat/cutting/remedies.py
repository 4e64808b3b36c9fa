"""Remedies: cuts that would help where a garment does not fit, each tried on its piece."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.cutting.contact_remedy import TRIAL_TOLERANCE, contact_note
from warpflat.cutting.cut_piece import cut
from warpflat.cutting.cut_plan import CutPlan
from warpflat.flattening.fit_report import Remedy
from warpflat.flattening.result import Flattening
from warpflat.model.fit import Misfit, WornFit, assess_fit
from warpflat.surface.connectivity import border_of
from warpflat.surface.paths.lines import line_between

__all__ = ["advise", "remedies"]

# A line that passes within this distance of the worst place can take the dart for it [m].
_NEARBY = 0.03


_MOST_TRIALS = 8


# So many remedies are kept.
_KEPT = 3


# Nobody sews a dart shorter than this [m].
_LEAST_CUT = 0.025


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
    if fit.fits or unsewn.fit.fits:
        return []
    found: list[Remedy] = []
    # One by one, since a path over a large mesh takes a while.
    paths = (remedy for misfit in fit.misfits[:4] for remedy in _candidates(result, misfit))
    while len(found) < (_MOST_TRIALS if trial else _KEPT) and (remedy := next(paths, None)) is not None:
        known = any(np.array_equal(remedy.path, other.path) for other in found)
        if not known and remedy.length >= _LEAST_CUT:
            found.append(remedy)
    if not trial:
        return found
    options = unsewn.options
    quick = replace(
        options,
        energy_tolerance=min(TRIAL_TOLERANCE * options.energy_tolerance, 1.0),
        residual_tolerance=TRIAL_TOLERANCE * options.residual_tolerance,
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
    """Yield darts and seams along the feature lines that pass near the worst place, then darts from the border to it."""
    border, points = border_of(result.surface), result.surface.vertices
    worst = int(result.vertex_origin[misfit.vertex])
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
