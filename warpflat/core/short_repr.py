"""What a result with large arrays shows of itself."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

__all__ = ["short_repr"]

# Letters of a value that is shown whole.
_SHORT = 40


def short_repr(result: Any) -> str:
    """Return a dataclass in one line: short values as they are, arrays by their shape, others by their kind and number."""
    shown = []
    for each in fields(result):
        value = getattr(result, each.name) if each.repr else None
        if isinstance(value, np.ndarray):
            shown.append(f"{each.name}: {' x '.join(map(str, value.shape))}")
        elif isinstance(value, str | int | float | bool) and len(repr(value)) <= _SHORT:
            shown.append(f"{each.name}={value!r}")
        elif isinstance(value, Collection) and not isinstance(value, str):
            shown.append(f"{each.name}: {len(value)}")
        elif is_dataclass(value):
            shown.append(f"{each.name}: {getattr(value, 'name', '') or type(value).__name__}")
    return f"<{type(result).__name__} {', '.join(shown)}>"
