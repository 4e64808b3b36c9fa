"""A picture of walked seams: the second side of each laid along the first by its length, with the notches of both."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import shapely
from matplotlib.markers import CARETDOWNBASE, CARETUPBASE

from warpflat.core import FloatArray, unit
from warpflat.pattern.drafting.walked import WalkedSeam
from warpflat.pattern.export.figure import drawn_page
from warpflat.pattern.export.packing import pack_boxes

__all__ = ["write_walked_picture"]

#: Seams in a row at most, the width of each and its greatest height; the height of the page's title, of the cloth above a seam, which
#: bears its title, and the margin around [in].
COLUMNS, CELL, TALLEST = 3, 4.4, 1.1
HEAD, CLOTH, MARGIN = 0.34, 0.62, 0.08
COLOURS = ("#1f5fa8", "#c8452c")
_CLOTH_ALPHA = 0.2


def write_walked_picture(path: str | os.PathLike[str], seams: Sequence[WalkedSeam], *, title: str) -> None:
    """Draw every seam: above it the cloth and the notches of its first side in blue, below it those of its second in red.

    Args:
        path: the file, ``*.png``.
        seams: one or more.
        title: of the picture.

    Raises:
        InputError: the file cannot be written.
    """
    # The tallest first, so that the columns end at nearly the same height.
    seams = sorted(seams, key=lambda seam: -float(np.ptp(_fitted(seam)[0], axis=0)[1]))
    fitted = [_fitted(seam) for seam in seams]
    sizes = [(CELL, 2 * CLOTH + 3 * MARGIN + float(np.ptp(lines[0], axis=0)[1])) for lines in fitted]
    # As many columns as leave least of the page empty.
    packed = [pack_boxes(sizes, columns * CELL) for columns in range(2, COLUMNS + 1)]
    places, width, foot = min(packed, key=lambda found: found[1] * (found[2] + HEAD))
    width, height = max(width, 2 * CELL), HEAD + foot + MARGIN
    with drawn_page(path, width, height, dpi=110) as pen:
        for seam, lines, (left, top) in zip(seams, fitted, places, strict=True):
            middle = left + 0.5 * CELL
            upper = (height - HEAD - top) - MARGIN
            seam_height = float(np.ptp(lines[0], axis=0)[1])
            centre = np.array([middle, upper - CLOTH - 0.5 * seam_height])
            half = 0.5 * CELL - MARGIN
            room = shapely.box(middle - half, upper - 2 * CLOTH - seam_height - MARGIN, middle + half, upper)
            line = lines[0] + centre
            # Notches point into their cloth.
            for side, colour, marker, notches in zip(
                (1.0, -1.0), COLOURS, (CARETUPBASE, CARETDOWNBASE), lines[1:], strict=True
            ):
                # The pieces of the first side lie to the left of their seam: above it, where it runs to the right.
                cloth = shapely.LineString(line).buffer(side * CLOTH, single_sided=True, join_style="round")
                for part in shapely.get_parts(shapely.intersection(cloth, room)):
                    outline = shapely.get_coordinates(part.exterior)
                    pen.polygon(outline, facecolor=colour, alpha=_CLOTH_ALPHA, linewidth=0)
                pen.line(notches + centre, width=0.0, colour=colour, marker=marker, markersize=8, linestyle="")
            pen.line(line, width=0.9, colour="black")
            report = seam.report
            notch = "no notches" if report.notches_mm is None else f"notches meet within {report.notches_mm:.1f} mm"
            words = f"{report.name} {report.size}\n{report.length_mm[0]:.0f} mm"
            if report.ease:
                words += f", {1e3 * 0.1 * report.ease:+.1f} % ease"
            words += f", sides differ by {abs(report.difference_mm):.2f} mm\n{notch}"
            pen.write(middle, upper - 0.4 * CLOTH, words, 8, ha="center")
        words = f"{title}: the two sides of each seam laid along each other by their length, right sides together, darts closed"
        pen.write(MARGIN, height - 0.5 * HEAD, words, min(11.0, 135.0 * (width - 2 * MARGIN) / len(words)))


def _fitted(seam: WalkedSeam) -> list[FloatArray]:
    """Return the line of a seam and the notches of both sides, level and around the origin, as large as a cell lets them be [in]."""
    start, end = seam.line[[0, -1]]
    x, y = unit(end - start)
    along = np.array([[x, -y], [y, x]])
    level = seam.line @ along
    low, high = level.min(axis=0), level.max(axis=0)
    scale = float((np.array([CELL - 2 * MARGIN, TALLEST]) / np.maximum(high - low, 1e-9)).min())
    return [scale * (rows @ along - 0.5 * (low + high)) for rows in (seam.line, *seam.notches)]
