"""`film.webp` and `contact_sheet.png`: frames of a film as pictures, for mails and for tickets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpflat.app.review.film import FilmPiece, open_film
from warpflat.app.review.page import read_run
from warpflat.core import InputError, IntArray, atomic_path, output_folder, reading, record_file
from warpflat.flat import triangulate
from warpflat.pattern import SMALLEST_SCALE, energy_colours, outline_edges, rasterise, shade, write_moving_picture

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["write_moving_pictures"]

_LONG_SIDE, _SHEET_SIDE = 720, 360
_FRAMES, _SHEET = 60, (4, 3)
_MARGIN = 12
_RATE = 24
_PAPER = 249
_INK, _OUTLINE = (38, 40, 48), 200
# Room for the line below a picture.
_FOOT = 18


def write_moving_pictures(folder: Path, *, film: bool, sheet: bool) -> list[str]:
    """Write the pictures that are asked for, and return their names.

    Raises:
        InputError: the folder holds no film, or they cannot be written.
    """
    from PIL import Image

    _, files, name = read_run(folder)
    if "frames.usdc" not in files:
        raise InputError(f"{folder}: has no frames.usdc of this run; run the scene with frames above 0")
    written = []
    asked = [file for file, wanted in (("film.webp", film), ("contact_sheet.png", sheet)) if wanted]
    with output_folder(folder, asked, guard=True), reading(folder / "frames.usdc", "film", noted=False):
        pieces = open_film(folder / "frames.usdc")
        if film:
            images = _images(pieces, _evenly(pieces[0].times, _FRAMES), _LONG_SIDE)
            count = len(images)
            # The last frame stays for a moment.
            durations = [round(1000 * len(pieces[0].times) / _RATE / count)] * (count - 1) + [1500]
            write_moving_picture(folder / "film.webp", images, durations)
            written.append("film.webp")
        if sheet:
            columns, rows = _SHEET
            images = _images(pieces, _evenly(pieces[0].times, columns * rows), _SHEET_SIDE)
            cell = images[0].size
            page = Image.new("RGB", (columns * cell[0], rows * cell[1]), (_PAPER,) * 3)
            for number, image in enumerate(images):
                page.paste(image, (number % columns * cell[0], number // columns * cell[1]))
            with atomic_path(folder / "contact_sheet.png") as temporary:
                page.save(temporary, format="PNG")
            written.append("contact_sheet.png")
        for file in written:
            record_file(folder, name, file)
    return written


def _evenly(times: Sequence[int], most: int) -> list[int]:
    picked = np.unique(np.round(np.linspace(0, len(times) - 1, min(most, len(times)))).astype(int))
    return [times[number] for number in picked]


def _images(pieces: Sequence[FilmPiece], times: Sequence[int], long_side: int) -> list[Image.Image]:
    """Return pictures of all patterns at these frames, RGB, of one size."""
    from PIL import Image, ImageDraw

    topologies = dict[str, list[_Drawn]]()
    for piece in pieces:
        for shape in map(piece.shape, piece.changes):
            triangles, face = triangulate(shape.faces)
            drawn = _Drawn(triangles=triangles, face=face, edges=outline_edges(shape.faces), count=len(shape.surface))
            topologies.setdefault(piece.name, []).append(drawn)
    frames = []
    for time in times:
        frame = []
        for piece in pieces:
            at = min(time, piece.times[-1])
            drawn = topologies[piece.name][max(sum(change <= at for change in piece.changes) - 1, 0)]
            frame.append((drawn, piece.positions(at, drawn.count) + piece.offset[:2], piece.density(at)))
        frames.append(frame)
    everything = np.concatenate([points for frame in frames for _, points, _ in frame])
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    scale = (long_side - 2 * _MARGIN - _FOOT) / float(size.max())
    wide, high = (int(2 * np.ceil((extent * scale + 2 * _MARGIN) / 2)) for extent in size)
    first, images = pieces[0], list[Image.Image]()
    for frame, time in zip(frames, times, strict=True):
        # The patterns, coloured by energy, with their outlines.
        colours = np.full((high, wide, 3), float(_PAPER))
        lines = Image.new("L", (2 * wide, 2 * high))
        pen = ImageDraw.Draw(lines)
        for drawn, points, density in frame:
            grid = np.zeros((len(points), 3))
            grid[:, 0] = 2.0 * ((points[:, 0] - low[0]) * scale + _MARGIN)
            grid[:, 1] = 2.0 * (high - (points[:, 1] - low[1]) * scale - _MARGIN)
            samples = rasterise(grid, drawn.triangles, (2 * high, 2 * wide))
            pixels = shade(samples, 2, grid, drawn.triangles, energy_colours(density, first.scale), face=drawn.face)
            cover = pixels[..., 3:] / 255.0
            colours = colours * (1.0 - cover) + pixels[..., :3] * cover
            for begin, end in grid[drawn.edges, :2].tolist():
                pen.line((*begin, *end), fill=_OUTLINE, width=2)
        image = Image.fromarray(np.round(colours).astype(np.uint8))
        image.paste(_INK, mask=lines.reduce(2))
        # The line below: which frame it is, and the scale of its colours.
        page = Image.new("RGB", (wide, high + _FOOT), (_PAPER,) * 3)
        page.paste(image)
        pen, middle = ImageDraw.Draw(page), high + _FOOT // 2 - 2
        words = f"{first.measure('stage', time) or 'frame'} {time}/{first.times[-1]}"
        pen.text((_MARGIN, middle), words, fill=_INK, anchor="lm")
        if first.scale <= SMALLEST_SCALE:
            pen.text((wide - _MARGIN, middle), "no strain", fill=_INK, anchor="rm")
        else:
            limit = f"{first.scale:.3g} J/m2"  # the font has no superscripts
            right = wide - _MARGIN - int(pen.textlength(limit))
            ramp = np.round(255.0 * energy_colours(np.linspace(0.0, 1.0, 60), 1.0)).astype(np.uint8)
            page.paste(Image.fromarray(np.tile(ramp, (8, 1, 1))), (right - 66, middle - 4))
            for x, text in ((right - 76, "0"), (right, limit)):
                pen.text((x, middle), text, fill=_INK, anchor="lm")
        images.append(page)
    return images


@dataclass(frozen=True, kw_only=True, eq=False)
class _Drawn:
    """What is drawn of a piece in one topology: triangles (#T by 3), the face of each, border edges (#B by 2), number of vertices."""

    triangles: IntArray
    face: IntArray
    edges: IntArray
    count: int
