"""Feature lines of a file, followed through the repair of its mesh."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.core.file_names import check_label
from warpflat.core.text import quote_value

__all__ = ["checked_line", "renumber_lines"]


def checked_line(name: str, line: ArrayLike, size: int) -> NDArray[np.int64]:
    """Return a line of a file of `size` vertices as an array.

    Raises:
        InputError: it is no row of its vertices.
    """
    check_label(name, "lines")
    path = np.asarray(line)
    if path.ndim != 1 or len(path) < 2 or not np.issubdtype(path.dtype, np.integer):
        raise InputError(f"line {quote_value(name)} must be a list of at least two vertex indices")
    wrong = path[(path < 0) | (path >= size)]
    if len(wrong):
        raise InputError(
            f"line {quote_value(name)} refers to vertex {wrong[0]}, but there are {size:,} (0 to {size - 1})"
        )
    return path.astype(np.int64)


def renumber_lines(
    index: IntArray, edges: IntArray, paths: Mapping[str, IntArray]
) -> tuple[dict[str, list[int]], list[str]]:
    """Return lines given in input rows, in the mesh's own vertices, and a note for each that is off it and left out.

    Args:
        index: #V, the input row of each vertex.
        edges: #E by 2, of the mesh.
        paths: input rows by name.

    Raises:
        InputError: a line leaves the mesh.
    """
    lines: dict[str, list[int]] = {}
    if not paths:
        return lines, []
    notes = []
    places: dict[int, list[int]] = {}
    wanted = np.isin(index, np.concatenate(list(paths.values())))
    for vertex in np.flatnonzero(wanted).tolist():
        places.setdefault(int(index[vertex]), []).append(vertex)
    joined = {tuple(edge) for edge in edges.tolist()}
    for name, path in paths.items():
        rows = [row for i, row in enumerate(path.tolist()) if i == 0 or row != path[i - 1]]
        if not any(row in places for row in rows):
            notes.append(f"line {quote_value(name)} does not lie on the piece and was left out")
            continue
        lines[name] = _trace_line(name, rows, places, joined)
    return lines, notes


def _trace_line(
    name: str, rows: list[int], places: dict[int, list[int]], edges: Iterable[tuple[int, ...]]
) -> list[int]:
    missing = [row for row in rows if row not in places]
    if missing:
        raise InputError(f"line {quote_value(name)} leaves the piece at vertex {missing[0]} (counted from 0)")
    line: list[int] = []
    for i, row in enumerate(rows):
        choice = places[row]
        if i > 0:
            choice = [v for v in choice if (min(v, line[-1]), max(v, line[-1])) in edges]
            if not choice:
                raise InputError(
                    f"line {quote_value(name)} breaks between vertices {rows[i - 1]} and {row} (counted from 0): no edge there"
                )
        elif len(choice) > 1 and len(rows) > 1:
            follow = places[rows[1]]
            choice = [v for v in choice if any((min(v, w), max(v, w)) in edges for w in follow)] or choice
        line.append(choice[0])
    return line
