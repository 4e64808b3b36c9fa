"""`metrics.json`: plain JSON at full precision."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from warpflat.core.atomic_files import atomic_path

__all__ = ["plain_json", "write_json"]


def write_json(path: str | os.PathLike[str], data: Mapping[str, Any]) -> None:
    """Write `data` as JSON, atomically, keys in their order, numbers with every digit that tells them apart.

    NumPy scalars and arrays become numbers and lists. JSON has no word for NaN or infinity: both are written as
    ``null``, "no number", so that any reader can read the file.

    Raises:
        InputError: the file cannot be written.
        TypeError: a value has no meaning in JSON; the message says at which key.
    """
    text = json.dumps(plain_json(data), indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plain_json(value: Any, where: str = "metrics") -> Any:
    """Return a value as what JSON has: see :func:`write_json`."""
    if isinstance(value, np.generic | np.ndarray):
        return plain_json(value.tolist(), where)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        wrong = [key for key in value if not isinstance(key, str)]
        if wrong:
            raise TypeError(f"{where}: the key {wrong[0]!r} is not text")
        return {key: plain_json(entry, f"{where}.{key}") for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(entry, f"{where}[{index}]") for index, entry in enumerate(value)]
    raise TypeError(f"{where}: a {type(value).__name__} cannot be written as JSON")
