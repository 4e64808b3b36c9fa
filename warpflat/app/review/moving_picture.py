"""`film.webp` and `contact_sheet.png`: frames of a film as pictures, for mails and for tickets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpflat.app.review.film import FilmPiece, open_film
from warpflat.app.review.page import read_run
from warpflat.core import FloatArray, InputError, reading
from warpflat.flat import border_edges
from warpflat.pattern import (
    DPI,
    FRAME_RATE,
    SMALLEST_SCALE,
    DrawnView,
    Facets,
    Pen,
    Scale,
    View,
    all_letters,
    atomic_path,
    output_folder,
    picture_of,
    record_file,
    write_moving_picture,
)

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["write_moving_pictures"]

_LONG_SIDE, _SHEET_SIDE = 680, 340  # of the patterns [pixels]
_FRAMES, _SHEET = 60, (4, 3)
_MARGIN, _FOOT, _NARROWEST = 0.08, 0.18, 2.2  # [in]; below a picture there is room for a line of words
_SIZE = 6.0  # [pt]


def write_moving_pictures(folder: Path, *, film: bool, sheet: bool) -> list[str]:
    """Write the pictures that are asked for, and return their names.

    Raises:
        InputError: the folder holds no film, or they cannot be written.
    """
    from PIL import Image

    _, files, name = read_run(folder)
    if "frames.usdc" not in files:
        raise InputError(f"{folder}: has no frames.usdc of this run; run the scene with frames above 0")
    asked = [file for file, wanted in (("film.webp", film), ("contact_sheet.png", sheet)) if wanted]
    with output_folder(folder, asked, guard=True), reading(folder / "frames.usdc", "film", noted=False):
        pieces = open_film(folder / "frames.usdc")
        if film:
            images = _images(pieces, _evenly(pieces[0].times, _FRAMES), _LONG_SIDE)
            each = round(1000 * len(pieces[0].times) / FRAME_RATE / len(images))
            write_moving_picture(folder / "film.webp", images, each=each, last=1500)
        if sheet:
            columns, rows = _SHEET
            images = _images(pieces, _evenly(pieces[0].times, columns * rows), _SHEET_SIDE)
            cell = images[0].size
            page = Image.new("RGB", (columns * cell[0], rows * cell[1]), "white")
            for number, image in enumerate(images):
                page.paste(image, (number % columns * cell[0], number // columns * cell[1]))
            with atomic_path(folder / "contact_sheet.png") as temporary:
                page.save(temporary, format="PNG")
        for file in asked:
            record_file(folder, name, file)
    return asked


def _evenly(times: Sequence[int], most: int) -> list[int]:
    picked = np.unique(np.round(np.linspace(0, len(times) - 1, min(most, len(times)))).astype(int))
    return [times[number] for number in picked]


def _images(pieces: Sequence[FilmPiece], times: Sequence[int], long_side: int) -> list[Image.Image]:
    """Return pictures of all patterns at these frames, RGB, of one size."""
    facets = dict[tuple[int, ...], Facets]()
    views, densities = list[View](), list[FloatArray]()
    for time in times:
        numbers = tuple(piece.number(time) for piece in pieces)
        points = [piece.positions(time) + piece.offset[:2] for piece in pieces]
        if numbers not in facets:
            shown = [piece.shapes[number].faces for piece, number in zip(pieces, numbers, strict=True)]
            counts = np.cumsum([0, *map(len, points)])
            joined = [np.where(faces >= 0, faces + first, -1) for faces, first in zip(shown, counts, strict=False)]
            together = np.concatenate(joined).astype(np.int32)
            facets[numbers] = Facets.of(together, border_edges(together))
        views.append(View.of_pattern(np.concatenate(points), facets[numbers], {}))
        densities.append(np.concatenate([piece.density(time) for piece in pieces]))
    low = np.min([view.low for view in views], axis=0)
    size = np.max([view.low + view.size for view in views], axis=0) - low
    first, images = pieces[0], []
    scale, per_metre = Scale(high=first.scale), long_side / DPI / float(size.max())
    wide, high = (per_metre * float(side) + 2 * _MARGIN for side in size[:2])
    with all_letters():
        pen = Pen(max(wide, _NARROWEST), high + _FOOT)
        if first.scale > SMALLEST_SCALE:
            limit = f"{first.scale:.3g} J/m²"
            end = pen.width - _MARGIN - pen.measure(limit, _SIZE)[0] - 0.05
            bar = pen.colour_bar(scale, end - 0.6, 0.1, 0.6, 0.08, extend="neither")
            bar.set_ticks([])
        for view, density, time in zip(views, densities, times, strict=True):
            pen.clear()
            left, bottom = (view.low - low)[:2] * per_metre + (_MARGIN, _MARGIN + _FOOT)
            drawn = DrawnView(pen, view, left=float(left), bottom=float(bottom), inches_per_metre=per_metre)
            drawn.draw(scale.rgb(density), outline=0.5)
            words = f"{first.measure('stage', time) or 'frame'} {time}/{first.times[-1]}"
            pen.write(_MARGIN, 0.14, words, _SIZE)
            if first.scale <= SMALLEST_SCALE:
                pen.write(pen.width - _MARGIN, 0.14, "no strain", _SIZE, ha="right")
            else:
                pen.write(end - 0.65, 0.14, "0", _SIZE, ha="right")
                pen.write(end + 0.05, 0.14, limit, _SIZE)
            images.append(picture_of(pen.figure))
    return images
