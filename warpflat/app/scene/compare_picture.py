"""Outlines of one pattern in several fabrics, laid upon each other: a picture with close-ups, and a true-size SVG."""

from __future__ import annotations

import os
from textwrap import fill
from xml.etree import ElementTree as ET

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from warpflat.app.scene.comparison import Comparison, outline
from warpflat.flat import border_of
from warpflat.pattern import all_letters, atomic_path, new_figure, write_figure

__all__ = ["write_overlay_picture", "write_overlay_svg"]


# Okabe and Ito's colours, which can be distinguished without red-green vision; and dashes, for print in grey.
_STYLES: tuple[tuple[str, tuple[float, ...]], ...] = (
    ("#000000", ()),
    ("#d55e00", (6, 2)),
    ("#0072b2", (2, 1.5)),
    ("#009e73", (8, 2, 2, 2)),
    ("#cc79a7", (4, 1, 1, 1)),
    ("#e69f00", (1, 1)),
    ("#56b4e9", (10, 3)),
)
_CLOSE_UPS = 3
_MARGIN_MM = 15.0


def _style(number: int) -> tuple[str, tuple[float, ...]]:
    return _STYLES[number % len(_STYLES)]


def _stroke(number: int) -> dict[str, str]:
    """Return the colour and the dashes of a fabric's lines in SVG."""
    colour, dashes = _style(number)
    return {"stroke": colour} | ({"stroke-dasharray": " ".join(f"{d:g}" for d in dashes)} if dashes else {})


def write_overlay_svg(path: str | os.PathLike[str], comparison: Comparison) -> None:
    """Write the outlines in true size (a unit is a millimetre), in a group per piece with a path per fabric.

    Raises:
        InputError: the file cannot be written.
    """
    root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg"})
    left, height = _MARGIN_MM, 0.0
    legend = _MARGIN_MM + 6.0 * len(comparison.fabrics)
    for piece in comparison.pieces:
        points = np.concatenate([comparison.layouts[fabric][piece] for fabric in comparison.fabrics])
        low, high = 1e3 * points.min(axis=0), 1e3 * points.max(axis=0)
        group = ET.SubElement(root, "g", {"id": piece.replace(" ", "_"), "fill": "none", "stroke-width": "0.4"})
        for number, fabric in enumerate(comparison.fabrics):
            parts = []
            for loop in outline(comparison.results[fabric][piece], comparison.layouts[fabric][piece]):
                x = 1e3 * loop[:-1, 0] - low[0] + left
                y = high[1] - 1e3 * loop[:-1, 1] + legend + _MARGIN_MM
                parts.append("M" + " L".join(f"{a:.3f},{b:.3f}" for a, b in zip(x, y, strict=True)) + " Z")
            attributes = {"id": f"{piece}.{fabric}".replace(" ", "_"), "d": " ".join(parts)}
            ET.SubElement(group, "path", attributes | _stroke(number))
        left += float(high[0] - low[0]) + _MARGIN_MM
        height = max(height, float(high[1] - low[1]))
    for number, fabric in enumerate(comparison.fabrics):
        y = _MARGIN_MM + 6.0 * number
        line = {"x1": f"{_MARGIN_MM}", "x2": f"{_MARGIN_MM + 20}", "y1": f"{y}", "y2": f"{y}", "stroke-width": "0.6"}
        ET.SubElement(root, "line", line | _stroke(number))
        text = ET.SubElement(root, "text", {"x": f"{_MARGIN_MM + 23}", "y": f"{y + 1.5}", "font-size": "4.5"})
        text.text = fabric
    tall = legend + height + 2 * _MARGIN_MM
    root.set("width", f"{left:.3f}mm")
    root.set("height", f"{tall:.3f}mm")
    root.set("viewBox", f"0 0 {left:.3f} {tall:.3f}")
    with atomic_path(path) as temporary:
        ET.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


