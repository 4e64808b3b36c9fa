"""Pictures of the fit: strain, tension and pressure on the flat pieces, a page per piece or a sheet per garment."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from warpflat.core import FloatArray, IntArray, report_activity, weighted_percentile
from warpflat.flat import MAPS, RANGES, WornFit, border_edges, limit_words, pressure_words, remedy_words, strain_words
from warpflat.pattern.export.colours import on_cloth
from warpflat.pattern.export.figure import ColouredFaces, new_figure, write_figure
from warpflat.pattern.export.letters import all_letters, is_drawn, titles

if TYPE_CHECKING:
    from warpflat.flat import Flattening

__all__ = ["OnBody", "write_wear_picture", "write_wear_sheet"]

#: Of a piece on the wearer's body, by key of `_BODY_MAPS`: #F, not a number where it does not go around it.
OnBody = Mapping[str, FloatArray]


# The least range of a scale: below it a map would show rounding.
_LEAST_SCALE = {"%": 0.5, "degrees": 0.5, "N/m": 1.0, "Pa": 1.0}
# Strain around the wearer is below 0 where there is ease.
_BODY_MAPS = {
    "body_strain": ("on the wearer: strain, ease", 100.0, "%"),
    "body_pressure": ("on the wearer: pressure", 1.0, "Pa"),
}
_ALL_MAPS = {**MAPS, **_BODY_MAPS}
_NOT_AROUND = "#c8c8c8"
# A map whose values fill less of its scale is described in words.
_EVEN = 0.1
# Maps that are compared at a glance share a scale.
_ALIKE = (("strain_warp", "strain_weft"), ("shear",), ("tension_warp", "tension_weft"), ("pressure",))
_BEYOND = "#00a000"
_MMHG = 133.322  # [Pa]

# Of a garment's sheet: a piece's greatest width and height, the labels' width, and the margins [in].
_COLUMN, _TALLEST = 2.5, 4.2
_LABEL = 2.4
_TOP, _BOTTOM = 0.88, 0.9
_LETTERS = 36  # in a line of a label


@dataclass(frozen=True, kw_only=True)
class _Scale:
    """Colours from low to high, and whether both ends may be passed."""

    colours: str
    low: float
    high: float

    @property
    def extend(self) -> str:
        return "max" if self.low == 0.0 else "both"


def _values(fit: WornFit, body: OnBody, name: str) -> FloatArray:
    """Return a map of a piece in the unit shown, #F."""
    return np.asarray(_ALL_MAPS[name][1] * (body[name] if name in _BODY_MAPS else getattr(fit, name)))


def _limit(fit: WornFit, name: str) -> float:
    """Return the fabric's limit of a map as its attribute has it; 0 where there is none."""
    return {"strain_warp": fit.limit, "strain_weft": fit.limit, "shear": fit.shear_limit}.get(name) or 0.0


def _scales(
    fits: Sequence[WornFit], groups: Sequence[Sequence[str]], bodies: Sequence[OnBody] = ()
) -> dict[str, _Scale]:
    found = {}
    all_area = np.concatenate([fit.area for fit in fits])
    for group in groups:
        _, factor, unit = _ALL_MAPS[group[0]]
        shown = [
            _values(fit, body, name)
            for name in group
            for fit, body in zip(fits, bodies or [{}] * len(fits), strict=True)
        ]
        values, area = np.concatenate(shown), np.tile(all_area, len(group))
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
            scale = _Scale(colours="YlOrRd", low=start, high=max(high, least, start + 0.1 * least))
        else:
            # Cloth's own colour is rest; red pulls, blue is slack.
            reach = max(abs(low), abs(high), least, limit)
            scale = _Scale(colours="RdBu_r", low=-reach, high=reach)
        found.update(dict.fromkeys(group, scale))
    return found


