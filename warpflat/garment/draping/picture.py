"""The pictures of a drape.

`drape.png`: the garment on the body from three sides, with maps of gap, strain and shear; `compare-drape.png`: it in several cloths;
`drape.webp`: how it comes to rest; `corrected.png`: the outlines of the pieces before and after the correction of the pattern.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray
from warpflat.garment.draping.frames import choose_frames, gap_scale
from warpflat.garment.draping.result import Drape
from warpflat.pattern import (
    LEAST_GAP,
    LEAST_PRESSURE,
    PAGE_WIDTH,
    PIXELS_AROUND,
    SIDES,
    Body,
    Facets,
    Scale,
    Shot,
    View,
    corner_mean,
    draw_row,
    drawn_page,
    dress,
    on_paper,
    outline_edges,
    view_from_side,
    write_moving_picture,
)

if TYPE_CHECKING:
    from warpflat.garment.draping.correct_pattern import Correction

__all__ = ["write_compared_drapes", "write_correction_picture", "write_drape_film", "write_drape_picture"]

_TALLEST, _TALLEST_COMPARED, _TOP, _MARGIN, _BAR, _GAP = 8.0, 4.2, 0.48, 0.3, 1.0, 0.2  # [in]
# Of the film: pictures in a second, and their height [pixels].
_RATE, _FILM_HEIGHT = 12, 420


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


def write_drape_film(path: str | os.PathLike[str], drape: Drape) -> None:
    """Draw the frames from the front, the left and the back as a moving picture, coloured by the gap to the body.

    Raises:
        InputError: the file cannot be written.
    """
    from PIL import Image

    scale, count = gap_scale(drape), len(drape.positions)
    everything = np.concatenate(drape.frames).astype(np.float64)
    dressed, facets, skin = _dressed(drape, everything)
    # All frames show the same room, as high as the picture.
    shown = np.concatenate([everything, dressed[facets.used[facets.used >= count]]])
    per_metre = (_FILM_HEIGHT - 2 * PIXELS_AROUND) / float(np.ptp(shown[:, 1]))
    rooms = dict[float, FloatArray]()
    for _, degrees in SIDES:
        rooms[degrees] = shown @ view_from_side(dressed, facets, degrees).directions.T
    pictures = []
    for number in choose_frames(drape.frames):
        points = drape.frames[number].astype(np.float64)
        colours = np.concatenate([scale.rgb(corner_mean(drape.body.gaps(points), drape.cloth.faces)), skin])
        sides = []
        for degrees, room in rooms.items():
            view = view_from_side(np.concatenate([points, dressed[count:]]), facets, degrees)
            shot = Shot(view, per_metre, low=room.min(axis=0), size=np.ptp(room, axis=0))
            sides.append(on_paper(shot.pixels(colours)))
        pictures.append(Image.fromarray(np.concatenate(sides, axis=1)))
    write_moving_picture(path, pictures, each=1000 // _RATE, last=2000)


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
        "gap to the body [mm]": (gaps, Scale.from_zero(np.concatenate(gaps), areas, LEAST_GAP)),
        "strain of the more strained thread [%]": (
            strains,
            Scale.both_ways(np.concatenate(strains), areas, 0.5, most),
        ),
        "shear [degrees]": (shears, Scale.both_ways(np.concatenate(shears), areas, 0.5, most_sheared)),
        _PRESSURE: (pressures, Scale.from_zero(np.concatenate(pressures), areas, 1e-3 * LEAST_PRESSURE)),
    }


def _dressed(drape: Drape, room: FloatArray | None = None) -> tuple[FloatArray, Facets, FloatArray]:
    """Return vertices and facets of the worn cloth and of the body around it or a `room`, and the colours of the body's faces."""
    body = Body(vertices=drape.body.shrunk, faces=drape.body.triangles)
    return dress(body, drape.positions, drape.cloth.faces, room)


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


# Of a correction: room between pieces [m], inches per metre, the largest page [in], and colours before and after.
_BETWEEN, _SCALE, _LARGEST, _BEFORE, _AFTER = 0.06, 8.0, 60.0, "#8a8a8a", "#c8452c"
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
        x += float(high[0] - low[0]) + _BETWEEN
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
