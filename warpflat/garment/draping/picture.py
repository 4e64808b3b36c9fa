"""`drape.png`: a garment on the body from three sides, with maps of gap, strain and shear; `compare-drape.png`: it in several cloths."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from warpflat.core import FloatArray, report_activity, weighted_percentile
from warpflat.garment.draping.body import SKIN
from warpflat.garment.draping.result import Drape
from warpflat.pattern import (
    GREY,
    PAGE_WIDTH,
    SIDES,
    Body,
    DrawnView,
    Facets,
    Pen,
    all_letters,
    crop_body,
    make_facets,
    new_figure,
    on_cloth,
    outline_edges,
    view_from_side,
    write_figure,
)

__all__ = ["write_compared_drapes", "write_drape_picture"]

_TALLEST, _TOP, _BOTTOM, _BAR = 8.0, 0.48, 0.05, 0.9


@all_letters()
def write_drape_picture(path: str | os.PathLike[str], drape: Drape) -> None:
    """Draw the gap to the body, the strain of the threads and the shear on the worn garment, each from three sides.

    Raises:
        InputError: the file cannot be written.
    """
    report_activity(f"drawing {Path(path).name}")
    gap, strain = 1e3 * _of_faces(drape, drape.gap), _strain(drape)
    widest = max(5.0, weighted_percentile(gap, drape.face_areas, 0.98))
    shear, fabric = drape.strains["shear"], drape.cloth.fabric
    most, most_sheared = (
        min(limit, max(0.5, weighted_percentile(np.abs(values), drape.face_areas, 0.98)))
        for values, limit in ((strain, 100.0 * fabric.strain_limit), (shear, fabric.shear_limit))
    )
    maps = [
        ("gap to the body [mm]", gap, 0.0, widest, "YlOrRd"),
        ("strain of the more strained thread [%]", strain, -most, most, "RdBu_r"),
        ("shear [degrees]", shear, -most_sheared, most_sheared, "RdBu_r"),
    ]
    points, facets, skin = _body_around(drape)
    views = [view_from_side(points, facets, degrees) for _, degrees in SIDES]
    room = PAGE_WIDTH - _BAR - 0.2 * (len(views) + 1)
    scale = min(room / sum(float(view.size[0]) for view in views), _TALLEST / float(views[0].size[1]))
    tall = scale * float(views[0].size[1])
    height = len(maps) * (tall + _TOP) + _BOTTOM + 0.2
    figure = new_figure(PAGE_WIDTH, height)
    pen = Pen(figure)
    pen.open_page()
    worst = next((place.words for place in drape.places if place.kind != "bridged"), "it lies as designed")
    rest = "" if drape.converged else "NOT AT REST; "
    pen.write(0.3, height - 0.2, f"{drape.cloth.fabric.name}; {rest}{worst}", 11)
    for row, (title, values, low, high, colours) in enumerate(maps):
        bottom = height - 0.2 - (row + 1) * (tall + _TOP)
        left = 0.3 + 0.5 * (room - scale * sum(float(view.size[0]) for view in views))
        shades = on_cloth(colours)(np.clip((values - low) / (high - low), 0.0, 1.0))[:, :3]
        for view, (side, _) in zip(views, SIDES, strict=True):
            drawn = DrawnView(view, left=left, bottom=bottom, inches_per_metre=scale)
            drawn.draw(pen.axes, np.concatenate([shades, skin]))
            pen.write(left + 0.5 * scale * float(view.size[0]), bottom + tall + 0.12, side, 9, color=GREY, ha="center")
            left += scale * float(view.size[0]) + 0.2
        pen.write(0.3, bottom + tall + 0.3, title, 11, fontweight="bold")
        _draw_scale(figure, (PAGE_WIDTH - 0.75, bottom + 0.1 * tall, 0.16, 0.75 * tall, height), low, high, colours)
    write_figure(path, figure)


@all_letters()
def write_compared_drapes(path: str | os.PathLike[str], drapes: Mapping[str, Drape]) -> None:
    """Draw gap, strain, shear and pressure of each drape from the front, a column per cloth.

    Raises:
        InputError: the file cannot be written.
    """
    report_activity("drawing the drapes")
    top, gap = 0.75, 0.25
    meshes = {name: _body_around(drape) for name, drape in drapes.items()}
    views = {name: view_from_side(points, facets, 0.0) for name, (points, facets, _) in meshes.items()}
    size = np.max([view.size for view in views.values()], axis=0)
    room = PAGE_WIDTH - 1.2 - gap * (len(views) + 1)
    scale = min(room / (len(views) * float(size[0])), 4.2 / float(size[1]))
    tall, wide = scale * float(size[1]), scale * float(size[0]) + gap
    maps = _compared_maps(drapes)
    height = len(maps) * (tall + top) + 0.3
    figure = new_figure(PAGE_WIDTH, height)
    pen = Pen(figure)
    pen.open_page()
    for row, (title, values, low, high, colours) in enumerate(maps):
        bottom = height - (row + 1) * (tall + top)
        for column, name in enumerate(drapes):
            shades = on_cloth(colours)(np.clip((values[name] - low) / (high - low), 0.0, 1.0))[:, :3]
            left = gap + column * wide
            drawn = DrawnView(views[name], left=left, bottom=bottom, inches_per_metre=scale)
            drawn.draw(pen.axes, np.concatenate([shades, meshes[name][2]]))
            pen.write(left + 0.5 * (wide - gap), bottom + tall + 0.1, name, 9, color=GREY, ha="center")
        pen.write(0.3, bottom + tall + 0.34, title, 11, fontweight="bold")
        _draw_scale(figure, (PAGE_WIDTH - 0.75, bottom + 0.1 * tall, 0.16, 0.75 * tall, height), low, high, colours)
    write_figure(path, figure)


def _compared_maps(drapes: Mapping[str, Drape]) -> list[tuple[str, Mapping[str, FloatArray], float, float, str]]:
    """Return title, values per face by cloth, range and colours of each map; the range is that of all cloths."""
    gap = {name: 1e3 * _of_faces(drape, drape.gap) for name, drape in drapes.items()}
    pressure = {name: 1e-3 * _of_faces(drape, drape.pressure) for name, drape in drapes.items()}
    strain = {name: _strain(drape) for name, drape in drapes.items()}
    shear = {name: drape.strains["shear"] for name, drape in drapes.items()}

    def reach(values: Mapping[str, FloatArray], least: float) -> float:
        return max(least, *(float(np.percentile(np.abs(row), 98.0)) for row in values.values()))

    most, most_sheared = reach(strain, 0.5), reach(shear, 0.5)
    return [
        ("gap to the body [mm]", gap, 0.0, reach(gap, 5.0), "YlOrRd"),
        ("strain of the more strained thread [%]", strain, -most, most, "RdBu_r"),
        ("shear [degrees]", shear, -most_sheared, most_sheared, "RdBu_r"),
        ("pressure [kPa]", pressure, 0.0, reach(pressure, 0.1), "YlOrRd"),
    ]


def _of_faces(drape: Drape, values: FloatArray) -> FloatArray:
    """Return #F, the means of values at the vertices."""
    used = drape.cloth.faces >= 0
    return np.asarray(np.where(used, values[np.where(used, drape.cloth.faces, 0)], 0.0).sum(axis=1) / used.sum(axis=1))