@all_letters()
def write_overlay_picture(path: str | os.PathLike[str], comparison: Comparison) -> None:
    """Draw each piece with its outlines laid upon each other, and close-ups of where they are furthest apart.

    Raises:
        InputError: the file cannot be written.
    """
    rows = len(comparison.pieces)
    figure = new_figure(10.0, 6.2 * rows + 0.6, dpi=110, layout="constrained")
    grid = figure.add_gridspec(rows * _CLOSE_UPS, 2, width_ratios=(2.2, 1.0))
    for row, piece in enumerate(comparison.pieces):
        whole = figure.add_subplot(grid[row * _CLOSE_UPS : (row + 1) * _CLOSE_UPS, 0])
        _draw_outlines(whole, comparison, piece, width=1.4)
        # The named points that are furthest apart, or the one of the outline that is.
        first, *others = [comparison.layouts[fabric][piece] for fabric in comparison.fabrics]
        points = comparison.points(piece)
        if not points:
            outline = border_of(comparison.results[comparison.fabrics[0]][piece].network.surface)
            moved = np.max([np.linalg.norm(other - first, axis=1) for other in others], axis=0)
            points = {"furthest apart": int(outline[np.argmax(moved[outline])])}
        places = []
        for label, vertex in points.items():
            apart = max(float(np.linalg.norm(other[vertex] - first[vertex])) for other in others)
            places.append((label, np.mean([layout[vertex] for layout in (first, *others)], axis=0), apart))
        places = sorted(places, key=lambda place: -place[2])[:_CLOSE_UPS]
        for number, (label, at, apart) in enumerate(places):
            close = figure.add_subplot(grid[row * _CLOSE_UPS + number, 1])
            _draw_outlines(close, comparison, piece, width=1.8)
            reach = max(2.0 * apart, 0.004)
            left, low = at - np.multiply(reach, [1.6, 1.0])
            close.set(xlim=(left, left + 3.2 * reach), ylim=(low, low + 2.0 * reach), xticks=[], yticks=[])
            length = 10.0 ** np.floor(np.log10(1.6 * reach))
            _draw_length(close, left + 0.1 * reach, low + 0.1 * reach, length, f"{1e3 * length:g} mm")
            close.set_title(f"{label}: {1e3 * apart:.1f} mm", fontsize=9, wrap=True)
            whole.plot(*at, "o", mfc="none", mec="#555555", ms=11)
            whole.annotate(str(number + 1), at, xytext=(9, 6), textcoords="offset points", color="#555555", fontsize=10)
            close.text(0.03, 0.9, str(number + 1), transform=close.transAxes, color="#555555", fontsize=11)
        whole.set_axis_off()
        most = {fabric: 1e3 * d["outline, most"] for fabric, d in comparison.distances(piece).items()}
        words = ", ".join(f"{fabric} {mm:.1f} mm" for fabric, mm in most.items())
        whole.set_title(fill(f"{piece}: outline apart by at most {words}", 75), fontsize=11, loc="left")
        low, high = whole.get_xlim()[0], whole.get_ylim()[0]
        length = 0.1 if whole.get_xlim()[1] - low > 0.25 else 0.02
        _draw_length(whole, low, high, length, f"{100 * length:.0f} cm")
    handles = []
    for colour, dashes in map(_style, range(len(comparison.fabrics))):
        handles.append(Line2D([], [], color=colour, linestyle=(0, dashes), linewidth=1.6))
    figure.legend(
        handles,
        [f"{fabric} (compared with)" if k == 0 else fabric for k, fabric in enumerate(comparison.fabrics)],
        loc="outside upper center",
        ncols=min(len(comparison.fabrics), 3),
        frameon=False,
        fontsize=11,
    )
    write_figure(path, figure)


def _draw_length(axis: Axes, x: float, y: float, length: float, words: str) -> None:
    axis.plot([x, x + length], [y, y], color="black", linewidth=2)
    axis.annotate(words, (x + length, y), xytext=(4, -3), textcoords="offset points", fontsize=9)


def _draw_outlines(axis: Axes, comparison: Comparison, piece: str, *, width: float) -> None:
    for number, fabric in enumerate(comparison.fabrics):
        colour, dashes = _style(number)
        for loop in outline(comparison.results[fabric][piece], comparison.layouts[fabric][piece]):
            axis.plot(*loop.T, color=colour, linewidth=width, linestyle=(0, dashes))
    axis.set_aspect("equal")
