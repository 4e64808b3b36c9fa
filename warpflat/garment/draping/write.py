"""The files of a drape."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from warpflat.garment.draping.frames import write_drape_frames
from warpflat.garment.draping.picture import write_drape_film, write_drape_picture
from warpflat.garment.draping.result import Drape
from warpflat.garment.draping.sewn_cloth import worn_surface
from warpflat.pattern import file_in, latest_file, optional_file, output_folder, write_obj, write_sewn_usd

__all__ = ["files_of_drape", "save_drape", "write_drape_files"]


def files_of_drape(pieces: Iterable[str], *, picture: bool, frames: bool, usd: bool) -> list[str]:
    """Return the names of the files that :func:`write_drape_files` writes for pieces, if no picture or film is left out."""
    shared = {"worn.usdc": usd, "drape.png": picture, "frames.usdc": frames, "drape.webp": picture and frames}
    return [*(f"{piece}.draped.obj" for piece in pieces), *(file for file, wanted in shared.items() if wanted)]


def save_drape(
    drape: Drape, folder: str | Path, *, picture: bool = True, frames: bool = False, usd: bool = False
) -> list[str]:
    """Write `NAME.draped.obj` per piece, `drape.png` and, for frames, `drape.webp`, all of them or none.

    With `usd` the worn garment is written as one mesh with its pattern, too: `worn.usdc`, see :mod:`warpflat.pattern.export.sewn_usd`. With
    frames the way to rest is added to the folder's `frames.usdc`, or a new one is written.

    Returns:
        The names of the files, without those of pictures and film that had to be left out.

    Raises:
        InputError: the folder cannot be written.
    """
    names = files_of_drape(drape.cloth.piece_vertices, picture=picture, frames=frames, usd=usd)
    with output_folder(folder, names, sources=drape.sources) as to:
        return write_drape_files(drape, to, picture=picture, frames=frames, usd=usd)


def write_drape_files(
    drape: Drape, folder: Path, *, picture: bool = True, frames: bool = False, usd: bool = False
) -> list[str]:
    """Write the files into a folder in a block of :func:`warpflat.pattern.files.output.output_folder`.

    Returns:
        Their names, without those of pictures and film that had to be left out.

    Raises:
        InputError: the folder cannot be written.
    """
    files = []
    cloth = drape.cloth
    for name, rows in cloth.piece_vertices.items():
        space, faces = drape.positions[cloth.welded[rows]], cloth.flat_faces[cloth.piece_faces[name]]
        path = file_in(folder, name, ".draped.obj")
        write_obj(path, worn_surface(name, space, np.where(faces >= 0, faces - rows.start, -1)), cloth.flat[rows])
        files.append(path.name)
    if usd:
        write_sewn_usd(
            folder / "worn.usdc", drape.positions, cloth.faces, cloth.flat, cloth.flat_faces, cloth.piece_faces
        )
        files.append("worn.usdc")
    if picture:
        with optional_file(folder / "drape.png", files) as path:
            write_drape_picture(path, drape)
    if frames:
        film = folder / "frames.usdc"
        with optional_file(film, files, part="the drape" if latest_file(film).exists() else ""):
            write_drape_frames(film, drape)
        if picture:
            with optional_file(folder / "drape.webp", files) as path:
                write_drape_film(path, drape)
    return list(dict.fromkeys(files))
