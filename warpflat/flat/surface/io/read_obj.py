"""Wavefront OBJ, as far as a surface needs it: positions, polygons of any size, and line elements.

Trimesh would cut quads into triangles. A vertex is a `v` here, whatever texture coordinates and
normals its corners carry, so corners that a file splits per `vt` are whole again.
"""

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import chain_lines, join_labels
from warpflat.flat.surface.io.raw_mesh import RawMesh, following_corners, line_name, numbered
from warpflat.flat.surface.repair.polygons import pad_corners

__all__ = ["read_obj"]

_CONTINUED, _JOINT = re.compile(r"^(?:[^\n]*\\ *\r?\n)+[^\n]*", re.MULTILINE), re.compile(r"\\ *\r?\n")
_AFTER_SLASH = re.compile(r"/\S*")
_POSITION = re.compile(
    r"\s*(?:[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?(?:\s+|$)|[-+]?(?:nan|inf|infinity)(?:\s+|$)){3}", re.IGNORECASE
)
_CORNER = re.compile(r"[-+]?\d{1,18}(?:/|$)")
_SAME_TEXTURE = re.compile(r"([-+]?\d+)/\1(?:/\S*)?$")
_TEXTURE = re.compile(r"[^\s/]+(?:/([-+]?\d{1,18})?\S*)?")


def read_obj(path: Path) -> RawMesh:
    """Read an OBJ file.

    Line elements along edges are chains of vertices, others are curves; both have the name of their group or object.

    Raises:
        InputError: without the file's name, but with the line's number: for what is not OBJ, or not numbers.
    """
    raw = path.read_bytes()
    if b"\0" in raw:
        raise InputError("not an OBJ file: it holds binary data")
    text = raw.decode("utf-8-sig", errors="replace").replace("\t", " ")
    # A file does not say how long it should be: it may end within a face's corner.
    _, _, last = text.rpartition("\n")
    if last.startswith("f ") and last.rstrip() == last and len({word.count("/") for word in last.split()[1:]}) > 1:
        raise InputError(f"is cut short: its last line is 'f {last[2:42]}', whose corners are not alike")
    # A continued line is joined; empty lines follow it, so that line numbers stay right.
    if "\\" in text:
        text = _CONTINUED.sub(lambda found: _JOINT.sub(" ", found[0]) + "\n" * found[0].count("\n"), text)

    # Rows are the text after a keyword, with their line numbers.
    vertices, vertex_line, faces, face_line = list[str](), list[int](), list[str](), list[int]()
    elements, starts, group, whole = list[tuple[str, str, int, int]](), list[tuple[int, str]](), "", ""
    textures, texture_line, material = list[str](), list[int](), ""
    of_material, of_group, of_object = list[str](), list[str](), list[str]()
    for number, line in enumerate(text.split("\n"), start=1):
        if "#" in line:
            line = line[: line.index("#")]
        key, _, rest = line.strip().partition(" ")
        if key == "v":
            vertices.append(rest)
            vertex_line.append(number)
        elif key in ("f", "fo"):
            faces.append(rest)
            face_line.append(number)
            of_material.append(material)
            of_group.append(group)
            of_object.append(whole)
        elif key == "vt":
            textures.append(rest)
            texture_line.append(number)
        elif key == "usemtl":
            material = rest.strip()
        elif key == "l":
            elements.append((group, rest, number, len(vertices)))
        elif key in ("g", "o") and rest.strip():
            group = rest.strip()
            whole = group if key == "o" else whole
            starts.append((len(vertices), group))
    positions = _positions(vertices, vertex_line)
    if not faces:
        raise InputError(f"has no faces, only {len(positions):,} points: export it as a mesh, with 'f' lines")
    polygons = _polygons(faces, face_line, vertex_line)
    texture, notes = _texture_of_corners(textures, texture_line, faces, face_line, polygons >= 0)
    mesh = RawMesh(
        vertices=positions,
        polygons=polygons,
        # All corners' texture coordinates have the numbers of their vertices: the exporter wrote one `v` per `vt`.
        split_corners=len(textures) == len(positions)
        and all(map(_SAME_TEXTURE.match, chain.from_iterable(row.split() for row in faces))),
        # One object may hold groups that are pieces.
        objects=_objects(
            polygons, of_object if len(set(of_object)) > 1 or len(set(of_group)) < 2 else of_group, starts
        ),
        texture=texture,
        face_material=numbered(of_material),
        face_group=numbered(of_group),
        notes=notes,
    )
    if elements:
        # The sides of all polygons in both directions, each as one number: tail * number of vertices + head.
        a, b = (
            each[polygons >= 0] for each in (polygons, np.take_along_axis(polygons, following_corners(polygons), 1))
        )
        sides = np.unique(np.concatenate([a * len(positions) + b, b * len(positions) + a]))
        for name, row in _line_elements(elements, len(positions)).items():
            if np.isin(row[:-1] * len(positions) + row[1:], sides).all():
                mesh.chains[name] = row
            else:
                mesh.curves[name] = positions[row]
    return mesh


