"""`corrected.png`: the outlines of the pieces before and after the correction of a pattern."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from warpflat.core import FloatArray, report_activity
from warpflat.garment.draping.correct_pattern import Correction
from warpflat.pattern import all_letters, new_figure, outline_edges, write_figure

__all__ = ["write_correction_picture"]

# Room between pieces [m], inches per metre, the largest page [in], and colours before and after.
_GAP, _SCALE, _LARGEST, _BEFORE, _AFTER = 0.06, 8.0, 60.0, "#8a8a8a", "#c8452c"
# Changes of the outline that are written beside it: the largest ones of a piece, so far apart [m].
_LABELS, _APART, _LEAST = 6, 0.08, 1e-3


@all_letters()
def write_correction_picture(path: str | os.PathLike[str], correction: Correction) -> None:
    """Draw the outlines before in grey and after in red, with the largest changes in millimetres; positive is outwards.

    Raises:
        InputError: the file cannot be written.
    """
    report_activity(f"drawing {Path(path).name}")
    old, new, moved = correction.before.cloth, correction.after.cloth, correction.moved()
    edges = outline_edges(old.flat_faces)
    shift, x = np.zeros_like(old.flat), 0.0
    for rows in old.piece_vertices.values():
        low, high = old.flat[rows].min(axis=0), old.flat[rows].max(axis=0)
        shift[rows] = [x - low[0], -low[1]]
        x += float(high[0] - low[0]) + _GAP
    tall = float((old.flat + shift)[:, 1].max())
    scale = min(_SCALE, _LARGEST / max(x, tall))
    size = (max(scale * x, 6.0), scale * tall + 1.0)
    figure = new_figure(*size, dpi=110)
    axis = figure.add_axes((0.01, 0.01, 0.98, 0.9 * (1.0 - 0.4 / size[1])))
    axis.set_axis_off()
    for points, colour, width in ((old.flat + shift, _BEFORE, 1.4), (new.flat + shift, _AFTER, 1.1)):
        # One line, broken after every edge.
        ends = np.full((len(edges), 3, 2), np.nan)
        ends[:, :2] = points[edges]
        axis.plot(*ends.reshape(-1, 2).T, color=colour, linewidth=width)
    for name, rows in old.piece_vertices.items():
        points = old.flat[rows] + shift[rows]
        across, up = points.mean(axis=0).tolist()
        axis.text(across, up, name, ha="center", fontsize=10)
        # The largest changes stand beside the outline, not too near to each other.
        change, taken = moved[name], list[FloatArray]()
        for i in np.argsort(-np.abs(change), kind="stable").tolist():
            if len(taken) == _LABELS or abs(change[i]) < _LEAST:
                break
            if all(np.linalg.norm(points[i] - other) > _APART for other in taken):
                taken.append(points[i])
                axis.annotate(f"{1e3 * change[i]:+.1f}", points[i], fontsize=8, color=_AFTER)
    axis.set_aspect("equal")
    first, last = correction.rounds[0], correction.rounds[-1]
    figure.suptitle(
        f"Outlines before (grey) and after (red); changes outwards in mm. Misfit {1e3 * first.misfit:.2f} mm before, "
        f"{1e3 * last.misfit:.2f} mm after",
        fontsize=11,
    )
    write_figure(path, figure)
