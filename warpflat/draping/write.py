"""The files of a drape."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpflat.core.atomic_files import file_in, output_folder
from warpflat.draping.picture import write_drape_picture
from warpflat.draping.result import Drape
from warpflat.export.obj import write_obj
from warpflat.surface.mesh import Surface

__all__ = ["save_drape", "write_drape_files"]


def save_drape(drape: Drape, folder: str | Path, *, picture: bool = True) -> list[str]:
    """Write `NAME.draped.obj` per piece and `drape.png`, all of them or none, and return their names.

    Raises:
        InputError: the folder cannot be written.
    """
    sources = [source for piece in drape.pieces.values() for source in piece.surface.sources]
    with output_folder(folder, ["drape.png"] if picture else [], sources=sources) as to:
        return write_drape_files(drape, to, picture=picture)


def write_drape_files(drape: Drape, folder: Path, *, picture: bool = True) -> list[str]:
    """Write the files into a folder in a block of :func:`warpflat.core.atomic_files.output_folder`, and return their names.

    Raises:
        InputError: the folder cannot be written.
    """
    files = []
    for name, piece in drape.pieces.items():
        space = drape.positions[drape.cloth.welded[drape.cloth.piece_vertices[name]]]
        surface = Surface(
            vertices=space, faces=piece.faces, name=name, input_vertices=space,
            input_index=np.arange(len(space), dtype=np.int32),
        )  # fmt: skip
        path = file_in(folder, name, ".draped.obj")
        write_obj(path, surface, piece.positions)
        files.append(path.name)
    if picture:
        files.append("drape.png")
        write_drape_picture(folder / files[-1], drape)
    return files
