"""Measurements of a body: size tables, completion by proportion, and what is refused."""

from __future__ import annotations

import functools
import importlib.resources
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpflat.errors import InputError, is_number, nearest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["Measurements", "measurements_from_size", "measurements_from_values", "size_names", "size_tables"]


@dataclass(frozen=True, kw_only=True)
class Measurements:
    """A complete set of measurements and level heights of one body.

    Attributes:
        lengths: every measurement by name [m]; girths are those of the convex hull, as a tape takes them.
        heights: height of every level and of nape, side_neck, front_neck, underarm above the floor [m].
        body: whose cross-sections are used, ``women`` or ``men``.
        source: where the numbers come from, for metrics and messages.
        notes: one sentence for each measurement that was not given but completed.
    """

    lengths: Mapping[str, float]
    heights: Mapping[str, float]
    body: str
    source: str
    notes: tuple[str, ...] = field(default=())


@functools.cache
def size_tables() -> dict[str, Any]:
    """The contents of ``data/sizes.toml``: size tables, completion rules, cross-sections, valid ranges."""
    text = importlib.resources.files("warpflat.data").joinpath("sizes.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def size_names() -> list[str]:
    """Every size that can be asked for, as it is typed: ``EU 38``, ``UK 10``, ``US 8``, ``JIS 9AR``, ``men 50``."""
    names: list[str] = []
    for table in size_tables()["tables"].values():
        names += [f"{table['label']} {size}" for size in table["sizes"]]
        names += list(table.get("aliases", {}))
    return names


def measurements_from_size(size: str) -> Measurements:
    """The measurements of a size of the tables.

    Args:
        size: a name of :func:`size_names`, optionally with a stature in centimetres: ``men 50/182``.

    Raises:
        InputError: if no table has the size, or the stature is out of range.
    """
    name, _, tall = size.partition("/")
    wanted = _plain(name)
    for key, table in size_tables()["tables"].items():
        aliases = {_plain(a): s for a, s in table.get("aliases", {}).items()}
        known = {_plain(f"{table['label']} {s}"): s for s in table["sizes"]} | aliases
        if wanted not in known:
            continue
        values = {k: v / 100.0 for k, v in table["sizes"][known[wanted]].items()}
        values["stature"] = _stature(tall, size) if tall else table["stature"] / 100.0
        step = table.get("stature_step")
        if step:
            by = (values["stature"] * 100.0 - table["stature"]) / step["per"]
            for k, v in step.items():
                if k != "per":
                    values[k] += by * v / 100.0
        label = f"size {table['label']} {known[wanted]} ({table['source']}; grade {table['grade']})"
        return _complete(values, table.get("complete_from", key), label)
    raise InputError(f"size {size!r} is in no table: {nearest(name, size_names())}")


def measurements_from_values(*, table: str = "women", **given: float) -> Measurements:
    """Measurements that a user gives, the missing ones completed by a table's proportions.

    Args:
        table: ``women`` or ``men``: whose proportions and cross-sections complete the rest.
        given: lengths [m] by name: bust, waist, hip, neck, shoulder, stature, ... At least bust, waist or hip.

    Raises:
        InputError: for an unknown name, a value outside its valid range, or two values that no body has together.
    """
    ranges = size_tables()["valid"]["range"]
    tables = {k for k, t in size_tables()["tables"].items() if "complete_from" not in t}
    if table not in tables:
        raise InputError(f"measurements: table {table!r} is unknown: {nearest(table, tables)}")
    for name, value in given.items():
        if name not in ranges:
            raise InputError(f"measurement {name!r} is unknown: {nearest(name, ranges)}")
        if not is_number(value):
            raise InputError(f"measurement {name} = {value!r}: a number of metres is needed")
        low, high = (v / 100.0 for v in ranges[name])
        if not math.isfinite(value) or not low <= value <= high:
            raise InputError(f"measurement {name} = {value:g} m: valid range {low:g} to {high:g} m")
    if not {"bust", "waist", "hip"} & set(given):
        raise InputError("measurements: give at least one of bust, waist, hip (in metres)")
    values = {k: float(v) for k, v in given.items()}
    return _complete(values, table, f"measurements, {table}'s proportions", check=True)


def _plain(name: str) -> str:
    return re.sub(r"[\s_\-']+", "", name).lower()


def _stature(text: str, size: str) -> float:
    low, high = size_tables()["valid"]["range"]["stature"]
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise InputError(f"size {size!r}: stature after '/' must be {low:g} to {high:g} cm")
    return value / 100.0


def _complete(values: dict[str, float], table_name: str, source: str, *, check: bool = False) -> Measurements:
    data = size_tables()
    table = data["tables"][table_name]
    body = data["bodies"][table["body"]]
    lengths = dict(values)
    notes: list[str] = []

    def fill(name: str, value: float, how: str) -> None:
        lengths[name] = value
        notes.append(f"{name} = {value * 100:.1f} cm {how}")

    if "stature" not in lengths:
        fill("stature", table["stature"] / 100.0, f"is the {table_name} table's stature")
    key = next(k for k in ("bust", "waist", "hip") if k in values)
    for name in next(iter(table["sizes"].values())):
        if name not in lengths:
            fill(name, _along_table(table, key, values[key], name), f"from {key} by the {table_name} table")
    for name, rule in body["complete"].items():
        if name in lengths:
            continue
        if "of" in rule:
            fill(name, rule["share"] * lengths[rule["of"]], f"is {rule['share']:g} of {rule['of']}")
        else:
            a, b = rule["between"]
            fill(name, (1 - rule["at"]) * lengths[a] + rule["at"] * lengths[b], f"lies between {a} and {b}")
    if check:
        _check_ratios(lengths, set(values))
    return Measurements(
        lengths=lengths, heights=_heights(lengths, body), body=table["body"], source=source, notes=tuple(notes)
    )


def _along_table(table: Mapping[str, Any], key: str, value: float, name: str) -> float:
    """`name` [m] where `key` = `value` [m], linear between the table's sizes and beyond its ends."""
    x = np.array([s[key] for s in table["sizes"].values()], float)
    y = np.array([s[name] for s in table["sizes"].values()], float)
    at = value * 100.0
    inside = float(np.interp(at, x, y))
    slope = (y[-1] - y[0]) / (x[-1] - x[0])
    beyond = at - min(max(at, x[0]), x[-1])
    # Bones grow less than girths: what lies beyond the table's ends must not run off to nothing or to a giant.
    return max(inside + slope * beyond, 0.55 * y[0]) / 100.0


def _check_ratios(lengths: Mapping[str, float], given: set[str]) -> None:
    for top, bottom, low, high in size_tables()["valid"]["ratio"].values():
        if not {top, bottom} & given:
            continue
        ratio = lengths[top] / lengths[bottom]
        if low <= ratio <= high:
            continue
        name, other = (top, bottom) if top in given else (bottom, top)
        if name == top:
            ends = (low * lengths[bottom], high * lengths[bottom])
        else:
            ends = (lengths[top] / high, lengths[top] / low)
        raise InputError(
            f"measurement {name} = {lengths[name]:g} m does not go with {other} = {lengths[other]:.3g} m: "
            f"valid range {ends[0]:.2f} to {ends[1]:.2f} m"
        )


def _heights(lengths: Mapping[str, float], body: Mapping[str, Any]) -> dict[str, float]:
    """Height of every level and landmark above the floor [m]."""
    stature = lengths["stature"]
    if "heights_mm" in body:
        by = (stature * 100.0 - 176.0) / 6.0
        h = {k: (base + by * step) / 1000.0 for k, (base, step) in body["heights_mm"].items()}
        h["underarm"] = h["nape"] - lengths["armscye_depth"]
        h["bust"] = min(h["bust"], h["underarm"] - 0.03)
    else:
        h = {k: share * stature for k, share in body["heights"].items()}
        # The nape-waist tape follows the back's curve, so the waist lies a little less deep than its length.
        h["waist"] = h["nape"] - 0.985 * lengths["nape_to_waist"]
        h["underarm"] = h["nape"] - lengths["armscye_depth"]
        h["bust"] = min(h["bust"], h["underarm"] - 0.032)
        h["side_neck"] = h["nape"] - 0.008 * stature
        h["front_neck"] = h["nape"] - 0.0385 * stature
    h["hip"] = min(h["hip"], h["waist"] - 0.11)
    h["thigh"] = min(h["thigh"], h["hip"] - 0.05)
    h["underbust"] = h["bust"] - 0.40 * (h["bust"] - h["waist"])
    h["abdomen"] = h["waist"] - 0.42 * (h["waist"] - h["hip"])
    return h
