"""Checks that PLY and STL files are as long as their headers say; trimesh would read an ASCII PLY that is cut short."""

from __future__ import annotations

from pathlib import Path

from warpflat.core.errors import InputError

__all__ = ["check_ply", "check_stl"]


def check_ply(path: Path) -> None:
    """Check that an ASCII file has all rows that its header announces, each with all numbers of its lists.

    Trimesh checks the length of binary files, and refuses what is no header.

    Raises:
        InputError: without the file's name, but with the line's number.
    """
    head, found, body = path.read_bytes().partition(b"end_header")
    elements = _elements(head.decode("ascii", errors="replace"))
    if not found or not elements or b"ascii" not in head:
        return
    rows = body.decode("ascii", errors="replace").splitlines()[1:]
    above = head.count(b"\n") + 2
    at = 0
    for name, count, properties in elements:
        if at + count > len(rows):
            raise InputError(
                f"is cut short: it holds {max(len(rows) - at, 0):,} of its {count:,} rows of element {name!r}"
            )
        for number in range(at, at + count):
            if (reason := _fault(rows[number].split(), properties)) is not None:
                raise InputError(f"line {above + number}: {rows[number].strip()[:40]!r} is no {name!r}: {reason}")
        at += count


def check_stl(path: Path) -> None:
    """Check that a binary file is as long as its number of triangles requires; trimesh checks the end of text files.

    Raises:
        InputError: without the file's name.
    """
    with path.open("rb") as file:
        head = file.read(1000)
    size = path.stat().st_size
    count = int.from_bytes(head[80:84], "little")
    if b"facet" not in head.lower() and size != 84 + 50 * count:
        raise InputError(
            f"not a readable STL file: {size:,} bytes long, but its header tells of {count:,} triangles of 50 bytes each"
        )


def _elements(head: str) -> list[tuple[str, int, list[bool]]]:
    """Return each element's name, its count, and which of its properties are lists."""
    elements: list[tuple[str, int, list[bool]]] = []
    for line in head.splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == "element" and words[2].isdigit() and len(words[2]) < 12:
            elements.append((words[1], int(words[2]), []))
        elif len(words) > 1 and words[0] == "property" and elements:
            elements[-1][2].append(words[1] == "list")
    return elements


def _fault(words: list[str], properties: list[bool]) -> str | None:
    """Return what is wrong with a row, or None."""
    at = 0
    for is_list in properties:
        if at >= len(words):
            return f"{len(words)} numbers are too few"
        if is_list and not (words[at].isdigit() and len(words[at]) < 9):
            return f"{words[at][:20]!r} is not the length of a list"
        at += 1 + (int(words[at]) if is_list else 0)
    return None if at <= len(words) else f"its list is cut short, {at} numbers are needed"
