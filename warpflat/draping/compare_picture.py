"""`compare-drape.png`: one garment worn in several cloths, on the same scales."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.arrays import FloatArray
from warpflat.core.atomic_files import atomic_path
from warpflat.draping.picture import body_around, draw_scale, seen_from
from warpflat.draping.result import Drape
from warpflat.export.colours import on_cloth
from warpflat.export.letters import all_letters
from warpflat.export.picture_pen import DPI, GREY, PAGE_WIDTH, Pen
from warpflat.export.picture_png import save_png
from warpflat.export.picture_views import DrawnView

__all__ = ["write_compared_drapes"]

_SKIN = (0.80, 0.79, 0.77)
_TALLEST, _TOP, _BAR, _GAP = 4.2, 0.75, 1.2, 0.25


@all_letters()
def write_compared_drapes(path: str | os.PathLike[str], drapes: Mapping[str, Drape]) -> None:
    """Draw gap, strain and pressure of each drape from the front, a column per cloth.

    Raises:
        InputError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    report_activity("drawing the drapes")
    meshes = {name: body_around(drape) for name, drape in drapes.items()}
    views = {name: seen_from(points, faces, 0.0, cloth=cloth) for name, (points, faces, cloth) in meshes.items()}
    size = np.max([view.size for view in views.values()], axis=0)
    room = PAGE_WIDTH - _BAR - _GAP * (len(views) + 1)
    scale = min(room / (len(views) * float(size[0])), _TALLEST / float(size[1]))
    tall, wide = scale * float(size[1]), scale * float(size[0]) + _GAP
    maps = _maps(drapes)
    height = len(maps) * (tall + _TOP) + 0.3
    figure = Figure(figsize=(PAGE_WIDTH, height), dpi=DPI, facecolor="white")
    pen = Pen(FigureCanvasAgg(figure).get_renderer())
    pen.open_page(figure, PAGE_WIDTH, height)
    for row, (title, values, low, high, colours) in enumerate(maps):
        bottom = height - (row + 1) * (tall + _TOP)
        for column, name in enumerate(drapes):
            _, faces, cloth = meshes[name]
            face_colours = np.tile(np.array(_SKIN), (len(faces), 1))
            face_colours[:cloth] = on_cloth(colours)(np.clip((values[name] - low) / (high - low), 0.0, 1.0))[:, :3]
            left = _GAP + column * wide
            DrawnView(views[name], left=left, bottom=bottom, inches_per_metre=scale, dpi=DPI).draw(
                pen.axes, face_colours
            )
            pen.write(left + 0.5 * (wide - _GAP), bottom + tall + 0.1, name, 9, color=GREY, ha="center")
        pen.write(0.3, bottom + tall + 0.34, title, 11, fontweight="bold")
        draw_scale(figure, (PAGE_WIDTH - 0.75, bottom + 0.1 * tall, 0.16, 0.75 * tall, height), low, high, colours)
    with atomic_path(path) as temporary:
        save_png(temporary, figure, {"Software": "warpflat"})


def _maps(drapes: Mapping[str, Drape]) -> list[tuple[str, Mapping[str, FloatArray], float, float, str]]:
    """Return title, values per face by cloth, range and colours of each map; the range is that of all cloths."""
    gap = {name: 1e3 * _of_faces(drape, drape.gap) for name, drape in drapes.items()}
    pressure = {name: 1e-3 * _of_faces(drape, drape.pressure) for name, drape in drapes.items()}
    strain = {}
    for name, drape in drapes.items():
        warp, weft = drape.strains["warp"], drape.strains["weft"]
        strain[name] = 100.0 * np.where(np.abs(warp) > np.abs(weft), warp, weft)

    def reach(values: Mapping[str, FloatArray], least: float) -> float:
        return max(least, *(float(np.percentile(np.abs(row), 98.0)) for row in values.values()))

    most = reach(strain, 0.5)
    return [
        ("gap to the body [mm]", gap, 0.0, reach(gap, 5.0), "YlOrRd"),
        ("strain of the more strained thread [%]", strain, -most, most, "RdBu_r"),
        ("pressure [kPa]", pressure, 0.0, reach(pressure, 0.1), "YlOrRd"),
    ]


def _of_faces(drape: Drape, values: FloatArray) -> FloatArray:
    """Return #F, the means of values at the vertices."""
    used = drape.cloth.faces >= 0
    return np.asarray(np.where(used, values[np.where(used, drape.cloth.faces, 0)], 0.0).sum(axis=1) / used.sum(axis=1))
