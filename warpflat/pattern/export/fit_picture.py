"""The picture of the fit: strain, tension and pressure on the flat pieces."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, weighted_percentile
from warpflat.flat import MAPS, WornFit, border_edges, remedy_words
from warpflat.pattern.export.colours import LEAST_PRESSURE, Scale
from warpflat.pattern.export.figure import drawn_page
from warpflat.pattern.export.letters import is_drawn, titles
from warpflat.pattern.export.views import DrawnView, Facets, View
from warpflat.pattern.export.wear_words import RANGES, limit_words, pressure_words, strain_words

if TYPE_CHECKING:
    from warpflat.flat import Flattening

__all__ = ["OnBody", "write_wear_sheet"]

#: Of a piece on the wearer's body, by key of `_BODY_MAPS`: #F, not a number where it does not go around it.
OnBody = Mapping[str, FloatArray]


# The least range of a scale: below it a map would show rounding.
_LEAST_SCALE = {"%": 0.5, "degrees": 0.5, "N/m": 1.0, "Pa": LEAST_PRESSURE}
# Strain around the wearer is below 0 where there is ease.
_BODY_MAPS = {
    "body_strain": ("on the wearer: strain, ease", 100.0, "%"),
    "body_pressure": ("on the wearer: pressure", 1.0, "Pa"),
}
_ALL_MAPS = {**MAPS, **_BODY_MAPS}
# Maps that are compared at a glance share a scale.
_ALIKE = (("strain_warp", "strain_weft"), ("shear",), ("tension_warp", "tension_weft"), ("pressure",))
_BEYOND = "#00a000"
_MMHG = 133.322  # [Pa]

# A piece's greatest width and height, of several or alone, the labels' width, and the margins [in].
_LARGEST, _LARGEST_ALONE = (2.5, 4.2), (3.2, 6.5)
_LABEL = 2.4
_TOP, _BOTTOM = 0.88, 1.2
_LETTERS = 36  # in a line of a label


def write_wear_sheet(
    path: str | os.PathLike[str], results: Sequence[Flattening], *, title: str, on_body: Sequence[OnBody] = ()
) -> None:
    """Draw pieces as worn: a row per piece, a column per map, one scale of length and of colour.

    What lies beyond the fabric's limits is outlined.

    Args:
        path: the file, ``*.png``.
        results: the pieces, one or more.
        title: the garment's name.
        on_body: of every piece, if it is worn on another surface than it was flattened from.

    Raises:
        InputError: the file cannot be written.
    """
    fits, bodies = [result.fit for result in results], on_body or [{}] * len(results)
    groups = [*([name] for name in _BODY_MAPS if on_body), *_ALIKE]
    scales = {name: _scale(fits, bodies, group) for group in groups for name in group}
    # One scale of length for all: no piece is larger than this [in].
    most = _LARGEST if len(results) > 1 else _LARGEST_ALONE
    spans = np.array([np.ptp(result.positions, axis=0) for result in results])
    inches = float((most / np.maximum(spans.max(axis=0), 1e-9)).min())
    rows = [
        max(float(span) * inches, 1.35 if fit.within_limits else 2.5) + 0.18
        for span, fit in zip(spans[:, 1], fits, strict=True)
    ]
    column = min(most[0], max(float(spans[:, 0].max()) * inches, 1.5)) + 0.12
    limits = "; ".join(dict.fromkeys(limit_words(fit.as_dict()) for fit in fits))
    names = titles([result.surface.name for result in results], is_drawn)
    # The maps of a piece that is alone stand in two rows.
    columns = len(scales) if len(results) > 1 else -(-len(scales) // 2)
    blocks = [list(scales.items())[start : start + columns] for start in range(0, len(scales), columns)]
    height = _TOP + len(blocks) * (sum(rows) + _BOTTOM)
    with drawn_page(path, _LABEL + columns * column + 0.2, height, dpi=110) as pen:
        top = height - _TOP
        for block, maps in enumerate(blocks):
            for number, (key, _) in enumerate(maps):
                x = _LABEL + (number + 0.5) * column
                pen.write(x, top + 0.13, _ALL_MAPS[key][0], 10, ha="center", va="baseline")
            for result, body, tall in zip(results, bodies, rows, strict=True):
                if block == 0:
                    pen.write(0.15, top - 0.15, names[result.surface.name], 11, fontweight="bold", va="top")
                    words = "\n".join(fill(line, _LETTERS, subsequent_indent="  ") for line in _words(result))
                    colour = "black" if result.fit.within_limits else "#b00000"
                    pen.write(0.15, top - 0.37, words, 9, va="top", linespacing=1.35, color=colour)
                lines = [np.column_stack([line[:-1], line[1:]]) for line in result.network.surface.lines.values()]
                beyond = [border_edges(result.faces[misfit.faces]) for misfit in result.fit.misfits]
                view = View.of_pattern(result.positions, Facets.of(result.faces, border_edges(result.faces)), {})
                drawn = DrawnView(pen, view, left=0.0, bottom=0.0, inches_per_metre=inches)
                wide, high = (inches * view.size[:2]).tolist()
                for number, (key, scale) in enumerate(maps):
                    drawn.move_to(_LABEL + (number + 0.5) * column - 0.5 * wide, top - 0.5 * (tall + high))
                    drawn.draw(scale.rgb(_values(result.fit, body, key)), outline=0.9)
                    for edges in lines:
                        drawn.draw_segments(edges, colour="#808080", width=0.4, zorder=2)
                    for edges in beyond if _limit(result.fit, key) else ():
                        drawn.draw_segments(edges, colour=_BEYOND, width=0.7, zorder=4.5)
                top -= tall
            # The scales of colour stand below the rows.
            for number, (key, scale) in enumerate(maps):
                _, factor, unit = _ALL_MAPS[key]
                left = _LABEL + number * column + 0.2
                bar = pen.colour_bar(scale, left, top - 0.38, column - 0.4, 0.13, unit=unit)
                bar.ax.locator_params(nbins=5)
                limit = factor * max(_limit(fit, key) for fit in fits)
                for at in (-limit, limit):
                    if at and scale.low < at < scale.high:
                        bar.ax.axvline(at, color=_BEYOND, linewidth=1.6)
                if unit == "Pa":
                    in_mmhg = (lambda pascals: pascals / _MMHG), (lambda mmhg: mmhg * _MMHG)
                    above = bar.ax.secondary_xaxis("top", functions=in_mmhg)
                    above.tick_params(labelsize=7)
                    above.set_xlabel("mmHg", fontsize=8)
            top -= _BOTTOM
        fabrics = ", ".join(dict.fromkeys(result.fabric.name for result in results))
        pen.write(0.15, height - 0.25, f"{title} in {fabrics}, as worn", 13)
        words = f"outlined in green: beyond the cloth's limit of {limits}; red is stretched, blue is slack"
        words += "; grey goes not around the wearer; all other maps are against the form" if on_body else ""
        pen.write(0.15, height - 0.48, words, 9, color="#404040")


def _values(fit: WornFit, body: OnBody, name: str) -> FloatArray:
    """Return a map of a piece in the unit shown, #F."""
    return np.asarray(_ALL_MAPS[name][1] * (body[name] if name in _BODY_MAPS else getattr(fit, name)))