def _positions(rows: list[str], lines: list[int]) -> FloatArray:
    """Return the positions (#V by 3) of rows of text, and in `lines` where each stands; what follows three numbers is left out."""
    if not rows:
        raise InputError("not an OBJ file: no line of it is a vertex ('v x y z')")
    words = chain.from_iterable(row.split(None, 3)[:3] for row in rows)
    try:
        if "_" in "".join(rows):  # as Python writes 1_000
            raise ValueError
        return np.fromiter(map(float, words), dtype=np.float64, count=3 * len(rows)).reshape(-1, 3)
    except ValueError:
        bad = next((k for k, row in enumerate(rows) if not _POSITION.match(row)), 0)
        raise InputError(
            f"line {lines[bad]}: 'v {rows[bad].strip()[:40]}' is not a position: expected three numbers"
        ) from None


def _polygons(faces: list[str], face_line: list[int], vertex_line: list[int]) -> NDArray[np.int64]:
    """Return the vertices of faces (#F by k, filled up with -1), given as text, with the lines on which faces and vertices stand."""

    def refusal(face: int, what: str) -> InputError:
        return InputError(f"line {face_line[face]}: 'f {faces[face].strip()[:40]}' {what}")

    corners = [row.split() for row in faces]
    count = np.fromiter(map(len, corners), dtype=np.int64, count=len(corners))
    if count.min() < 3:
        raise refusal(int(count.argmin()), f"has {count.min()} corners; a face needs at least 3")
    numbers = _AFTER_SLASH.sub("", " ".join(faces))
    try:
        given = np.fromiter(map(int, numbers.split()), dtype=np.int64)
        if "_" in numbers or len(given) != count.sum():
            raise ValueError
    except (ValueError, OverflowError):
        bad = next((k for k, row in enumerate(corners) if not all(map(_CORNER.match, row))), 0)
        raise refusal(bad, "is not a face: expected vertex numbers") from None
    # Negative numbers count back from the face.
    total, seen = len(vertex_line), np.repeat(np.searchsorted(vertex_line, face_line), count)
    index = np.where(given < 0, seen + given, given - 1)
    wrong = np.flatnonzero((index < 0) | (index >= total))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(count), wrong[0], side="right"))
        raise refusal(face, f"refers to vertex {given[wrong[0]]}, but the file has {total:,} (1 to {total})")
    return pad_corners(index, count)


