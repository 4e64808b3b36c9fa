"""The picture of a ledger: the candidates on the body, and what each would release per centimetre."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray
from warpflat.flat import join_surfaces
from warpflat.pattern.export.colours import Scale, energy_scale
from warpflat.pattern.export.figure import GREY, INK, PAGE_WIDTH, drawn_page
from warpflat.pattern.export.geometry import polylines_of
from warpflat.pattern.export.views import SIDES, Facets, View, draw_row, row_size

if TYPE_CHECKING:
    from warpflat.flat import Ledger, LedgerEntry

__all__ = ["candidate_words", "write_ledger_picture"]

_ROW = 0.30  # [in]
_BODY = 4.6
_GAP = 0.5  # between two views
_TABLE = 5.35  # where the table begins
_COLUMNS = (("per cm", 8.1), ("released", 9.0), ("left", 9.75), ("length", 10.5), ("opening", 11.35), ("angle", 12.1))
_INKS = ((0.02, 0.27, 0.66), (0.00, 0.42, 0.36), (0.35, 0.20, 0.60), (0.10, 0.11, 0.14))
_MOST = 24


def candidate_words(entry: LedgerEntry) -> tuple[str, str, str, str, str, str]:
    """Return as text: energy released per centimetre and in all, share left, length, opening, angle."""
    return (
        f"{1e3 * entry.per_cm:.2f} mJ",
        f"{1e3 * entry.released:.0f} mJ",
        f"{100 * entry.model_energy_after / max(entry.model_energy_before, np.finfo(float).tiny):.0f} %",
        f"{100 * entry.length:.1f} cm",
        "-" if math.isnan(entry.opening) else f"{1e3 * entry.opening:.0f} mm",
        "-" if math.isnan(entry.angle) else f"{math.degrees(entry.angle):.0f}°",
    )


def write_ledger_picture(path: str | os.PathLike[str], ledger: Ledger) -> None:
    """Draw the candidates' paths, numbered as in the table beside them, over the energy that the piece stores now.

    Raises:
        InputError: the file cannot be written.
    """
    entries = ledger.entries[:_MOST]
    surface = join_surfaces([piece.surface for piece in ledger.pieces])
    density = np.concatenate([piece.face_energy_density for piece in ledger.pieces])
    facets = Facets.of(surface.faces)
    views = {"": View.of_surface(surface, facets, polylines_of({}))}
    if len(ledger.pieces) > 1:  # around a body
        views = View.around(surface.vertices, facets, (SIDES[0], SIDES[-1]))
    wide, high = row_size(views)
    per_metre = min((_BODY - _GAP * (len(views) - 1)) / wide, 5.2 / high)
    height = max(high * per_metre + 0.7, _ROW * (len(entries) + 2)) + 1.15
    with drawn_page(path, PAGE_WIDTH, height) as pen:
        pen.write(0.45, height - 0.35, f"{ledger.name}: where to cut", 15, fontweight="bold")
        peak = ledger.peaks[0] if ledger.peaks else "none inside"
        energy = sum(piece.stages[-1].strain_energy_j for piece in ledger.pieces)
        stored = f"strain energy {1e3 * energy:.0f} mJ"
        pen.write(0.45, height - 0.64, f"{stored}; highest density: {peak}", 9.5, color=GREY)
        areas = np.concatenate([piece.worn.area for piece in ledger.pieces])
        colours = Scale(high=energy_scale(density, areas)).rgb(density)
        bottom = height - 1.15 - high * per_metre
        shown = draw_row(
            pen, views, [colours] * len(views), left=0.45, bottom=bottom, inches_per_metre=per_metre, gap=_GAP
        )
        placed: list[FloatArray] = []
        labels: dict[tuple[float, float], list[str]] = {}
        for number, entry in reversed(list(enumerate(entries, start=1))):
            ink = _INKS[(number - 1) % len(_INKS)]
            for points in entry.paths:
                # In the view on whose side of the body it lies.
                seen = [points @ view.directions.T for view in views.values()]
                nearest = int(np.argmax([float(each[:, 2].mean()) for each in seen]))
                page = shown[nearest].to_page(seen[nearest])
                pen.line(page, width=1.4, colour=ink, halo=True)
                spot = page[len(page) // 3]
                near = next((known for known in placed if np.linalg.norm(known - spot) < 0.17), None)
                if near is None:
                    placed.append(spot)
                    near = spot
                labels.setdefault((float(near[0]), float(near[1])), []).insert(0, str(number))
        for (x, y), numbers in labels.items():
            pen.badge(x, y, ", ".join(dict.fromkeys(numbers)), INK)
        top = height - 1.0
        for words, x in _COLUMNS:
            pen.write(x, top, words, 8.5, color=GREY, ha="right")
        best = max((entry.per_cm for entry in entries), default=1.0)
        for number, entry in enumerate(entries, start=1):
            y = top - _ROW * number
            ink = _INKS[(number - 1) % len(_INKS)]
            pen.write(_TABLE, y, f"{number}", 9, color=ink, fontweight="bold", ha="right")
            pen.write(_TABLE + 0.1, y + 0.055, pen.shorten(entry.name, 8.5, 2.05), 8.5)
            width = 2.0 * max(entry.per_cm, 0.0) / max(best, np.finfo(float).tiny)
            bar = np.array([[_TABLE + 0.1, y - 0.07], [_TABLE + 0.1 + width, y - 0.07]])
            pen.line(bar, width=3.2, colour=ink, solid_capstyle="butt")
            for (_, x), text in zip(_COLUMNS, candidate_words(entry), strict=True):
                pen.write(x, y, text, 8.5, ha="right")
