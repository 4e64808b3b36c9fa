"""How a garment sits, for people: what would help where it does not fit, the maps, and the lines on the console."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpflat.arrays import FloatArray, IntArray
from warpflat.errors import InputError
from warpflat.tightness import TOLERATED, Misfit, Wear, WornFit, assess_fit

if TYPE_CHECKING:
    from warpflat.flattening import Flattening

__all__ = [
    "RANGES",
    "Remedy",
    "advise",
    "fit_lines",
    "garment_wear",
    "help_words",
    "pressure_words",
    "remedies",
    "strain_words",
    "wear_measures",
]


#: What ranges of strain and pressure are told of.
RANGES = "5 to 95 % of the cloth [all of it]"

# A line that passes within this distance of the worst place can take the dart for it [m].
_NEARBY = 0.03
# The share that is beyond the limit settles long before the energy does.
_TRIAL_TOLERANCE = 20.0
_MOST_TRIALS = 8
# So many are told.
_TOLD = 3
# Nobody sews a dart shorter than this [m].
_LEAST_CUT = 0.025


@dataclass(frozen=True, kw_only=True, eq=False)
class Remedy:
    """A cut, sewn as a dart or a seam, that may relieve a misfit.

    Attributes:
        words: what to cut.
        path: vertices of the uncut surface.
        length: [m].
        outside: share of the cloth beyond the limit once it is made, by trial and unsewn; None if it was not tried.
    """

    words: str
    path: IntArray
    length: float
    outside: float | None = None


def wear_measures(
    fit: WornFit, *, wear: Wear | None = None, unsewn: WornFit | None = None, remedies: Sequence[Remedy] = ()
) -> dict[str, Any]:
    """Build the entry `wear` of a piece in `metrics.json`.

    Args:
        fit: how the piece sits.
        wear: how it is meant to be worn, if that was asked for.
        unsewn: how it sat before it was sewn, if it was.
        remedies: cuts that may help.
    """
    measures = {**(asdict(wear) if wear is not None else {}), **fit.as_dict()}
    if unsewn is not None:
        measures["outside_unsewn"] = unsewn.outside
    measures["would_help"] = [
        {"cut": remedy.words, "length_m": remedy.length, "outside_after": remedy.outside} for remedy in remedies
    ]
    return measures


def advise(result: Flattening) -> Flattening:
    """Look for cuts that would help where a piece does not fit, and return the piece with them in `remedies`.

    Where a way of wearing was asked for, up to eight cuts are made and relaxed on trial, and the best three are kept. Otherwise
    the three nearest are named and none is tried.
    """
    found = remedies(result, result.fit, trial=result.wear is not None)
    return replace(result, remedies=tuple(found)) if found else result


def remedies(result: Flattening, fit: WornFit, *, trial: bool = True) -> list[Remedy]:
    """Darts and seams for the worst places: along lines that pass by, and straight from the border.

    None for a piece that fits unsewn. Cuts of a sewn piece are tried on it as it lay before, and compared with that: what sewing adds
    or takes is not the cut's.

    Args:
        result: a flattened piece.
        fit: how it sits.
        trial: make each cut, relax, and keep those that help, best first; else all of them, nearest first.
    """
    alone = result.alone or result
    if fit.fits or alone.fit.fits:
        return []
    found = list(islice(_remedies_for(result, fit), _MOST_TRIALS if trial else _TOLD))
    if not trial:
        return found
    tried = [_tried(alone, remedy) for remedy in found]
    helpful = [r for r in tried if r.outside is not None and r.outside < 0.9 * alone.fit.outside]
    return sorted(helpful, key=lambda r: float(r.outside or 0.0))[:_TOLD]


def _remedies_for(result: Flattening, fit: WornFit) -> Iterator[Remedy]:
    """For the largest places, each once; made as they are asked for, since a path over a large mesh takes a while."""
    found: list[Remedy] = []
    for misfit in fit.misfits[:4]:
        for remedy in _candidates(result, misfit):
            known = any(np.array_equal(remedy.path, other.path) for other in found)
            if not known and remedy.length >= _LEAST_CUT:
                found.append(remedy)
                yield remedy


def _candidates(result: Flattening, misfit: Misfit) -> Iterator[Remedy]:
    from warpflat.surface import line_between
    from warpflat.surface.topology import border_of

    surface = result.surface
    worst = int(result.vertex_origin[misfit.vertex])
    border = border_of(surface)
    points = surface.vertices
    for name, line in surface.lines.items():
        row = np.asarray(line)
        if len(row) < 2 or np.isin(row, border).all():
            continue
        nearest = int(np.argmin(np.linalg.norm(points[row] - points[worst], axis=1)))
        if np.linalg.norm(points[row[nearest]] - points[worst]) > _NEARBY:
            continue
        dart = min(row[: nearest + 1], row[nearest:][::-1], key=len)
        if len(dart) > 2 and dart[0] in border and not np.isin(dart[1:], border).any():
            yield _remedy(result, dart, f"a dart along {name}")
        if row[0] in border and row[-1] in border and not np.isin(row[1:-1], border).any():
            yield _remedy(result, row, f"a seam along {name}")
    if worst in border:
        # At the border itself a short cut relieves nothing: it has to reach behind the region.
        inside = np.setdiff1d(result.vertex_origin[result.faces[misfit.faces].ravel()], border)
        if len(inside) == 0:
            return
        worst = int(inside[np.argmax(np.linalg.norm(points[inside] - points[worst], axis=1))])
    for start in _border_feet(points, border, worst):
        try:
            path = line_between(surface, int(start), worst)
        except InputError:
            continue
        # A shortest path may run along the border first.
        last = int(np.flatnonzero(np.isin(path, border))[-1])
        if len(path) - last > 1:
            yield _remedy(result, path[last:], "a dart from the border")


def _border_feet(points: FloatArray, border: IntArray, worst: int) -> list[int]:
    """The border's vertex nearest to the place, and the nearest in a direction at right angles to that or further off."""
    away = points[border] - points[worst]
    distance = np.linalg.norm(away, axis=1)
    first = int(np.argmin(distance))
    cosine = away @ away[first] / np.maximum(distance * distance[first], 1e-300)
    others = np.flatnonzero(cosine < 0.3)
    feet = [int(border[first])]
    if len(others):
        feet.append(int(border[others[np.argmin(distance[others])]]))
    return feet


