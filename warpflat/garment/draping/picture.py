"""`drape.png`: a garment on the body from three sides, with maps of gap, strain and shear; `compare-drape.png`: it in several cloths."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from warpflat.core import FloatArray
from warpflat.garment.draping.result import Drape
from warpflat.pattern import (
    PAGE_WIDTH,
    SIDES,
    SKIN,
    Body,
    Facets,
    Scale,
    View,
    corner_mean,
    draw_row,
    drawn_page,
    dress,
    view_from_side,
)

__all__ = ["write_compared_drapes", "write_drape_picture"]

_TALLEST, _TALLEST_COMPARED, _TOP, _MARGIN, _BAR, _GAP = 8.0, 4.2, 0.48, 0.3, 1.0, 0.2  # [in]


def write_drape_picture(path: str | os.PathLike[str], drape: Drape) -> None:
    """Draw the gap to the body, the strain of the threads and the shear on the worn garment, each from three sides.

    Raises:
        InputError: the file cannot be written.
    """
    worst = next((place.words for place in drape.places if place.kind != "bridged"), "it lies as designed")
    title = f"{drape.cloth.fabric.name}; {'' if drape.converged else 'NOT AT REST; '}{worst}"
    points, facets, skin = _dressed(drape)
    views = {side: view_from_side(points, facets, degrees) for side, degrees in SIDES}
    maps = {name: ([values] * len(views), scale) for name, ([values], scale) in _maps([drape]).items()}
    del maps[_PRESSURE]
    _write_maps(path, title, views, [skin] * len(views), maps, _TALLEST)


def write_compared_drapes(path: str | os.PathLike[str], drapes: Mapping[str, Drape]) -> None:
    """Draw gap, strain, shear and pressure of each drape from the front, a column per cloth.

    Raises:
        InputError: the file cannot be written.
    """
    dressed = {name: _dressed(drape) for name, drape in drapes.items()}
    views = {name: view_from_side(points, facets, 0.0) for name, (points, facets, _) in dressed.items()}
    skins = [skin for _, _, skin in dressed.values()]
    _write_maps(path, "", views, skins, _maps(list(drapes.values())), _TALLEST_COMPARED)


_PRESSURE = "pressure [kPa]"


def _maps(drapes: list[Drape]) -> dict[str, tuple[list[FloatArray], Scale]]:
    """Return by title the values of each map, #F for each drape, and the scale that all of them share."""
    areas = np.concatenate([drape.face_areas for drape in drapes])
    limits = [drape.cloth.fabric for drape in drapes]

    def stretched(drape: Drape) -> FloatArray:
        warp, weft = drape.strains["warp"], drape.strains["weft"]
        return np.asarray(100.0 * np.where(np.abs(warp) > np.abs(weft), warp, weft))

    gaps = [1e3 * corner_mean(drape.gap, drape.cloth.faces) for drape in drapes]
    strains = [stretched(drape) for drape in drapes]
    shears = [drape.strains["shear"] for drape in drapes]
    pressures = [1e-3 * corner_mean(drape.pressure, drape.cloth.faces) for drape in drapes]
    most, most_sheared = 100.0 * max(f.strain_limit for f in limits), max(f.shear_limit for f in limits)
    return {
        "gap to the body [mm]": (gaps, Scale.from_zero(np.concatenate(gaps), areas, 5.0)),
        "strain of the more strained thread [%]": (
            strains,
            Scale.both_ways(np.concatenate(strains), areas, 0.5, most),
        ),
        "shear [degrees]": (shears, Scale.both_ways(np.concatenate(shears), areas, 0.5, most_sheared)),
        _PRESSURE: (pressures, Scale.from_zero(np.concatenate(pressures), areas, 0.1)),
    }


def _dressed(drape: Drape) -> tuple[FloatArray, Facets, FloatArray]:
    """Return vertices and facets of the worn cloth and of the body around it, and the colours of the body's faces."""
    body = Body(vertices=drape.body.shrunk, faces=drape.body.triangles)
    points, facets, count = dress(body, drape.positions, drape.cloth.faces)
    return points, facets, np.tile(SKIN, (count, 1))


def _write_maps(
    path: str | os.PathLike[str],
    title: str,
    views: Mapping[str, View],
    skins: list[FloatArray],
    maps: Mapping[str, tuple[list[FloatArray], Scale]],
    tallest: float,
) -> None:
    """Draw a row for each map: the views in its colours, the body in those of `skins`, and its scale."""
    sizes = np.array([view.size[:2] for view in views.values()])
    room = PAGE_WIDTH - _BAR - 2 * _MARGIN - _GAP * (len(views) - 1)
    per_metre = min(room / float(sizes[:, 0].sum()), tallest / float(sizes[:, 1].max()))
    tall = per_metre * float(sizes[:, 1].max())
    aside = 0.5 * (room - per_metre * float(sizes[:, 0].sum()))
    bottom = len(maps) * (tall + _TOP) + _MARGIN
    with drawn_page(path, PAGE_WIDTH, bottom + (_MARGIN if title else 0.0)) as pen:
        pen.write(_MARGIN, bottom + 0.1, title, 11)
        for name, (values, scale) in maps.items():
            pen.write(_MARGIN, bottom - 0.14, name, 11, fontweight="bold")
            bottom -= tall + _TOP
            colours = [np.concatenate([scale.rgb(each), skin]) for each, skin in zip(values, skins, strict=True)]
            left = _MARGIN + aside
            draw_row(pen, views, colours, left=left, bottom=bottom, inches_per_metre=per_metre, gap=_GAP)
            pen.colour_bar(scale, PAGE_WIDTH - 0.75, bottom + 0.1 * tall, 0.16, 0.75 * tall)
