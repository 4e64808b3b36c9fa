"""Plain tables laid over each other, and written as TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

__all__ = ["document_as_toml", "laid_over", "tables_as_toml"]


def tables_as_toml(tables: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Return arrays of plain tables, as `cuts` and `seams`, as TOML to be pasted into a scene, numbers with six digits."""
    return "\n".join(
        f"[[{name}]]\n" + "".join(f"{key} = {_value(value, 6)}\n" for key, value in table.items())
        for name, rows in tables.items()
        for table in rows
    )


def document_as_toml(tables: Mapping[str, Any]) -> str:
    """Return nested tables as a TOML file, every number with all its digits."""
    return "\n".join(_document_lines(tables, ())) + "\n"


def _document_lines(table: Mapping[str, Any], place: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table: its plain values, its tables, its arrays of tables."""
    below: list[tuple[str, Any]] = []
    for key, value in table.items():
        if isinstance(value, Mapping) or (
            value and isinstance(value, list) and all(isinstance(each, Mapping) for each in value)
        ):
            below.append((key, value))
        else:
            yield f"{_key(key)} = {_value(value)}"
    for key, value in below:
        inner = (*place, key)
        name = ".".join(map(_key, inner))
        for head, one in [(f"[{name}]", value)] if isinstance(value, Mapping) else [(f"[[{name}]]", v) for v in value]:
            yield ""
            yield head
            yield from _document_lines(one, inner)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key, ensure_ascii=False)


def _value(value: Any, digits: int | None = None) -> str:
    """Return a value on one line, a number with so many digits or with all of them; JSON's texts are TOML's, too."""
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence):
        return f"[{', '.join(_value(each, digits) for each in value)}]"
    return repr(value) if digits is None else f"{value:.{digits}g}"


def laid_over(base: Mapping[str, Any], other: Mapping[str, Any], *, joins: bool = True) -> dict[str, Any]:
    """Return a table with another one laid over it: tables are merged, lists of tables put together if it joins, other values replaced."""
    found = dict(base)
    for key, value in other.items():
        own = found.get(key)
        if isinstance(own, Mapping) and isinstance(value, Mapping):
            found[key] = laid_over(own, value, joins=joins)
        elif (
            joins
            and isinstance(own, list)
            and isinstance(value, list)
            and all(isinstance(each, Mapping) for each in (*own, *value))
        ):
            found[key] = [*own, *value]
        else:
            found[key] = value
    return found