def _remedy(result: Flattening, path: NDArray[np.integer], words: str) -> Remedy:
    points = result.surface.vertices[path]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    start, end = (f"({', '.join(f'{100 * x:.0f}' for x in point)})" for point in (points[0], points[-1]))
    return Remedy(
        words=f"{words}, {100 * length:.1f} cm, from {start} to {end} cm", path=path.astype(np.int32), length=length
    )


def _tried(result: Flattening, remedy: Remedy) -> Remedy:
    from warpflat.cutting import CutPlan, cut

    options = result.options
    quick = replace(
        options,
        energy_tolerance=min(_TRIAL_TOLERANCE * options.energy_tolerance, 1.0),
        residual_tolerance=_TRIAL_TOLERANCE * options.residual_tolerance,
        max_steps=min(options.max_steps, result.stages[-1].steps + 2000),
    )
    try:
        opened = cut(result, CutPlan(name="trial", paths=(remedy.path,)), relax=quick)
    except InputError:
        # The path meets a cut that was made before.
        return remedy
    return replace(remedy, outside=assess_fit(opened.network, opened.positions).outside)


def garment_wear(pieces: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """How a garment of several pieces sits, from their entries in `metrics.json`; `fits` if every piece does.

    Args:
        pieces: by name, with `wear` and `area_m2`.
    """
    worn = {name: piece["wear"] for name, piece in pieces.items()}
    area = {name: float(piece["area_m2"]) for name, piece in pieces.items()}
    unfit = {name: wear for name, wear in worn.items() if not wear["fits"]}
    return {
        "fits": not unfit,
        "outside": sum(wear["outside"] * area[name] for name, wear in worn.items()) / sum(area.values()),
        "where_not": [f"{name}: {words}" for name, wear in unfit.items() for words in wear["where_not"]],
        "would_help": [{"piece": name, **remedy} for name, wear in unfit.items() for remedy in wear["would_help"]],
    }


def help_words(remedy: Mapping[str, Any], outside: float | None = None, *, sewn: bool = False) -> str:
    """A remedy as in `metrics.json`, in words; with the share beyond the limit before it, if that is given. Of a piece that is `sewn`, both
    are told to be without that."""
    after = remedy["outside_after"]
    if after is None:
        return f"may help: {remedy['cut']}"
    before = "" if outside is None else f"{100 * outside:.1f} % -> "
    unsewn = ", unsewn" if sewn else ""
    return f"would help: {remedy['cut']}: {before}{100 * after:.1f} % beyond the limit{unsewn}"


def _no_cut_words(outside: float, *, sewn: bool) -> str:
    if sewn and outside <= TOLERATED:
        return "unsewn it fits: its seams, folds and constraints strain it; ask less of them, or take another fabric"
    return "would help: another fabric, or another stretch; no single dart does"


def strain_words(wear: Mapping[str, Any]) -> list[str]:
    """For warp and weft of an entry `wear`, as `RANGES` says: "weft -0.6 to +8.6 % [-2.7 to +20.3]"."""
    found = []
    for thread in ("warp", "weft"):
        low, least, most, high = (100 * wear[f"strain_{thread}"][at] for at in ("min", "p05", "p95", "max"))
        found.append(f"{thread} {least:+.1f} to {most:+.1f} % [{low:+.1f} to {high:+.1f}]")
    return found


def pressure_words(wear: Mapping[str, Any]) -> str:
    """The same of the pressure; nothing where the cloth does not press at all."""
    pressure = wear["pressure"]
    if pressure["max"] < 1.0:
        return ""
    return f"pressure {pressure['p05']:,.0f} to {pressure['p95']:,.0f} Pa [up to {pressure['max']:,.0f}]"


def fit_lines(metrics: Mapping[str, Any]) -> list[str]:
    """What the console says of each piece's fit: one line, and one for each place and remedy where it does not."""
    lines = []
    for name, piece in metrics["pieces"].items():
        wear = piece.get("wear")
        if wear is None:
            continue
        verdict = f"{name}: fits: {'yes' if wear['fits'] else 'no'}"
        told = f"{', '.join(strain_words(wear))}, limit {100 * wear['strain_limit']:.3g} %"
        if pressure := pressure_words(wear):
            told += f"; {pressure}, median {wear['pressure']['p50']:.0f}"
        lines.append(f"{verdict} ({told})")
        if wear["fits"]:
            continue
        lines += [f"  where not: {words}" for words in wear["where_not"]]
        sewn = "outside_unsewn" in wear
        before = wear["outside_unsewn"] if sewn else wear["outside"]
        lines += [f"  {help_words(remedy, before, sewn=sewn)}" for remedy in wear["would_help"]]
        if not wear["would_help"]:
            lines.append(f"  {_no_cut_words(before, sewn=sewn)}")
    if lines:
        lines.append(f"ranges: {RANGES}")
    if "wear" in metrics:
        unfit = [name for name, piece in metrics["pieces"].items() if not piece["wear"]["fits"]]
        verdict = f"no: {', '.join(unfit)}" if unfit else "yes"
        lines.append(
            f"garment: fits: {verdict} ({100 * metrics['wear']['outside']:.1f} % of its cloth beyond the limit)"
        )
    return lines