@all_letters()
def write_wear_picture(path: str | os.PathLike[str], result: Flattening) -> None:
    """Draw strains, shear, tensions and pressure on the pattern in six maps; what lies beyond the fabric's limits is outlined.

    Args:
        path: the file, ``*.png``.
        result: a flattened piece.

    Raises:
        InputError: the file cannot be written.
    """
    report_activity(f"drawing {Path(path).name}")
    span = np.ptp(result.positions, axis=0)
    width = 3.4
    height = float(np.clip(width * span[1] / max(float(span[0]), 1e-9), 1.6, 6.5))
    figure = new_figure(3 * (width + 0.85), 2 * (height + 0.45) + 0.4, dpi=110)
    fit = result.fit
    scales, strokes = _scales([fit], [[name] for name in MAPS]), _Strokes.of(result)
    for axis, (name, (label, factor, unit)) in zip(figure.subplots(2, 3).ravel(), MAPS.items(), strict=True):
        drawn = _draw_map(axis, result.positions, result, strokes, name, scales[name], {})
        axis.update_datalim(result.positions)
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.autoscale_view()
        low, high = (factor * weighted_percentile(getattr(fit, name), fit.area, share) for share in (0.01, 0.99))
        if high - low < _EVEN * (scales[name].high - scales[name].low):
            # A scale would show one flat colour.
            axis.set_title(f"{label}, even: {_shown(low)} to {_shown(high)} {unit}", fontsize=10)
            continue
        median = factor * weighted_percentile(getattr(fit, name), fit.area, 0.5)
        axis.set_title(f"{label}, median {_shown(median)} {unit}", fontsize=10)
        bar = figure.colorbar(
            drawn, ax=axis, shrink=0.75, extend=scales[name].extend, pad=0.02, fraction=0.06, aspect=25
        )
        bar.set_label(unit, fontsize=9)
        bar.ax.tick_params(labelsize=8)
        _mark_limit(bar, factor * _limit(fit, name), scales[name])
    verdict = f"{100 * fit.held:.1f} % held beyond its limit, {100 * fit.slack:.1f} % in folds (outlined)"
    figure.suptitle(
        f"{result.surface.name} in {result.fabric.name}, as worn: {verdict}; limit {limit_words(fit.as_dict())}",
        fontsize=12,
    )
    figure.tight_layout(pad=0.5, h_pad=0.8, w_pad=0.8, rect=(0.0, 0.0, 1.0, 0.985))
    write_figure(path, figure)


@all_letters()
def write_wear_sheet(
    path: str | os.PathLike[str], results: Sequence[Flattening], *, title: str, on_body: Sequence[OnBody] = ()
) -> None:
    """Draw all pieces of a garment as worn: a row per piece, a column per map, one scale of length and of colour.

    Args:
        path: the file, ``*.png``.
        results: the pieces, one or more.
        title: the garment's name.
        on_body: of every piece, if it is worn on another surface than it was flattened from.

    Raises:
        InputError: the file cannot be written.
    """
    report_activity(f"drawing {Path(path).name}")
    maps = (*(_BODY_MAPS if on_body else ()), *MAPS)
    sheet = _Sheet.of(results, len(maps))
    figure = new_figure(*sheet.size, dpi=110)
    fits = [result.fit for result in results]
    bodies = on_body or [{}] * len(results)
    scales = _scales(fits, [*([name] for name in maps if name in _BODY_MAPS), *_ALIKE], bodies)
    limits = "; ".join(dict.fromkeys(limit_words(fit.as_dict()) for fit in fits))
    top = _TOP
    # One axis over the page, in inches: an axis for each map takes longer than all that is drawn in it.
    page = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, sheet.size[0]), ylim=(0.0, sheet.size[1]))
    page.set_axis_off()
    drawn: dict[str, ScalarMappable] = {}
    shown_names = titles([result.surface.name for result in results], is_drawn)
    for result, body, height in zip(results, bodies, sheet.rows, strict=True):
        # Label the row.
        fit = result.fit
        lines = [f"{100 * fit.held:.1f} % held beyond its limit, {100 * fit.slack:.1f} % in folds"]
        measures = fit.as_dict()
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
        x, y = sheet.point(0.15, top + 0.15)
        figure.text(x, y, shown_names[result.surface.name], fontsize=11, weight="bold", va="top")
        y -= 0.22 / float(figure.get_size_inches()[1])
        text = "\n".join(fill(line, _LETTERS, subsequent_indent="  ") for line in lines)
        figure.text(
            x, y, text, fontsize=9, va="top", linespacing=1.35, color="black" if fit.within_limits else "#b00000"
        )
        # Draw all maps of a piece side by side.
        drawn = {}
        middle = 0.5 * (result.positions.min(axis=0) + result.positions.max(axis=0))
        inches = (result.positions - middle) * sheet.inches
        strokes = _Strokes.of(result)
        for number, name in enumerate((*body, *MAPS)):
            centre = _LABEL + (number + 0.5) * sheet.column, sheet.size[1] - top - 0.5 * height
            drawn[name] = _draw_map(page, inches + centre, result, strokes, name, scales[name], body)
        top += height
    # Draw the title of every column, and below the rows its colour scale.
    for number, name in enumerate(drawn):
        label, factor, unit = _ALL_MAPS[name]
        x = _LABEL + number * sheet.column
        figure.text(*sheet.point(x + 0.5 * sheet.column, 0.75), label, ha="center", fontsize=10)
        axis = figure.add_axes(sheet.box(x + 0.2, top + 0.25, sheet.column - 0.4, 0.13))
        bar = figure.colorbar(drawn[name], cax=axis, orientation="horizontal", extend=scales[name].extend)
        bar.ax.tick_params(labelsize=8)
        bar.ax.locator_params(nbins=5)
        bar.set_label(unit, fontsize=9)
        _mark_limit(bar, factor * max(_limit(fit, name) for fit in fits), scales[name])
        if unit == "Pa":
            in_mmhg = (lambda pascals: pascals / _MMHG), (lambda mmhg: mmhg * _MMHG)
            above = bar.ax.secondary_xaxis("top", functions=in_mmhg)
            above.tick_params(labelsize=7)
            above.set_xlabel("mmHg", fontsize=8)
    fabrics = ", ".join(dict.fromkeys(result.fabric.name for result in results))
    figure.text(*sheet.point(0.15, 0.32), f"{title} in {fabrics}, as worn", fontsize=13)
    figure.text(
        *sheet.point(0.15, 0.52),
        f"outlined in green: beyond the cloth's limit of {limits}; red is stretched, blue is slack"
        + ("; grey goes not around the wearer; all other maps are against the form" if on_body else ""),
        fontsize=9,
        color="#404040",
    )
    write_figure(path, figure)


