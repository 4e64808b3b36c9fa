"""`drape.png`: the worn garment on the body from the front, the side and the back, with maps of gap and strain."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.atomic_files import atomic_path
from warpflat.core.sums import weighted_percentile
from warpflat.draping.result import Drape
from warpflat.export.colours import on_cloth
from warpflat.export.geometry import area_vectors, outline_edges, vertex_normals
from warpflat.export.letters import all_letters
from warpflat.export.picture_garment import Body, crop_body
from warpflat.export.picture_pen import DPI, GREY, PAGE_WIDTH, Pen
from warpflat.export.picture_png import save_png
from warpflat.export.picture_views import DrawnView, View, make_facets

__all__ = ["body_around", "draw_scale", "seen_from", "write_drape_picture"]

_VIEWS = (("front", 0.0), ("left side", 90.0), ("back", 180.0))
_SKIN = (0.80, 0.79, 0.77)
# The body is drawn this much smaller [m], so that cloth that lies on it is seen.
_SHRUNK = 0.003
_TALLEST, _TOP, _BOTTOM, _BAR = 8.0, 0.48, 0.05, 0.9


@all_letters()
def write_drape_picture(path: str | os.PathLike[str], drape: Drape) -> None:
    """Draw the gap to the body and the strain of the threads on the worn garment, each from three sides.

    Raises:
        InputError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    report_activity(f"drawing {Path(path).name}")
    points, faces, cloth = body_around(drape)
    views = [seen_from(points, faces, degrees, cloth=cloth) for _, degrees in _VIEWS]
    room = PAGE_WIDTH - _BAR - 0.2 * (len(views) + 1)
    scale = min(room / sum(float(view.size[0]) for view in views), _TALLEST / float(views[0].size[1]))
    tall = scale * float(views[0].size[1])
    height = 2 * (tall + _TOP) + _BOTTOM + 0.2
    figure = Figure(figsize=(PAGE_WIDTH, height), dpi=DPI, facecolor="white")
    pen = Pen(FigureCanvasAgg(figure).get_renderer())
    pen.open_page(figure, PAGE_WIDTH, height)
    pen.write(0.3, height - 0.2, _title(drape), 11)
    for row, (title, values, low, high, colours) in enumerate(_maps(drape)):
        bottom = height - 0.2 - (row + 1) * (tall + _TOP)
        left = 0.3 + 0.5 * (room - scale * sum(float(view.size[0]) for view in views))
        share = np.clip((values - low) / (high - low), 0.0, 1.0)
        face_colours = np.tile(np.array(_SKIN), (len(faces), 1))
        face_colours[:cloth] = on_cloth(colours)(share)[:, :3]
        for view, (side, _) in zip(views, _VIEWS, strict=True):
            drawn = DrawnView(view, left=left, bottom=bottom, inches_per_metre=scale, dpi=DPI)
            drawn.draw(pen.axes, face_colours)
            pen.write(left + 0.5 * scale * float(view.size[0]), bottom + tall + 0.12, side, 9, color=GREY, ha="center")
            left += scale * float(view.size[0]) + 0.2
        pen.write(0.3, bottom + tall + 0.3, title, 11, fontweight="bold")
        draw_scale(figure, (PAGE_WIDTH - 0.75, bottom + 0.1 * tall, 0.16, 0.75 * tall, height), low, high, colours)
    with atomic_path(path) as temporary:
        save_png(temporary, figure, {"Software": "warpflat"})


def _title(drape: Drape) -> str:
    worst = next((place.words for place in drape.places if place.kind != "bridged"), "it lies as designed")
    rest = "" if drape.converged else "NOT AT REST; "
    return f"{drape.cloth.fabric.name}; {rest}{worst}"


def _maps(drape: Drape) -> list[tuple[str, FloatArray, float, float, str]]:
    """Return title, values per face, range and colours of each map."""
    faces = drape.cloth.faces
    used = faces >= 0
    gap = 1e3 * np.where(used, drape.gap[np.where(used, faces, 0)], 0.0).sum(axis=1) / used.sum(axis=1)
    warp, weft = drape.strains["warp"], drape.strains["weft"]
    strain = 100.0 * np.where(np.abs(warp) > np.abs(weft), warp, weft)
    widest = max(5.0, weighted_percentile(gap, drape.face_areas, 0.98))
    limit = 100.0 * drape.cloth.fabric.strain_limit
    most = min(limit, max(0.5, weighted_percentile(np.abs(strain), drape.face_areas, 0.98)))
    return [
        ("gap to the body [mm]", gap, 0.0, widest, "YlOrRd"),
        ("strain of the more strained thread [%]", strain, -most, most, "RdBu_r"),
    ]


def body_around(drape: Drape) -> tuple[FloatArray, IntArray, int]:
    """Return the worn cloth and the part of the body around it as one mesh, and the number of the cloth's faces."""
    body, x = drape.body, drape.positions
    normals = vertex_normals(area_vectors(body.vertices, body.triangles), body.triangles, len(body.vertices))
    inner = body.vertices - _SHRUNK * normals
    # Arms and legs far from the cloth would only make the pictures small.
    corners = np.column_stack([body.triangles, np.full(len(body.triangles), -1)])
    kept, inner = crop_body(Body(vertices=inner, faces=corners), x)
    triangles = np.column_stack([kept + len(x), np.full(len(kept), -1)])
    faces = np.concatenate([drape.cloth.faces, triangles]).astype(np.int32)
    return np.concatenate([x, inner]), faces, len(drape.cloth.faces)


def seen_from(points: FloatArray, faces: IntArray, degrees: float, *, cloth: int) -> View:
    """Return the mesh as seen by somebody who walked `degrees` around the body to its left; the first `cloth` faces have outlines."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    # Without faces no mesh is drawn.
    facets = replace(make_facets(faces), faces=faces[:0], outline=outline_edges(faces[:cloth]))
    vectors = area_vectors(points, facets.triangles)
    return View(points=points @ turn.T, facets=facets, lines={}, vectors=vectors @ turn.T)


def draw_scale(
    figure: Any, place: tuple[float, float, float, float, float], low: float, high: float, colours: str
) -> None:
    """Draw a colour scale at left, bottom, width and height on a page of a height, all in inches."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    left, bottom, wide, tall, height = place
    axes = figure.add_axes((left / PAGE_WIDTH, bottom / height, wide / PAGE_WIDTH, tall / height))
    extend = "both" if low < 0.0 else "max"
    figure.colorbar(ScalarMappable(Normalize(low, high), on_cloth(colours)), cax=axes, extend=extend).ax.tick_params(
        labelsize=8
    )
