"""The pictures of a drape.

`drape.png`: the garment on the body from three sides, with maps of gap, strain and shear; `compare-drape.png`: it in several cloths;
`drape.webp`: how it comes to rest; `corrected.png`: the outlines of the pieces before and after the correction of the pattern.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray
from warpflat.flat import border_edges, corner_means
from warpflat.garment.draping.frames import choose_frames, gap_scale
from warpflat.garment.draping.result import Drape
from warpflat.pattern import (
    LEAST_GAP,
    LEAST_PRESSURE,
    PIXELS_AROUND,
    SIDES,
    Body,
    Facets,
    Scale,
    Shot,
    View,
    drawn_page,
    dress,
    write_maps,
    write_moving_picture,
)

if TYPE_CHECKING:
    from warpflat.garment.draping.correct_pattern import Correction

__all__ = ["write_compared_drapes", "write_correction_picture", "write_drape_film", "write_drape_picture"]

# Of the film: pictures in a second, their height [pixels], and the paper below them.
_RATE, _FILM_HEIGHT, _PAPER = 12, 420, (249, 249, 249, 255)


def write_drape_picture(path: str | os.PathLike[str], drape: Drape) -> None:
    """Draw the gap to the body, the strain of the threads and the shear on the worn garment, each from three sides.

    Raises:
        InputError: the file cannot be written.
    """
    worst = next((place.words for place in drape.places if place.kind != "bridged"), "it lies as designed")
    title = f"{drape.cloth.fabric.name}; {'' if drape.converged else 'NOT AT REST; '}{worst}"
    points, facets, skin = _dressed(drape)
    maps = {name: (scale, [found] * len(SIDES)) for name, (scale, [found]) in _maps([drape], [skin]).items()}
    del maps[_PRESSURE]
    write_maps(path, title, View.around(points, facets), maps, tallest=8.0)


def write_compared_drapes(path: str | os.PathLike[str], drapes: Mapping[str, Drape]) -> None:
    """Draw gap, strain, shear and pressure of each drape from the front, a column per cloth.

    Raises:
        InputError: the file cannot be written.
    """
    dressed = {name: _dressed(drape) for name, drape in drapes.items()}
    views = {name: View.from_side(points, facets, 0.0) for name, (points, facets, _) in dressed.items()}
    maps = _maps(list(drapes.values()), [skin for _, _, skin in dressed.values()])
    write_maps(path, "", views, maps, tallest=4.2)


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
    rooms = [shown @ view.directions.T for view in View.around(dressed, facets).values()]
    pictures = []
    for number in choose_frames(drape.frames):
        points = drape.frames[number].astype(np.float64)
        colours = np.concatenate([scale.rgb(corner_means(drape.body.gaps(points), drape.cloth.faces)), skin])
        views = View.around(np.concatenate([points, dressed[count:]]), facets).values()
        shots = [
            Shot(view, per_metre, low=room.min(axis=0), size=np.ptp(room, axis=0))
            for view, room in zip(views, rooms, strict=True)
        ]
        sides = Image.fromarray(np.concatenate([shot.pixels(colours) for shot in shots], axis=1))
        pictures.append(Image.alpha_composite(Image.new("RGBA", sides.size, _PAPER), sides).convert("RGB"))
    write_moving_picture(path, pictures, each=1000 // _RATE, last=2000)


_PRESSURE = "pressure [kPa]"


def _maps(drapes: list[Drape], skins: list[FloatArray]) -> dict[str, tuple[Scale, list[FloatArray]]]:
    """Return by title the scale that all drapes share for a map, and the colours of the faces of each, with those of the body."""
    areas, limits = np.concatenate([drape.face_areas for drape in drapes]), [drape.cloth.fabric for drape in drapes]

    def stretched(drape: Drape) -> FloatArray:
        warp, weft = drape.strains["warp"], drape.strains["weft"]
        return np.asarray(100.0 * np.where(np.abs(warp) > np.abs(weft), warp, weft))

    def coloured(values: list[FloatArray], ends: Callable[..., Scale], *bounds: float) -> Any:
        scale = ends(np.concatenate(values), areas, *bounds)
        return scale, [np.concatenate([scale.rgb(each), skin]) for each, skin in zip(values, skins, strict=True)]

    gaps = [1e3 * corner_means(drape.gap, drape.cloth.faces) for drape in drapes]
    pressures = [1e-3 * corner_means(drape.pressure, drape.cloth.faces) for drape in drapes]
    strain, shear = 100.0 * max(f.strain_limit for f in limits), max(f.shear_limit for f in limits)
    return {
        "gap to the body [mm]": coloured(gaps, Scale.from_zero, LEAST_GAP),
        "strain of the more strained thread [%]": coloured([*map(stretched, drapes)], Scale.both_ways, 0.5, strain),
        "shear [degrees]": coloured([drape.strains["shear"] for drape in drapes], Scale.both_ways, 0.5, shear),
        _PRESSURE: coloured(pressures, Scale.from_zero, 1e-3 * LEAST_PRESSURE),
    }


def _dressed(drape: Drape, room: FloatArray | None = None) -> tuple[FloatArray, Facets, FloatArray]:
    """Return vertices and facets of the worn cloth and of the body around it or a `room`, and the colours of the body's faces."""
    body = Body(vertices=drape.body.shrunk, faces=drape.body.triangles)
    return dress(body, drape.positions, drape.cloth.faces, room)


# Of a correction: room between pieces [m], inches per metre, margin and largest page [in], and colours before and after.
_BETWEEN, _SCALE, _MARGIN, _LARGEST, _BEFORE, _AFTER = 0.06, 8.0, 0.3, 60.0, "#8a8a8a", "#c8452c"
# Changes of the outline that are written beside it: the largest ones of a piece, so far apart [m].
_LABELS, _APART, _LEAST = 6, 0.08, 1e-3


def write_correction_picture(path: str | os.PathLike[str], correction: Correction) -> None:
    """Draw the outlines before in grey and after in red, with the largest changes in millimetres; positive is outwards.

    Raises:
        InputError: the file cannot be written.
    """
    old, new, moved = correction.before.cloth, correction.after.cloth, correction.moved()
    edges = border_edges(old.flat_faces)
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