def _strain(drape: Drape) -> FloatArray:
    """Return #F, the strain of the more strained thread [%]."""
    warp, weft = drape.strains["warp"], drape.strains["weft"]
    return np.asarray(100.0 * np.where(np.abs(warp) > np.abs(weft), warp, weft))


def _body_around(drape: Drape) -> tuple[FloatArray, Facets, FloatArray]:
    """Return the worn cloth and then the part of the body around it as vertices and facets, and the colours of the body's faces."""
    body, x = drape.body, drape.positions
    # Arms and legs far from the cloth would only make the pictures small.
    corners = np.column_stack([body.triangles, np.full(len(body.triangles), -1)])
    kept, inner = crop_body(Body(vertices=body.shrunk, faces=corners), x)
    triangles = np.column_stack([kept + len(x), np.full(len(kept), -1)])
    faces = np.concatenate([drape.cloth.faces, triangles]).astype(np.int32)
    facets = make_facets(faces, outline_edges(drape.cloth.faces))
    return np.concatenate([x, inner]), facets, np.tile(SKIN, (len(triangles), 1))


def _draw_scale(
    figure: Any, place: tuple[float, float, float, float, float], low: float, high: float, colours: str
) -> None:
    """Draw a colour scale at left, bottom, width and height on a page of a height, all in inches."""
    left, bottom, wide, tall, height = place
    axes = figure.add_axes((left / PAGE_WIDTH, bottom / height, wide / PAGE_WIDTH, tall / height))
    extend = "both" if low < 0.0 else "max"
    figure.colorbar(ScalarMappable(Normalize(low, high), on_cloth(colours)), cax=axes, extend=extend).ax.tick_params(
        labelsize=8
    )