def _limit(fit: WornFit, name: str) -> float:
    """Return the fabric's limit of a map as its attribute has it; 0 where there is none."""
    return {"strain_warp": fit.limit, "strain_weft": fit.limit, "shear": fit.shear_limit}.get(name) or 0.0


def _scale(fits: Sequence[WornFit], bodies: Sequence[OnBody], group: Sequence[str]) -> Scale:
    """Return the scale that a group of maps shares over all pieces."""
    _, factor, unit = _ALL_MAPS[group[0]]
    values = np.concatenate(
        [_values(fit, body, name) for name in group for fit, body in zip(fits, bodies, strict=True)]
    )
    area = np.tile(np.concatenate([fit.area for fit in fits]), len(group))
    values, area = values[np.isfinite(values)], area[np.isfinite(values)]
    limit = 1.2 * factor * max(_limit(fit, group[0]) for fit in fits)
    if limit > 3.0 * float(np.abs(values).max(initial=0.0)):
        limit = 0.0
    low, high = (weighted_percentile(values, area, share) for share in (0.01, 0.99))
    least = _LEAST_SCALE[unit]
    if group[0].endswith("pressure") or (low > 0.3 * high and high > least):
        # All of it pulls: from the least to the most, or from nothing where that is near.
        # Not so narrow that what is as good as even looks uneven.
        start = 0.0 if low < 0.3 * high else min(low, 0.8 * high)
        return Scale(colours="YlOrRd", low=start, high=max(high, least, start + 0.1 * least))
    # Cloth's own colour is rest; red pulls, blue is slack.
    reach = max(abs(low), abs(high), least, limit)
    return Scale(colours="RdBu_r", low=-reach, high=reach)


def _words(result: Flattening) -> list[str]:
    """Return what stands beside the maps of a piece, in lines."""
    fit, measures = result.fit, result.fit.as_dict()
    lines = [f"{100 * fit.held:.1f} % held beyond its limit, {100 * fit.slack:.1f} % in folds"]
    lines += [f"{RANGES}:", *strain_words(measures)]
    if pressure := pressure_words(measures):
        p05, p95, most = (measures["pressure"][at] / _MMHG for at in ("p05", "p95", "max"))
        lines += [pressure, f"= {p05:.1f} to {p95:.1f} mmHg [up to {most:.1f}]"]
    if result.grain_angle:
        lines.append(f"warp turned by {result.grain_angle:g} degrees")
    if not fit.within_limits:
        lines.append("")
        lines += [f"worst: {misfit.words.split(';')[0]}" for misfit in fit.misfits[:1]]
        lines += [remedy_words(remedy.as_dict(), sewn=result.unsewn is not None) for remedy in result.remedies[:1]]
    return lines
