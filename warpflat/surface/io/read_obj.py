"""Wavefront OBJ, as far as a surface needs it: positions, polygons of any size, and line elements.

A reader of our own because trimesh cuts quads into triangles. A vertex is a `v` here, whatever texture coordinates and
normals its corners carry, so corners that a file splits per `vt` are whole again.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.surface.io.obj_arrays import read_arrays
from warpflat.surface.repair.polygons import pad_corners

__all__ = ["ObjMesh", "chain_lines", "read_obj"]

_AFTER_SLASH = re.compile(r"/\S*")
_CONTINUED = "\x1f"


@dataclass(kw_only=True)
class ObjMesh:
    """The contents of an OBJ file.

    Attributes:
        vertices: #V by 3, in file units.
        polygons: #F by the largest corner count, vertex indices from 0, filled up with -1.
        lines: line elements by the name of their group or object, each a list of chains of vertex indices.
        split_corners: the exporter wrote one `v` per texture coordinate.
        groups: objects and groups as (first vertex, name), in their order.
    """

    vertices: FloatArray
    polygons: NDArray[np.int64]
    lines: dict[str, list[list[int]]] = field(default_factory=dict)
    split_corners: bool = False
    groups: list[tuple[int, str]] = field(default_factory=list)


@dataclass
class _Statements:
    """The statements of a file: text after the keyword, line number, and number of `v` above."""

    vertices: list[str] = field(default_factory=list)
    vertex_line: list[int] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    face_line: list[int] = field(default_factory=list)
    face_seen: list[int] = field(default_factory=list)
    lines: list[tuple[str, str, int, int]] = field(default_factory=list)
    texture: int = 0
    groups: list[tuple[int, str]] = field(default_factory=list)


def read_obj(path: Path) -> ObjMesh:
    """Read an OBJ file.

    Raises:
        InputError: without the file's name, but with the line's number: for what is not OBJ, or not numbers.
    """
    raw = path.read_bytes()
    if b"\0" in raw:
        raise InputError("not an OBJ file: it holds binary data")
    if (mesh := _plain_mesh(raw.removeprefix(codecs.BOM_UTF8))) is not None:
        return mesh
    text = raw.decode("utf-8-sig", errors="replace")
    _check_last_line(text)
    statements = _collect(text)
    if not statements.vertices:
        raise InputError("not an OBJ file: no line of it is a vertex ('v x y z')")
    vertices = _numbers(statements)
    if not statements.faces:
        raise InputError(f"has no faces, only {len(vertices):,} points: export it as a mesh, with 'f' lines")
    polygons = _polygons(statements, len(vertices))
    return ObjMesh(
        vertices=vertices,
        polygons=polygons,
        lines=_line_elements(statements, len(vertices)),
        split_corners=_split_per_texture(statements, len(vertices)),
        groups=statements.groups,
    )


def _plain_mesh(raw: bytes) -> ObjMesh | None:
    """Return the contents of a plain file without its byte order mark; None if it has to be read line by line."""
    plain = read_arrays(raw)
    if plain is None:
        return None
    found, group = _Statements(), ""
    for number, seen, line in plain.others:
        group = _collect_line(found, line, number, seen, group)
    if found.vertices or found.faces or found.texture:
        return None
    return ObjMesh(
        vertices=plain.vertices,
        polygons=pad_corners(plain.corners, plain.counts),
        lines=_line_elements(found, len(plain.vertices)),
        split_corners=plain.split_corners,
        groups=found.groups,
    )


def _check_last_line(text: str) -> None:
    """Check that a file does not end within a face's corner: it does not say how long it should be."""
    _, _, last = text.rpartition("\n")
    if last.startswith("f ") and last.rstrip() == last and len({word.count("/") for word in last.split()[1:]}) > 1:
        raise InputError(f"is cut short: its last line is 'f {last[2:42]}', whose corners are not alike")


def _collect(text: str) -> _Statements:
    found = _Statements()
    # A continued line is joined, with a mark for each line it takes, so that line numbers stay right.
    if "\\" in text:
        text = re.sub(r"\\[ \t]*\r?\n", f" {_CONTINUED}", text)
    lines = text.split("\n")
    group = ""
    number = 0
    for line in lines:
        number += 1
        here = number
        if _CONTINUED in line:
            number += line.count(_CONTINUED)
            line = line.replace(_CONTINUED, " ")
        group = _collect_line(found, line, here, len(found.vertices), group)
    return found


