"""The files of a mannequin: ``mannequin.usdc``, ``mannequin.obj``, ``metrics.json``, ``picture.png``, ``distances.png``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from warpflat._version import __version__
from warpflat.garment.mannequin.picture import write_distance_picture, write_mannequin_picture
from warpflat.garment.mannequin.usd import write_mannequin_usd
from warpflat.pattern import atomic_path, optional_file, output_folder, write_report

if TYPE_CHECKING:
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["MANNEQUIN_FILES", "write_mannequin", "write_mannequin_obj"]

MANNEQUIN_FILES = {
    "usd": "mannequin.usdc",
    "obj": "mannequin.obj",
    "picture": "picture.png",
    "distances": "distances.png",
    "metrics": "metrics.json",
}


def write_mannequin(mannequin: Mannequin, folder: str | os.PathLike[str]) -> dict[str, Path]:
    """Write a mannequin's files into a folder, all of them or none.

    Args:
        mannequin: the body.
        folder: made if missing.

    Returns:
        the files by kind: ``usd``, ``obj``, ``picture``, of a scan ``distances``, ``metrics``; metrics come last, so where they
            are the rest is. A picture that cannot be drawn is left out, with a note in the metrics.

    Raises:
        InputError: if a file cannot be written, or the body was read from one that would be replaced.
    """
    names = {kind: name for kind, name in MANNEQUIN_FILES.items() if mannequin.scan is not None or kind != "distances"}
    with output_folder(folder, names.values(), sources=mannequin.sources, guard=True) as place:
        files = {kind: place / name for kind, name in names.items()}
        write_mannequin_usd(mannequin, files["usd"])
        write_mannequin_obj(mannequin, files["obj"])
        drawn = list[str]()
        with optional_file(files["picture"], drawn) as path:
            write_mannequin_picture(mannequin, path)
        if mannequin.scan is not None:
            with optional_file(files["distances"], drawn) as path:
                write_distance_picture(mannequin, path)
        files = {kind: path for kind, path in files.items() if path.suffix != ".png" or path.name in drawn}
        written = [path.name for path in files.values()]
        metrics = {"schema": 1, "warpflat": __version__, "mannequin": mannequin.metrics()}
        write_report(place / "metrics.json", metrics, name="mannequin", files=written)
    return files


def write_mannequin_obj(mannequin: Mannequin, path: str | os.PathLike[str]) -> None:
    """Write the bricks as groups (``g``) of quads and the lines as line elements (``l``), metres, Y up.

    The object ``mannequin`` is the body, the object ``tube`` the bricks around both legs, on which skirts are made.

    Raises:
        InputError: if the file cannot be written.
    """
    layout = mannequin.layout
    rows: list[str] = [f"# warpflat mannequin, {mannequin.source}"]
    rows += [f"v {x!r} {y!r} {z!r}" for x, y, z in mannequin.vertices.tolist()]
    for part, on_body in (("mannequin", True), ("tube", False)):
        rows.append(f"o {part}")
        for index, name in enumerate(layout.bricks):
            faces = layout.faces[(layout.face_brick == index) & (layout.on_body == on_body)]
            rows += [f"g {name}"] * bool(len(faces))
            rows += [f"f {a + 1} {b + 1} {c + 1} {d + 1}" for a, b, c, d in faces.tolist()]
    for name, ids in layout.lines.items():
        rows += [f"g line:{name.replace(' ', '_')}", "l " + " ".join(str(i + 1) for i in ids.tolist())]
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(rows) + "\n", encoding="utf-8", newline="\n")
