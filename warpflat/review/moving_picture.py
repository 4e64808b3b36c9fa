"""`film.webp` and `contact_sheet.png`: frames of a film as pictures, for mails and for tickets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.atomic_files import atomic_path, output_folder
from warpflat.core.errors import InputError
from warpflat.core.manifest import record_file
from warpflat.export.colours import energy_colours
from warpflat.export.raster import rasterise, shade
from warpflat.review.film import FilmPiece, Shape, open_film
from warpflat.review.page import read_run
from warpflat.surface.triangles import triangulate

__all__ = ["write_moving_pictures"]

_LONG_SIDE, _SHEET_SIDE = 720, 360
_FRAMES, _SHEET = 60, (4, 3)
_MARGIN = 12
_RATE = 24
_PAPER = 249


def write_moving_pictures(folder: Path, *, film: bool, sheet: bool) -> list[str]:
    """Write the pictures that are asked for, and return their names.

    Raises:
        InputError: the folder holds no film, or they cannot be written.
    """
    _, files, name = read_run(folder)
    if "frames.usdc" not in files:
        raise InputError(f"{folder}: has no frames.usdc of this run; run the scene with frames above 0")
    pieces = open_film(folder / "frames.usdc")
    written = []
    with output_folder(folder, [file for file, asked in (("film.webp", film), ("contact_sheet.png", sheet)) if asked]):
        if film:
            images = _images(pieces, _evenly(pieces[0].times, _FRAMES), _LONG_SIDE)
            _save(folder / "film.webp", images, loop=0, duration=_durations(pieces[0].times, len(images)), quality=80)
            written.append("film.webp")
        if sheet:
            columns, rows = _SHEET
            images = _images(pieces, _evenly(pieces[0].times, columns * rows), _SHEET_SIDE)
            while len(images) < columns * rows:
                images.append(np.full_like(images[0], _PAPER))
            lines = [np.concatenate(images[row * columns : (row + 1) * columns], axis=1) for row in range(rows)]
            _save(folder / "contact_sheet.png", [np.concatenate(lines)])
            written.append("contact_sheet.png")
        for file in written:
            record_file(folder, name, file)
    return written


def _evenly(times: Sequence[int], most: int) -> list[int]:
    picked = np.unique(np.round(np.linspace(0, len(times) - 1, min(most, len(times)))).astype(int))
    return [times[number] for number in picked]


def _durations(times: Sequence[int], count: int) -> list[int]:
    """Return how long each picture is shown [ms]; the last one for a second and a half."""
    return [round(1000 * len(times) / _RATE / count)] * (count - 1) + [1500]


def _images(pieces: Sequence[FilmPiece], times: Sequence[int], long_side: int) -> list[NDArray[np.uint8]]:
    """Return pictures of all patterns at these frames, RGB, of one size."""
    shapes = {piece.name: [piece.shape(change) for change in piece.changes] for piece in pieces}
    frames = [[_layout(piece, shapes[piece.name], time) for piece in pieces] for time in times]
    everything = np.concatenate([points for frame in frames for _, points, _ in frame])
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    scale = (long_side - 2 * _MARGIN) / float(size.max())
    shape = tuple(int(2 * np.ceil((extent * scale + 2 * _MARGIN) / 2)) for extent in size[::-1])
    return [_image(frame, low, scale, shape, pieces[0].scale) for frame in frames]


def _layout(piece: FilmPiece, shapes: Sequence[Shape], time: int) -> tuple[Shape, FloatArray, FloatArray]:
    at = min(time, piece.times[-1])
    shape = shapes[max(sum(change <= at for change in piece.changes) - 1, 0)]
    return shape, piece.positions(at, len(shape.surface)) + piece.offset[:2], piece.density(at)


def _image(
    frame: Sequence[tuple[Shape, FloatArray, FloatArray]],
    low: FloatArray,
    scale: float,
    shape: tuple[int, ...],
    energy: float,
) -> NDArray[np.uint8]:
    page = np.full((*shape, 3), float(_PAPER))
    for piece, points, density in frame:
        triangles, face = triangulate(piece.faces)
        grid = np.zeros((len(points), 3))
        grid[:, 0] = 2.0 * ((points[:, 0] - low[0]) * scale + _MARGIN)
        grid[:, 1] = 2.0 * (shape[0] - (points[:, 1] - low[1]) * scale - _MARGIN)
        samples = rasterise(grid, triangles, (2 * shape[0], 2 * shape[1]))
        pixels = shade(samples, 2, grid, triangles, energy_colours(density, energy), face=face)
        cover = pixels[..., 3:] / 255.0
        page = page * (1.0 - cover) + pixels[..., :3] * cover
    return np.round(page).astype(np.uint8)


def _save(path: Path, images: Sequence[NDArray[np.uint8]], **settings: Any) -> None:
    from PIL import Image

    pictures = [Image.fromarray(image) for image in images]
    more = {"save_all": True, "append_images": pictures[1:]} if len(pictures) > 1 else {}
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, format="WEBP" if path.suffix == ".webp" else "PNG", **more, **settings)
