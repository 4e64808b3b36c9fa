"""The picture of a ledger: the candidates on the body, and what each would release per centimetre."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.atomic_files import atomic_path
from warpflat.export.colours import energy_colours, energy_scale
from warpflat.export.geometry import polylines_of
from warpflat.export.letters import all_letters
from warpflat.export.picture_pen import DPI, PAGE_WIDTH, Pen
from warpflat.export.picture_png import save_png
from warpflat.export.picture_views import DrawnView, make_facets, surface_view

if TYPE_CHECKING:
    from warpflat.cutting.ledger import Ledger, LedgerEntry

__all__ = ["candidate_words", "write_ledger_picture"]

_ROW = 0.30  # [in]
_BODY = 4.6
_TABLE = 5.35  # where the table begins
_COLUMNS = (("per cm", 8.1), ("released", 9.0), ("left", 9.75), ("length", 10.5), ("opening", 11.35), ("angle", 12.1))
_GREY = (0.36, 0.38, 0.42)
_INKS = ((0.02, 0.27, 0.66), (0.00, 0.42, 0.36), (0.35, 0.20, 0.60), (0.10, 0.11, 0.14))
_MOST = 24


def candidate_words(entry: LedgerEntry) -> tuple[str, str, str, str, str, str]:
    """Return as text: energy released per centimetre and in all, share left, length, opening, angle."""
    return (
        f"{1e3 * entry.per_cm:.2f} mJ",
        f"{1e3 * entry.released:.0f} mJ",
        f"{100 * entry.model_energy_after / max(entry.model_energy_before, np.finfo(float).tiny):.0f} %",
        f"{100 * entry.length:.1f} cm",
        f"{1e3 * entry.opening:.0f} mm",
        "-" if math.isnan(entry.angle) else f"{math.degrees(entry.angle):.0f}°",
    )


@all_letters()
def write_ledger_picture(path: str | os.PathLike[str], ledger: Ledger) -> None:
    """Draw the candidates' paths, numbered as in the table beside them, over the energy that the piece stores now.

    Raises:
        InputError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    entries = ledger.entries[:_MOST]
    surface, density = ledger.result.surface, ledger.result.face_energy_density
    view = surface_view(surface, make_facets(surface.faces), polylines_of({}))
    per_metre = min(_BODY / float(view.size[0]), 5.2 / float(view.size[1]))
    tall = max(float(view.size[1]) * per_metre + 0.7, _ROW * (len(entries) + 2))
    height = tall + 1.15
    figure = Figure(figsize=(PAGE_WIDTH, height), dpi=DPI, facecolor="white")
    pen = Pen(FigureCanvasAgg(figure).get_renderer())
    pen.open_page(figure, PAGE_WIDTH, height)
    pen.write(0.45, height - 0.35, f"{surface.name}: where to cut", 15, fontweight="bold")
    peak = ledger.peaks.words[0] if ledger.peaks.words else "none inside"
    stored = f"strain energy {1e3 * ledger.result.stages[-1].strain_energy_j:.0f} mJ"
    pen.write(0.45, height - 0.64, f"{stored}; highest density: {peak}", 9.5, color=_GREY)
    scale = energy_scale(density, ledger.result.worn.area)
    drawn = DrawnView(view, left=0.45, bottom=height - 1.15 - float(view.size[1]) * per_metre,
                      inches_per_metre=per_metre, dpi=DPI)  # fmt: skip
    drawn.draw(pen.axes, energy_colours(density, scale))
    _draw_paths(pen, drawn, surface.vertices, entries, view)
    _draw_table(pen, entries, height - 1.0)
    with atomic_path(path) as temporary:
        save_png(temporary, figure, {"Software": "warpflat"})


def _draw_paths(pen: Pen, drawn: DrawnView, vertices: FloatArray, entries: Sequence[LedgerEntry], view: Any) -> None:
    # The view's directions, found again from what it did to the vertices.
    centred = vertices - vertices.mean(axis=0)
    turn = np.linalg.lstsq(centred, view.points, rcond=None)[0]
    placed: list[FloatArray] = []
    labels: dict[tuple[float, float], list[str]] = {}
    for number, entry in reversed(list(enumerate(entries, start=1))):
        one = entry.candidate
        paths = [vertices[path] for path in one.paths] + [path.points for path in one.drawn]
        ink = _INKS[(number - 1) % len(_INKS)]
        for points in paths:
            page = drawn.to_page((points - vertices.mean(axis=0)) @ turn)
            pen.line(page, width=1.4, colour=ink, halo=True)
            spot = page[len(page) // 3]
            near = next((known for known in placed if np.linalg.norm(known - spot) < 0.17), None)
            if near is None:
                placed.append(spot)
                near = spot
            labels.setdefault((float(near[0]), float(near[1])), []).insert(0, str(number))
    for (x, y), numbers in labels.items():
        options = {"ha": "center", "fontweight": "bold"}
        text = ", ".join(numbers)
        box = {"boxstyle": "round,pad=0.18", "facecolor": "white", "edgecolor": _GREY, "linewidth": 0.5, "alpha": 0.92}
        pen.axes.text(x, y, text, fontsize=7.5, va="center", zorder=9, bbox=box, **options)


def _draw_table(pen: Pen, entries: Sequence[LedgerEntry], top: float) -> None:
    for words, x in _COLUMNS:
        pen.write(x, top, words, 8.5, color=_GREY, ha="right")
    best = max((entry.per_cm for entry in entries), default=1.0)
    for number, entry in enumerate(entries, start=1):
        y = top - _ROW * number
        ink = _INKS[(number - 1) % len(_INKS)]
        pen.write(_TABLE, y, f"{number}", 9, color=ink, fontweight="bold", ha="right")
        pen.write(_TABLE + 0.1, y + 0.055, pen.shorten(entry.candidate.name, 8.5, 2.05), 8.5)
        width = 2.0 * max(entry.per_cm, 0.0) / max(best, np.finfo(float).tiny)
        bar = np.array([[_TABLE + 0.1, y - 0.07], [_TABLE + 0.1 + width, y - 0.07]])
        pen.axes.plot(bar[:, 0], bar[:, 1], color=ink, linewidth=3.2, solid_capstyle="butt", zorder=5)
        for (_, x), text in zip(_COLUMNS, candidate_words(entry), strict=True):
            pen.write(x, y, text, 8.5, ha="right")
