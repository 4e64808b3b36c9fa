"""The picture of the bodies of a batch: pattern measures over girths, and the ease that graded sizes leave."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from warpflat.app.batch.body_statistics import BODY_GIRTHS, MEASURES, BodyPattern, fit_trend
from warpflat.pattern import all_letters, new_figure, write_figure

__all__ = ["write_body_picture"]

_DPI = 130
_INK, _GREY, _GOOD, _BAD = "#1d1f24", "#8a8f98", "#1f6f5c", "#b3383c"
_WORDS = {"dart_intake": "dart intake", "side_seam": "side seam", "area": "area", "strain_energy": "strain energy"}


@all_letters()
def write_body_picture(path: str | os.PathLike[str], patterns: Sequence[BodyPattern]) -> None:
    """Draw each measure over bust, waist and hip, one colour a fabric; and below, the ease of made-to-measure and of the nearest size.

    Raises:
        InputError: the file cannot be written.
    """
    measures = [name for name in MEASURES if any(name in pattern.measures for pattern in patterns)]
    graded = [pattern for pattern in patterns if pattern.size]
    rows = len(measures) + bool(graded)
    figure = new_figure(11.0, 2.6 * rows + 0.4, dpi=_DPI, layout="constrained")
    axes = figure.subplots(rows, len(BODY_GIRTHS), squeeze=False)
    for place, name in zip(axes, measures, strict=False):
        for ax, level in zip(place, BODY_GIRTHS, strict=True):
            unit, one = MEASURES[name]
            kinds: dict[tuple[str, str], list[BodyPattern]] = {}
            for pattern in patterns:
                if name in pattern.measures:
                    kinds.setdefault((pattern.row.task.scene, pattern.row.task.fabric), []).append(pattern)
            several = len({scene for scene, _ in kinds}) > 1
            for number, ((scene, fabric), members) in enumerate(kinds.items()):
                x = np.array([pattern.girths[level] for pattern in members])
                y = np.array([pattern.measures[name] for pattern in members])
                colour = f"C{number % 10}"
                trend = fit_trend(x, y)
                label = f"{scene}, {fabric}" if several else fabric
                if trend is not None:
                    ends = np.array([x.min(), x.max()])
                    ax.plot(100 * ends, (trend.slope * ends + trend.offset) / one, color=colour, linewidth=1)
                    label += f": {trend.slope / one / 100:+.2g} {unit}/cm, R² {trend.determination:.2f}"
                ax.scatter(100 * x, y / one, s=14, color=colour, label=label)
            _finish(ax, level, f"{_WORDS[name]} [{unit.replace('cm2', 'cm²')}]")
    if graded:
        for ax, level in zip(axes[-1], BODY_GIRTHS, strict=True):
            members = [pattern for pattern in graded if level in pattern.graded_ease and level in pattern.ease]
            if not members:
                ax.set_visible(False)
                continue
            x = np.array([100 * pattern.girths[level] for pattern in members])
            made = [100 * p.ease[level] for p in members]
            ax.scatter(x, made, s=18, facecolors="none", edgecolors=_GREY, label="made to measure")
            for pays, colour, label in ((False, _GOOD, "nearest size"), (True, _BAD, "nearest size, fails")):
                chosen = [(at, p) for at, p in zip(x, members, strict=True) if p.pays == pays]
                if chosen:
                    eases = [100 * p.graded_ease[level] for _, p in chosen]
                    ax.scatter([at for at, _ in chosen], eases, s=14, color=colour, label=label)
            ax.axhline(0.0, color=_INK, linewidth=0.6)
            _finish(ax, level, f"ease at {level} [cm]")
    write_figure(path, figure)


def _finish(ax: Axes, level: str, words: str) -> None:
    ax.set(xlabel=f"{level} [cm]", ylabel=words)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    if ax.has_data():
        ax.legend(fontsize=6.5, frameon=False)
