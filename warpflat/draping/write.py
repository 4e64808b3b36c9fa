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
    with output_folder(folder, ["drape.png"] if picture else [], sources=drape.sources) as to:
        return write_drape_files(drape, to, picture=picture)


def write_drape_files(drape: Drape, folder: Path, *, picture: bool = True) -> list[str]:
    """Write the files into a folder in a block of :func:`warpflat.core.atomic_files.output_folder`, and return their names.

    Raises:
        InputError: the folder cannot be written.
    """
    files = []
    cloth = drape.cloth
    for name, rows in cloth.piece_vertices.items():
        space, faces = drape.positions[cloth.welded[rows]], cloth.flat_faces[cloth.piece_faces[name]]
        surface = Surface(
            vertices=space, faces=np.where(faces >= 0, faces - rows.start, -1).astype(np.int32), name=name,
            input_vertices=space, input_index=np.arange(len(space), dtype=np.int32),
        )  # fmt: skip
        path = file_in(folder, name, ".draped.obj")
        write_obj(path, surface, cloth.flat[rows])
        files.append(path.name)
    if picture:
        files.append("drape.png")
        write_drape_picture(folder / files[-1], drape)
    return files
