"""A picture of walked seams: both sides of each laid upon each other, with their notches."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.atomic_files import atomic_path, require_writable
from warpflat.export.letters import all_letters
from warpflat.export.picture_png import save_png
from warpflat.pattern.walked import WalkedSeam

__all__ = ["write_walked_picture"]

#: Seams in a row, and the size of each [in].
COLUMNS, CELL = 3, (4.4, 1.9)
COLOURS = ("#1f5fa8", "#c8452c")


@all_letters()
def write_walked_picture(path: str | os.PathLike[str], seams: Sequence[WalkedSeam], *, title: str) -> None:
    """Draw every seam with its first side in blue and its second in red, upright lengths true to each other.

    Args:
        path: the file, ``*.png``.
        seams: one or more.
        title: of the picture.

    Raises:
        InputError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    require_writable(path)
    report_activity(f"drawing {Path(path).name}")
    rows = -(-len(seams) // COLUMNS)
    figure = Figure(figsize=(COLUMNS * CELL[0], rows * CELL[1] + 0.8), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for axis in axes:
        axis.set_axis_off()
    for axis, seam in zip(axes, seams, strict=False):
        start, end = seam.sides[0][[0, -1]]
        x, y = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        along = np.array([[x, -y], [y, x]])
        for line, notches, colour in zip(seam.sides, seam.notches, COLOURS, strict=True):
            axis.plot(*(1000 * (line - start) @ along).T, color=colour, linewidth=1.1, alpha=0.85)
            axis.plot(*(1000 * (notches - start) @ along).T, color=colour, marker="|", markersize=9, linestyle="")
        axis.set_aspect("equal", adjustable="datalim")
        notch = "no notches" if seam.notch_mm is None else f"notches {seam.notch_mm:.1f}"
        axis.set_title(
            f"{seam.name} {seam.size}\n{seam.distance_mm:.1f} mm apart, length {seam.difference_mm:+.2f}, {notch}".strip(),
            fontsize=9,
            parse_math=False,
        )
    figure.suptitle(
        f"{title}: the two sides of each seam laid upon each other, right sides together, darts closed [mm]",
        fontsize=12,
        parse_math=False,
    )
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.97))
    with atomic_path(path) as temporary:
        save_png(temporary, figure, {"Software": "warpflat"})
