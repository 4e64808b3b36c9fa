"""OFF, as far as a surface needs it: positions, and polygons of any size.

A reader of our own, as trimesh takes each line for a face and does not notice files that are cut short. In the format, line ends
only end the colour of a face or a vertex.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.raw_mesh import RawMesh
from warpflat.flat.surface.repair.polygons import pad_corners

__all__ = ["read_off"]

_HEADER = re.compile(r"\s*(ST)?(C)?(N)?OFF\b[ \t]*")


def read_off(path: Path) -> RawMesh:
    """Read an OFF file.

    Raises:
        InputError: without the file's name: what is not OFF, not a number, or missing.
    """
    text = re.sub(r"#[^\n]*", "", path.read_bytes().decode("utf-8-sig", errors="replace"))
    header = _HEADER.match(text)
    if header is None:
        raise InputError("not an OFF file: it does not begin with OFF, or is binary, or of four dimensions")
    rows = [row for line in text[header.end() :].splitlines() if (row := line.split())]
    try:
        points, faces = (int(word) for word in rows[0][:2])
    except (ValueError, IndexError):
        raise InputError(
            "not a readable OFF file: the counts of vertices and faces do not follow its first word"
        ) from None
    rest = [rows[0][3:], *rows[1:]] if len(rows[0]) > 3 else rows[1:]
    # Without a normal, a colour or a texture coordinate there is nothing on a vertex's line but vertices.
    if any(header.groups()) or (points > 0 and all(len(row) > 3 for row in rest[:points])):
        vertices, faces_at = [row[:3] for row in rest[:points]], rest[points:]
    else:
        # The vertices are threes of words, wherever lines end.
        words: list[str] = []
        taken = 0
        while taken < len(rest) and len(words) < 3 * points:
            words += rest[taken]
            taken += 1
        after = [words[3 * points :]] if len(words) > 3 * points else []
        vertices = [words[i : i + 3] for i in range(0, min(len(words), 3 * points) - 2, 3)]
        faces_at = [*after, *rest[taken:]]
    if min(points, faces) < 0 or len(vertices) < points:
        raise InputError(f"is cut short: it holds {len(vertices):,} of its {points:,} vertices")
    try:
        positions = np.array(vertices, dtype=np.float64).reshape(points, 3)
    except ValueError:
        raise InputError("not a readable OFF file: a vertex is not three numbers") from None
    # A face may run over several lines; what follows it on its last one is its colour.
    corners: list[list[str]] = []
    lines = iter(faces_at)
    for row in lines:
        if len(corners) == faces:
            break
        size = int(row[0]) if re.fullmatch(r"\d{1,9}", row[0]) else 0
        if size < 3:
            raise InputError(
                f"face {len(corners)} (counted from 0): {row[0][:40]!r} is not its count of corners, 3 or more"
            )
        words = row[1:]
        while len(words) < size and (more := next(lines, None)) is not None:
            words += more
        if len(words) < size:
            break
        corners.append(words[:size])
    if len(corners) < faces:
        raise InputError(f"is cut short: it holds {len(corners):,} of its {faces:,} faces")
    if not corners:
        raise InputError(f"has no faces, only {points:,} points: export it as a mesh")
    sizes = np.array([len(face) for face in corners], dtype=np.int64)
    try:
        flat = np.array([word for face in corners for word in face], dtype=np.int64)
    except (ValueError, OverflowError):
        raise InputError("not a readable OFF file: a corner of a face is not the number of a vertex") from None
    wrong = np.flatnonzero((flat < 0) | (flat >= points))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(sizes), wrong[0], side="right"))
        raise InputError(
            f"face {face} (counted from 0) refers to vertex {flat[wrong[0]]}, but there are {points:,} (0 to {points - 1})"
        )
    return RawMesh(vertices=positions, polygons=pad_corners(flat, sizes))
