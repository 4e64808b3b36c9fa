"""Plain OBJ files read by arrays: lines of one keyword after the other are parsed together, not one by one.

Whatever is not plain, such as comments within a face, negative indices or a number that is none, is left to the reader by lines, which says
in one line what is wrong with it.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["ObjArrays", "read_arrays"]

Bytes = NDArray[np.uint8]
Index = NDArray[np.int64]

# Lines that are parsed together.
_TOGETHER = 100_000
# A file whose lines of one keyword are shorter runs than this on average gains nothing.
_LEAST_RUN = 32
_SPACE = 32
_BLANK_V, _BLANK_F = bytes.maketrans(b"v", b" "), bytes.maketrans(b"f/", b"  ")
_OTHER, _VERTEX, _FACE, _TEXTURE, _NORMAL = range(5)


class _NotPlainError(ValueError):
    """The file is not plain."""


@dataclass(frozen=True, kw_only=True)
class ObjArrays:
    """The contents of a plain OBJ file.

    Attributes:
        vertices: #V by 3, in file units.
        corners: vertex indices from 0, one face after the other.
        counts: #F, the number of corners of each.
        others: lines of other keywords as (number of the line from 1, vertices above it, text).
        split_corners: each corner's texture coordinate has the number of its vertex, and there are as many.
    """

    vertices: FloatArray
    corners: Index
    counts: Index
    others: list[tuple[int, int, str]]
    split_corners: bool


def read_arrays(raw: bytes) -> ObjArrays | None:
    """Return the contents of an OBJ file; None if it is not plain, or has an error that a reader by lines will name.

    Args:
        raw: the whole file.
    """
    if b"\\" in raw or b"\0" in raw:
        return None
    text = np.frombuffer(raw, dtype=np.uint8)
    begins = np.concatenate([[0], np.flatnonzero(text == ord("\n")) + 1, [len(text) + 1]])
    kinds = _kinds(text, begins[:-1])
    first = np.concatenate([[0], np.flatnonzero(kinds[1:] != kinds[:-1]) + 1])
    if len(first) * _LEAST_RUN > len(kinds):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # by which numpy says that it did not read to the end
            return _read_runs(raw, begins, kinds, [*first.tolist(), len(kinds)])
    except (ValueError, DeprecationWarning):
        return None


def _kinds(text: Bytes, begins: Index) -> NDArray[np.uint8]:
    """Return the keyword of each line."""
    padded = np.concatenate([text[-3:], np.full(3, _SPACE, dtype=np.uint8)])
    last = len(text) - len(padded) + 3

    def at(shift: int) -> Bytes:
        # The last lines may end before their third character.
        place = begins + shift
        inside = place < len(text)
        return np.where(inside, text[np.where(inside, place, 0)], padded[np.clip(place - last, 0, len(padded) - 1)])

    one, two, three = at(0), at(1), at(2)
    is_v, short, long = one == ord("v"), (two == _SPACE) | (two == 9), (three == _SPACE) | (three == 9)
    kinds = np.full(len(begins), _OTHER, dtype=np.uint8)
    kinds[is_v & short] = _VERTEX
    kinds[(one == ord("f")) & short] = _FACE
    kinds[is_v & (two == ord("t")) & long] = _TEXTURE
    kinds[is_v & (two == ord("n")) & long] = _NORMAL
    return kinds


def _read_runs(raw: bytes, begins: Index, kinds: NDArray[np.uint8], firsts: list[int]) -> ObjArrays:
    """Read the lines from each of `firsts` to the next one, which have the same keyword."""
    vertices, corners, counts = list[FloatArray](), list[Index](), list[Index]()
    others = list[tuple[int, int, str]]()
    seen = textures = 0
    split = True
    for begin, end in pairwise(firsts):
        kind = kinds[begin]
        if kind == _TEXTURE:
            textures += end - begin
        elif kind == _OTHER:
            lines = raw[begins[begin] : begins[end] - 1].split(b"\n")
            others += [(begin + 1 + row, seen, line.decode(errors="replace")) for row, line in enumerate(lines)]
        elif kind in (_VERTEX, _FACE):
            for low in range(begin, end, _TOGETHER):
                high = min(low + _TOGETHER, end)
                part = raw[begins[low] : begins[high] - 1]
                tokens = _count_tokens(part, begins[low:high] - begins[low])
                if kind == _VERTEX:
                    vertices.append(_positions(part, tokens))
                    continue
                index, same = _corners(part, int(tokens.sum()))
                corners.append(index)
                counts.append(tokens)
                split = split and same
                if index.min() < 0 or index.max() >= 2**31 or tokens.min() < 3:
                    raise _NotPlainError
            seen += end - begin if kind == _VERTEX else 0
    if not vertices or not corners:
        raise _NotPlainError
    positions, flat = np.concatenate(vertices), np.concatenate(corners)
    if flat.max() >= len(positions):
        raise _NotPlainError
    return ObjArrays(
        vertices=positions,
        corners=flat,
        counts=np.concatenate(counts),
        others=others,
        split_corners=split and textures == len(positions),
    )


def _count_tokens(part: bytes, begins: Index) -> Index:
    """Return the number of words of each line after its keyword; `begins` are the lines' first bytes in `part`."""
    if b"#" in part:
        raise _NotPlainError
    is_word = np.frombuffer(part, dtype=np.uint8) > _SPACE
    starts = np.flatnonzero(is_word[1:] & ~is_word[:-1]) + 1
    # The keyword is at a line's first byte, after a space: it is a start but in the first line.
    found = np.diff(np.searchsorted(starts, np.append(begins, len(part))))
    found[1:] -= 1
    return found.astype(np.int64)


def _positions(part: bytes, tokens: Index) -> FloatArray:
    """Return #V by 3; further numbers, a weight or colours, are left out."""
    width = int(tokens[0])
    if width < 3 or (tokens != width).any():
        raise _NotPlainError
    values = np.fromstring(part.translate(_BLANK_V), dtype=np.float64, sep=" ")
    if len(values) != width * len(tokens):
        raise _NotPlainError
    return values.reshape(-1, width)[:, :3]


def _corners(part: bytes, count: int) -> tuple[Index, bool]:
    """Return the vertex of each of `count` corners, from 0, and whether all have texture coordinates of their vertices' numbers."""
    slashes, doubled = part.count(b"/"), part.count(b"//")
    if slashes % count or doubled not in (0, count) or (doubled and slashes != 2 * count) or slashes > 2 * count:
        raise _NotPlainError
    each = slashes // count
    numbers = 1 + each - (doubled > 0)
    if each and not _is_even(part, each):
        raise _NotPlainError
    values = np.fromstring(part.translate(_BLANK_F), dtype=np.int64, sep=" ")
    if len(values) != count * numbers:
        raise _NotPlainError
    table = values.reshape(count, numbers)
    has_texture = numbers > 1 and not doubled
    return table[:, 0] - 1, has_texture and bool((table[:, 0] == table[:, 1]).all())


def _is_even(part: bytes, each: int) -> bool:
    """Return whether all corners have so many slashes."""
    text = np.frombuffer(part, dtype=np.uint8)
    marks = text[(text == ord("/")) | ((text <= _SPACE) & (np.append(text[1:], _SPACE) > _SPACE))] == ord("/")
    # Slashes between the beginnings of words: none before the first, and none in keywords, which begin words, too.
    words = np.flatnonzero(~marks)
    found = np.diff(np.append(words, len(marks))) - 1
    return bool(((found == each) | (found == 0)).all()) and int((found == each).sum()) * each == int(marks.sum())