def _objects(
    polygons: NDArray[np.int64], names: list[str], starts: list[tuple[int, str]]
) -> tuple[list[tuple[int, str]], NDArray[np.int64]]:
    """Return the objects as (first vertex, name), and #F, the one of each face; those that share vertices are one, without a name.

    Vertices stand behind the name of their object, before it, or all at the top of the file. Where objects have theirs in turn, each
    counts them from its first; otherwise all count them as the file does.

    Args:
        polygons: #F by k.
        names: of the object of each face, "" for none.
        starts: names as the file has them, and how many vertices stand above each.
    """
    label, titles = numbered(names)
    used = polygons >= 0
    of_corner, vertex = np.repeat(label, used.sum(axis=1)), polygons[used]
    total = int(vertex.max()) + 1
    joined = join_labels(total + len(titles), vertex, total + of_corner)[total:]
    classes, of = np.unique(joined, return_inverse=True)
    title = [titles[int(np.flatnonzero(of == k)[0])] if (of == k).sum() == 1 else "" for k in range(len(classes))]
    low, high = np.full(len(classes), total), np.full(len(classes), -1)
    np.minimum.at(low, of[of_corner], vertex)
    np.maximum.at(high, of[of_corner], vertex)
    order = np.argsort(low)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    found, before = list[tuple[int, str]](), -1
    in_turn = bool((high[order[:-1]] < low[order[1:]]).all())
    for k in order.tolist():
        told = [start for start, name in starts if name == title[k] and before < start <= low[k]]
        first = max(told, default=int(low[k]) if found else 0) if in_turn else 0
        found.append((first, title[k]))
        before = int(high[k])
    return found, place[of[label]]


def _texture_of_corners(
    rows: list[str], lines: list[int], faces: list[str], face_line: list[int], real: NDArray[np.bool_]
) -> tuple[FloatArray | None, list[str]]:
    """Return the texture coordinates of corners (#F by k by 2), None if there are none; and a note where they are damaged.

    Args:
        rows: the coordinates as text, and in `lines` where each stands.
        faces: the corners as text, and in `face_line` where each face stands.
        real: #F by k, where a face has a corner.
    """
    words = _TEXTURE.findall(" ".join(faces)) if rows else []
    if not any(words):
        return None, []
    try:
        coordinates = np.array([[float(word) for word in [*row.split(), "0"][:2]] for row in rows])
        given = np.array([int(word or 0) for word in words], dtype=np.int64)
    except (ValueError, OverflowError):
        return None, ["texture coordinates that are no two numbers: all were left out"]
    if len(given) != real.sum():
        return None, ["faces whose texture coordinates are no numbers: all were left out"]
    seen = np.repeat(np.searchsorted(lines, face_line), real.sum(axis=1))
    index = np.where(given < 0, seen + given, given - 1)
    known = (given != 0) & (index >= 0) & (index < len(coordinates))
    notes = ["faces refer to texture coordinates that the file does not have"] if (~known & (given != 0)).any() else []
    texture = np.full((*real.shape, 2), np.nan)
    texture[real] = np.where(known[:, None], coordinates[np.where(known, index, 0)], np.nan)
    return texture, notes


def _line_elements(rows: list[tuple[str, str, int, int]], total: int) -> dict[str, NDArray[np.int64]]:
    """Return the line elements, joined end to end, by the names of their groups; rows are (group, text, line number, vertices above it)."""
    elements: dict[str, list[list[int]]] = {}
    for group, text, line, seen in rows:
        try:
            numbers = [int(word) for word in _AFTER_SLASH.sub("", text).split()]
        except ValueError:
            raise InputError(f"line {line}: 'l {text.strip()[:40]}' is not a line: expected vertex numbers") from None
        path = [seen + n if n < 0 else n - 1 for n in numbers]
        if len(path) < 2 or min(path) < 0 or max(path) >= total:
            raise InputError(
                f"line {line}: 'l {text.strip()[:40]}' needs two or more vertices, each one of the file's {total:,}"
            )
        elements.setdefault(group or "line", []).append(path)
    found = dict[str, NDArray[np.int64]]()
    for name, paths in elements.items():
        chains = chain_lines(paths)
        for number, row in enumerate(chains, start=1):
            found[line_name(name, number, len(chains), found)] = np.array(row, dtype=np.int64)
    return found