@dataclass(frozen=True, kw_only=True)
class _Sheet:
    """The layout of a garment's sheet [in].

    Attributes:
        inches: per metre of cloth.
        column: width of a column.
        rows: heights of the rows.
        columns: how many.
    """

    inches: float
    column: float
    rows: tuple[float, ...]
    columns: int

    @classmethod
    def of(cls, results: Sequence[Flattening], columns: int) -> _Sheet:
        """Lay out a sheet for these pieces with so many maps."""
        spans = np.array([np.ptp(result.positions, axis=0) for result in results])
        width, height = (max(float(spans[:, axis].max()), 1e-9) for axis in (0, 1))
        inches = min(_COLUMN / width, _TALLEST / height)
        rows = [
            max(float(span) * inches, 1.35 if result.fit.within_limits else 2.5) + 0.18
            for span, result in zip(spans[:, 1], results, strict=True)
        ]
        column = min(_COLUMN, max(float(spans[:, 0].max()) * inches, 1.5)) + 0.12
        return cls(inches=inches, column=column, rows=tuple(rows), columns=columns)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the sheet."""
        return _LABEL + self.columns * self.column + 0.2, _TOP + sum(self.rows) + _BOTTOM

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of the figure, given from its upper left corner, as shares of its size."""
        return x / self.size[0], 1.0 - y / self.size[1]

    def box(self, x: float, y: float, width: float, height: float) -> tuple[float, float, float, float]:
        """Return a box of the figure, given from its upper left corner, as shares of its size."""
        return (x / self.size[0], 1.0 - (y + height) / self.size[1], width / self.size[0], height / self.size[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Strokes:
    """The edges of a piece that its maps show: of its lines, its border, and what is beyond the cloth's limit; #E by 2 each."""

    lines: IntArray
    border: IntArray
    beyond: IntArray

    @classmethod
    def of(cls, result: Flattening) -> _Strokes:
        none, faces = np.empty((0, 2), dtype=np.int32), result.faces
        lines = [np.column_stack([line[:-1], line[1:]]) for line in result.network.surface.lines.values()]
        beyond = [border_edges(faces[misfit.faces]) for misfit in result.fit.misfits]
        return cls(
            lines=np.concatenate([none, *lines]), border=border_edges(faces), beyond=np.concatenate([none, *beyond])
        )


def _shown(value: float) -> str:
    if abs(value) < 0.05:
        return "0"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _draw_map(
    axis: Axes, places: FloatArray, result: Flattening, strokes: _Strokes, name: str, scale: _Scale, body: OnBody
) -> ScalarMappable:
    """Draw a map of a piece whose vertices come to lie at `places` (#P by 2) in the units of the axis."""
    colours = on_cloth(scale.colours).with_extremes(bad=_NOT_AROUND)
    mappable = ScalarMappable(Normalize(scale.low, scale.high), colours)
    axis.add_artist(ColouredFaces(places, result.faces, _values(result.fit, body, name), mappable))
    _draw_segments(axis, places[strokes.lines], "#808080", 0.4)
    _draw_segments(axis, places[strokes.border], "black", 0.9)
    if _limit(result.fit, name):
        _draw_segments(axis, places[strokes.beyond], _BEYOND, 0.7)
    return mappable


def _draw_segments(axis: Axes, segments: FloatArray, colour: str, width: float) -> None:
    """Draw straight segments (#S by 2 by 2) as one path: a path each takes longer to set up than all of them to draw."""
    if len(segments):
        path = Outline(segments.reshape(-1, 2), np.tile([Outline.MOVETO, Outline.LINETO], len(segments)))
        axis.add_artist(PathPatch(path, fill=False, edgecolor=colour, linewidth=width, zorder=2))


def _mark_limit(bar: Any, limit: float, scale: _Scale) -> None:
    """Mark the fabric's limit, in the scale's unit, on it; 0 is none."""
    for at in (-limit, limit):
        if at and scale.low < at < scale.high:
            draw = bar.ax.axvline if bar.orientation == "horizontal" else bar.ax.axhline
            draw(at, color=_BEYOND, linewidth=1.6)