def _collect_line(found: _Statements, line: str, number: int, seen: int, group: str) -> str:
    """Add the statement of a line that has `seen` vertices above it, and return the group from there on."""
    if "#" in line:
        line = line[: line.index("#")]
    key, _, rest = line.strip().replace("\t", " ").partition(" ")
    if key == "v":
        found.vertices.append(rest)
        found.vertex_line.append(number)
    elif key in ("f", "fo"):
        found.faces.append(rest)
        found.face_line.append(number)
        found.face_seen.append(seen)
    elif key == "vt":
        found.texture += 1
    elif key == "l":
        found.lines.append((group, rest, number, seen))
    elif key in ("g", "o") and rest.strip():
        group = rest.strip()
        found.groups.append((seen, group))
    return group


def _numbers(found: _Statements) -> FloatArray:
    """Return #V by 3; a fourth weight or colours after the position are left out."""
    rows = [text.split(None, 3)[:3] for text in found.vertices]
    try:
        return np.array(rows, dtype=np.float64).reshape(len(rows), 3)
    except ValueError:
        for row, text, line in zip(rows, found.vertices, found.vertex_line, strict=True):
            try:
                if len([float(word) for word in row]) == 3:
                    continue
            except ValueError:
                pass
            raise InputError(
                f"line {line}: 'v {text.strip()[:40]}' is not a position: expected three numbers"
            ) from None
        raise


def _polygons(found: _Statements, total: int) -> NDArray[np.int64]:
    corners = [_AFTER_SLASH.sub("", text).split() if "/" in text else text.split() for text in found.faces]
    count = np.fromiter((len(row) for row in corners), dtype=np.int64, count=len(corners))
    short = np.flatnonzero(count < 3)
    if len(short):
        raise InputError(_face_message(found, int(short[0]), f"has {count[short[0]]} corners; a face needs at least 3"))
    try:
        flat = np.array([word for row in corners for word in row], dtype=np.int64)
    except (ValueError, OverflowError):
        bad = next(i for i, row in enumerate(corners) if not all(re.fullmatch(r"[-+]?\d{1,18}", word) for word in row))
        raise InputError(_face_message(found, bad, "is not a face: expected vertex numbers")) from None
    seen = np.repeat(np.array(found.face_seen, dtype=np.int64), count)
    index = np.where(flat < 0, seen + flat, flat - 1)
    wrong = np.flatnonzero((index < 0) | (index >= total))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(count), wrong[0], side="right"))
        raise InputError(
            _face_message(found, face, f"refers to vertex {flat[wrong[0]]}, but the file has {total:,} (1 to {total})")
        )
    return pad_corners(index, count)


def _face_message(found: _Statements, face: int, what: str) -> str:
    return f"line {found.face_line[face]}: 'f {found.faces[face].strip()[:40]}' {what}"


def _split_per_texture(found: _Statements, total: int) -> bool:
    """Return whether all corners' texture coordinates have the numbers of their vertices: the exporter writes one `v` per `vt`."""
    if found.texture != total:
        return False
    pair = re.compile(r"^([-+]?\d+)/\1(/\S*)?$")
    return all(pair.match(corner) for text in found.faces for corner in text.split())


def _line_elements(found: _Statements, total: int) -> dict[str, list[list[int]]]:
    elements: dict[str, list[list[int]]] = {}
    for group, text, line, seen in found.lines:
        try:
            numbers = [int(word) for word in _AFTER_SLASH.sub("", text).split()]
        except ValueError:
            raise InputError(f"line {line}: 'l {text.strip()[:40]}' is not a line: expected vertex numbers") from None
        chain = [seen + n if n < 0 else n - 1 for n in numbers]
        if len(chain) < 2 or min(chain) < 0 or max(chain) >= total:
            raise InputError(
                f"line {line}: 'l {text.strip()[:40]}' needs two or more vertices, each one of the file's {total:,}"
            )
        elements.setdefault(group or "line", []).append(chain)
    return {name: chain_lines(chains) for name, chains in elements.items()}


def chain_lines(parts: list[list[int]]) -> list[list[int]]:
    """Join chains end to end where exactly two ends meet, since some exporters write every edge by itself."""
    ends: dict[int, list[int]] = {}
    for number, part in enumerate(parts):
        for vertex in {part[0], part[-1]}:
            ends.setdefault(vertex, []).append(number)
    left = dict(enumerate(parts))
    chains = []
    for number in range(len(parts)):
        if number not in left:
            continue
        chain = list(left.pop(number))
        for _ in range(2):
            while chain[0] != chain[-1]:
                meeting = ends.get(chain[-1], [])
                follow = [n for n in meeting if n in left]
                if len(meeting) != 2 or not follow:
                    break
                part = left.pop(follow[0])
                chain += (part if part[0] == chain[-1] else part[::-1])[1:]
            chain.reverse()
        chains.append(chain)
    return chains
