"""`corrected.png`: the outlines of the pieces before and after the correction of a pattern."""

from __future__ import annotations

import os

import numpy as np

from warpflat.core import FloatArray
from warpflat.garment.draping.correct_pattern import Correction
from warpflat.pattern import drawn_page, outline_edges

__all__ = ["write_correction_picture"]

# Room between pieces [m], inches per metre, the largest page and its margin [in], and colours before and after.
_GAP, _SCALE, _LARGEST, _MARGIN, _BEFORE, _AFTER = 0.06, 8.0, 60.0, 0.3, "#8a8a8a", "#c8452c"
# Changes of the outline that are written beside it: the largest ones of a piece, so far apart [m].
_LABELS, _APART, _LEAST = 6, 0.08, 1e-3


def write_correction_picture(path: str | os.PathLike[str], correction: Correction) -> None:
    """Draw the outlines before in grey and after in red, with the largest changes in millimetres; positive is outwards.

    Raises:
        InputError: the file cannot be written.
    """
    old, new, moved = correction.before.cloth, correction.after.cloth, correction.moved()
    edges = outline_edges(old.flat_faces)
    shift, x = np.zeros_like(old.flat), 0.0
    for rows in old.piece_vertices.values():
        low, high = old.flat[rows].min(axis=0), old.flat[rows].max(axis=0)
        shift[rows] = [x - low[0], -low[1]]
        x += float(high[0] - low[0]) + _GAP
    tall = float((old.flat + shift)[:, 1].max())
    scale = min(_SCALE, _LARGEST / max(x, tall))
    first, last = correction.rounds[0], correction.rounds[-1]
    words = (
        f"Outlines before (grey) and after (red); changes outwards in mm. Misfit {1e3 * first.misfit:.2f} mm before, "
        f"{1e3 * last.misfit:.2f} mm after"
    )
    with drawn_page(path, max(scale * x, 9.0) + 2 * _MARGIN, scale * tall + 2 * _MARGIN + 0.4, dpi=110) as pen:
        pen.write(_MARGIN, pen.height - 0.25, words, 11)
        before, after = (scale * (flat + shift) + _MARGIN for flat in (old.flat, new.flat))
        pen.segments(before[edges], colour=_BEFORE, width=1.4)
        pen.segments(after[edges], colour=_AFTER, width=1.1)
        for name, rows in old.piece_vertices.items():
            points = before[rows]
            across, up = points.mean(axis=0).tolist()
            pen.write(across, up, name, 10, ha="center")
            # The largest changes stand beside the outline, not too near to each other.
            change, taken = moved[name], list[FloatArray]()
            for i in np.argsort(-np.abs(change), kind="stable").tolist():
                if len(taken) == _LABELS or abs(change[i]) < _LEAST:
                    break
                if all(np.linalg.norm(points[i] - other) > scale * _APART for other in taken):
                    taken.append(points[i])
                    across, up = points[i].tolist()
                    pen.write(across, up, f"{1e3 * change[i]:+.1f}", 8, color=_AFTER, va="bottom")
