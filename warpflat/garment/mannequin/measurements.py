"""Measurements of a body: size tables, completion by proportion, and checks."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import numpy as np

from warpflat.core import InputError, expect, is_number, nearest, read_toml

__all__ = [
    "BELOW_CROTCH",
    "TAKEN_ALONG",
    "Measurements",
    "measurements_from_size",
    "measurements_from_values",
    "size_names",
    "size_table",
    "size_tables",
]


#: By measurement where it is taken on a body: a line, or a head, hand or foot.
TAKEN_ALONG = {
    "head": "head", "neck": "neck", "shoulder": "shoulder left", "bust": "bust", "underbust": "underbust",
    "chest_width": "chest front", "back_width": "chest back", "waist": "waist", "abdomen": "abdomen", "hip": "hip",
    "thigh": "thigh", "knee": "knee", "ankle": "ankle", "upper_arm": "biceps left", "elbow": "elbow left", "wrist": "wrist left",
    "hand": "hand left", "arm_length": "overarm left", "inside_leg": "inseam left", "thigh_girth": "thigh left",
    "knee_girth": "knee left", "calf_girth": "calf left", "ankle_girth": "ankle left", "foot": "foot left",
}  # fmt: skip
#: What measurements are called elsewhere.
_OTHER_NAMES = {
    "height": "stature", "body_height": "stature", "chest": "bust", "hips": "hip", "seat": "hip", "inseam": "inside_leg",
    "inside_leg_length": "inside_leg", "biceps": "upper_arm", "bicep": "upper_arm", "sleeve": "arm_length",
    "back_length": "nape_to_waist", "under_bust": "underbust",
}  # fmt: skip
#: A body of a lower stature [m] is completed as a child's: one woman in a hundred is not as tall.
_GROWN = 1.46
#: The thigh's tape lies so far below the crotch, as a share of the stature: nearer sections hold a part of the seat.
BELOW_CROTCH = 0.03
#: How far the stature [cm] of a size for short and for tall people lies from the table's, as in the sizes of the German trade.
_STATURES = {"petite": -8.0, "tall": 8.0}


@dataclass(frozen=True, kw_only=True)
class Measurements:
    """A complete set of measurements and level heights of one body.

    Attributes:
        lengths: every measurement by name [m]; girths are those of the convex hull, as a tape takes them.
        heights: height of every level and of nape, side_neck, front_neck, underarm above the floor [m].
        body: whose cross-sections are used, ``women``, ``men`` or ``children``.
        source: where the numbers come from, for metrics and messages.
        notes: one sentence for each measurement that was not given but completed, or given instead of a size's.
    """

    lengths: Mapping[str, float]
    heights: Mapping[str, float]
    body: str
    source: str
    notes: tuple[str, ...] = field(default=())


@functools.cache
def size_tables() -> dict[str, Any]:
    """Return the contents of ``data/sizes.toml``: size tables, completion rules, cross-sections, valid ranges."""
    with resources.as_file(resources.files("warpflat.garment.mannequin") / "data/sizes.toml") as path:
        return read_toml(path)


def size_names() -> list[str]:
    """Return every size that can be asked for, as it is typed: ``EU 38``, ``UK 10``, ``US 8``, ``JIS 9AR``, ``men 50``."""
    names: list[str] = []
    for table in size_tables()["tables"].values():
        names += [f"{table['label']} {size}" for size in table["sizes"]]
        names += list(table.get("aliases", {}))
    return names


def size_table(size: str) -> str:
    """Return the table whose proportions complete a size: ``women``, ``men`` or ``children``.

    Raises:
        InputError: if no table has the size.
    """
    key, _, _ = _found(size)
    return _completing(key)


def measurements_from_size(size: str, **given: float) -> Measurements:
    """Return the measurements of a size of the tables, some of them replaced.

    Args:
        size: a name of :func:`size_names`, optionally with a stature in centimetres, ``men 50/182``, or ``EU 38 petite``
            or ``tall``: 8 cm shorter or taller than its table.
        given: lengths [m] by name, instead of the size's. What follows from them follows: the abdomen from waist and hip,
            lengths down the body from the stature, and all that the size does not give itself.

    Raises:
        InputError: if no table has the size, the stature is out of range, or a given length is unknown, outside its valid
            range, or goes with no body of that size.
    """
    key, name, tall = _found(size)
    given, read = _read_given(given)
    if tall and "stature" in given:
        raise InputError(f"size {size!r} and measurement stature = {given['stature']:g} m: give the stature once")
    table = size_tables()["tables"][key]
    title = f"size {table['label']} {name}" + (f"/{tall}" if tall else "")
    replaced = dict(given)
    listed = ", ".join(f"{name} = {value * 100:g} cm" for name, value in replaced.items())
    label = title + (f" with {listed}" if given else "") + f" ({table['source']}; grade {table['grade']})"
    if tall:
        low, high = size_tables()["valid"]["range"]["stature"]
        try:
            value = float(tall)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise InputError(f"size {size!r}: stature after '/' must be {low:g} to {high:g} cm")
        replaced["stature"] = value / 100.0
    values = {k: v / 100.0 for k, v in table["sizes"][name].items()}
    return _Completion(key, replaced, values, title=title, notes=read).measurements(label)


def measurements_from_values(*, table: str | None = None, **given: float) -> Measurements:
    """Return measurements that a user gives, the missing ones completed by a table's proportions.

    Args:
        table: ``women``, ``men`` or ``children``: whose proportions and cross-sections complete the rest; without it the women's,
            and the children's below a stature of 1.46 m.
        given: lengths [m] by name: bust, waist, hip, neck, shoulder, stature, ... At least bust, waist or hip.

    Raises:
        InputError: for an unknown name, a value outside its valid range, or two values that no body has together.
    """
    tables = {k for k, t in size_tables()["tables"].items() if "complete_from" not in t}
    if table is not None and table not in tables:
        raise InputError(f"measurements: table {table!r} is unknown: {nearest(table, tables)}")
    values, read = _read_given(given)
    if not {"bust", "waist", "hip"} & set(given):
        raise InputError("measurements: give at least one of bust, waist, hip (in metres)")
    if table is None:
        child = values.get("stature", _GROWN) < _GROWN
        table = "children" if child else "women"
        if child:
            read.append(
                f'completed as a child\'s, below a stature of {_GROWN:g} m; table = "women" or "men" says otherwise'
            )
    return _Completion(table, values, notes=read).measurements(f"measurements, {table}'s proportions")


def _found(size: str) -> tuple[str, str, str]:
    """Return a size's table, its name there, and the stature after its '/', if any."""
    expect(size, str, "size", 'text, such as "EU 38"')
    name, _, tall = size.partition("/")
    word = next((word for word in _STATURES if name.lower().endswith(f" {word}")), "")
    name = name[: len(name) - len(word)]
    for key, table in size_tables()["tables"].items():
        aliases = {_plain(a): s for a, s in table.get("aliases", {}).items()}
        known = {_plain(f"{table['label']} {s}"): s for s in table["sizes"]} | aliases
        if _plain(name) in known:
            if word and (tall or table["body"] == "children"):
                raise InputError(
                    f"size {size!r}: a stature goes with it once, and a child's is its size: leave out {word!r}"
                )
            return key, known[_plain(name)], f"{table['stature'] + _STATURES[word]:g}" if word else tall
    names = size_names()
    # EU 39 is nearer to EU 38 than to EU 98.
    digits = re.search(r"\d+", name)
    alike = [
        other for other in names if digits and re.sub(r"\d+", "", _plain(other)) == re.sub(r"\d+", "", _plain(name))
    ]
    if digits and alike:
        near = min(alike, key=lambda other: abs(int(re.sub(r"\D", "", other)) - int(digits[0][:9])))
        raise InputError(f"size {size!r} is in no table: did you mean {near!r}? {nearest('', names)}")
    raise InputError(f"size {size!r} is in no table: {nearest(name, names)}")


def _completing(table: str) -> str:
    return str(size_tables()["tables"][table].get("complete_from", table))


def _read_given(given: Mapping[str, object]) -> tuple[dict[str, float], list[str]]:
    """Return the lengths [m] that a user gives, and a note for each that was in centimetres or millimetres.

    A length in metres is none in centimetres: the valid ranges of the two lie apart.
    """
    ranges, lengths, notes = size_tables()["valid"]["range"], dict[str, float](), list[str]()
    for name, value in given.items():
        if name not in ranges:
            other = _OTHER_NAMES.get(name.lower())
            words = nearest(name, ranges) if other is None else f"did you mean {other!r}?"
            raise InputError(f"measurement {name!r} is unknown: {words}")
        if not is_number(value):
            raise InputError(f"measurement {name} = {value!r}: a number of metres is needed")
        low, high = (v / 100.0 for v in ranges[name])
        for unit, scale in (("m", 1.0), ("cm", 0.01), ("mm", 0.001)):
            if low <= value * scale <= high:
                lengths[name] = float(value) * scale if unit != "m" else float(value)
                if unit != "m":
                    notes.append(f"{name} = {value:g} is read as {unit}: in metres it is {lengths[name]:g}")
                break
        else:
            inches = f"; {value:g} inches are {value * 0.0254:.3g} m" if low <= value * 0.0254 <= high else ""
            raise InputError(f"measurement {name} = {value:g} m: valid range {low:g} to {high:g} m{inches}")
    return lengths, notes


def _plain(name: str) -> str:
    return re.sub(r"[\s_\-']+", "", name).lower()


class _Completion:
    """Completion of measurements that a size or a user gives by a table's proportions.

    Args:
        table: of the size, or the one that completes.
        given: lengths [m] by name.
        of_size: lengths [m] that the size gives, at its table's stature.
        title: of the size, for messages.
        notes: that come first.
    """

    def __init__(
        self,
        table: str,
        given: Mapping[str, float],
        of_size: Mapping[str, float] | None = None,
        *,
        title: str = "",
        notes: Iterable[str] = (),
    ) -> None:
        tables = size_tables()["tables"]
        self._own, self._name = tables[table], _completing(table)
        self._rows = tables[self._name]
        self._body = size_tables()["bodies"][self._own["body"]]
        self._given, self._title = given, title
        self._notes = list(notes)
        self._lengths = dict(given)
        self._known = set(given)
        if "stature" not in given and (of_size or "stature" not in next(iter(self._rows["sizes"].values()))):
            stature = self._own["stature"] / 100.0
            if of_size:
                self._lengths["stature"] = stature
            else:
                self._fill("stature", stature, f"is the {table} table's stature")
        rules = self._body["complete"]
        # They stand between two others, and must not stay where a table has them when one of these has moved.
        of_size = of_size or {}
        moved = {name: set(given) if name in of_size else {*given, *of_size} for name in rules}
        self._between = {n for n, rule in rules.items() if set(rule.get("between", ())) & moved[n]} - set(given)
        # Nor must a child's bones where its size has them when it is as tall as another one's.
        bones = set(self._rows.get("by_stature", ())) if "stature" in given else set[str]()
        for name, value in of_size.items():
            if name in given:
                self._notes.append(
                    f"{name} = {given[name] * 100:.1f} cm instead of the {value * 100:.1f} cm of {title}"
                )
            elif name not in self._between | bones:
                self._lengths[name] = self._at_stature(name, value, self._own)
        if of_size:
            self._known = set(self._lengths)

    def measurements(self, source: str) -> Measurements:
        """Return all measurements.

        Raises:
            InputError: two that are given go together on no body.
        """
        for top, bottom, low, high in size_tables()["valid"]["ratio"].values():
            if not {top, bottom} <= self._known or not {top, bottom} & set(self._given):
                continue
            if low <= self._lengths[top] / self._lengths[bottom] <= high:
                continue
            name, other = (top, bottom) if top in self._given else (bottom, top)
            least, most = _ends(name, top, low, high, self._lengths[other])
            whose = "" if other in self._given else f" of {self._title}"
            raise InputError(
                f"measurement {name} = {self._lengths[name]:g} m does not go with {other} = {self._lengths[other]:.3g} m{whose}: "
                f"valid range {least:.2f} to {most:.2f} m"
            )
        lengths, rows = self._lengths, self._rows["sizes"].values()
        for name in next(iter(rows)):
            if name not in lengths and name not in self._between:
                bones = ("stature",) if name in self._rows.get("by_stature", ()) else ()
                key = next(k for k in (*bones, "bust", "waist", "hip") if k in lengths)
                # Linear between the table's sizes and beyond its ends [cm].
                x, y = (np.array([size[each] for size in rows], float) for each in (key, name))
                at = lengths[key] * 100.0
                inside = float(np.interp(at, x, y))
                slope = (y[-1] - y[0]) / (x[-1] - x[0])
                beyond = at - min(max(at, x[0]), x[-1])
                # Bones grow less than girths: what lies beyond the table's ends must not run off to nothing or to a giant.
                value = self._at_stature(name, float(max(inside + slope * beyond, 0.55 * y[0])) / 100.0, self._rows)
                self._fill(name, value, f"from {key} by the {self._name} table")
        for name, rule in self._body["complete"].items():
            if name in lengths:
                continue
            if "of" in rule:
                more = rule.get("plus", 0.0)
                value = rule["share"] * lengths[rule["of"]] + more / 100.0
                how = f"is {rule['share']:g} of {rule['of']}" + (f" and {more:g} cm" if more else "")
            else:
                a, b = rule["between"]
                value, how = lengths[a] + rule["at"] * (lengths[b] - lengths[a]), f"lies between {a} and {b}"
            low, high = sorted(lengths[end] for end in rule.get("within", ())) or (value, value)
            if not low <= value <= high:
                value, how = min(max(value, low), high), f"lies within {' and '.join(rule['within'])}"
            self._fill(name, value, how)
        # The height of every level and landmark above the floor [m].
        stature = lengths["stature"]
        if "heights_mm" in self._body:
            by = (stature * 100.0 - 176.0) / 6.0
            h = {k: (base + by * step) / 1000.0 for k, (base, step) in self._body["heights_mm"].items()}
            h["underarm"] = h["nape"] - lengths["armscye_depth"]
            h["bust"] = min(h["bust"], h["underarm"] - 0.03)
        else:
            h = {k: share * stature for k, share in self._body["heights"].items()}
            # The nape-waist tape follows the back's curve, so the waist lies a little less deep than its length.
            h["waist"] = h["nape"] - 0.985 * lengths["nape_to_waist"]
            h["underarm"] = h["nape"] - lengths["armscye_depth"]
            h["bust"] = min(h["bust"], h["underarm"] - 0.032)
            h["side_neck"] = h["nape"] - 0.008 * stature
            h["front_neck"] = h["nape"] - 0.0385 * stature
        # A small child is short from waist to hip.
        h["hip"] = min(h["hip"], h["waist"] - min(0.11, 0.095 * stature))
        # The crotch curve needs room below the hip, the rows above the thigh's girth below the crotch.
        h["crotch"] = min(lengths["inside_leg"], h["hip"] - 0.02 * stature)
        h["leg_thigh"] = h["crotch"] - BELOW_CROTCH * stature
        h["leg_knee"], h["leg_calf"], h["leg_ankle"] = h["knee"], 0.205 * stature, h["ankle"]
        h["thigh"] = min(h["thigh"], h["hip"] - 0.05)
        h["underbust"] = h["bust"] - 0.40 * (h["bust"] - h["waist"])
        h["abdomen"] = h["waist"] - 0.42 * (h["waist"] - h["hip"])
        return Measurements(
            lengths=lengths, heights=h, body=self._own["body"], source=source,
            notes=tuple(self._notes),
        )  # fmt: skip

    def _fill(self, name: str, value: float, how: str) -> None:
        """Complete one measurement, within the valid ratios to those that are known."""
        for top, bottom, low, high in size_tables()["valid"]["ratio"].values():
            other = bottom if name == top else top
            if name not in (top, bottom) or other not in self._known:
                continue
            least, most = _ends(name, top, low, high, self._lengths[other])
            if not least <= value <= most:
                value, how = min(max(value, least), most), f"{how}, as far as {other} lets it"
        self._lengths[name] = value
        self._notes.append(f"{name} = {value * 100:.1f} cm {how}")

    def _at_stature(self, name: str, value: float, table: Mapping[str, Any]) -> float:
        """Return a length [m] that a table has at its stature, at that of the body."""
        of_table = table["stature"] / 100.0
        step = self._rows.get("stature_step", {})
        if name in step:
            return float(value + (self._lengths["stature"] - of_table) / step["per"] * step[name])
        return value * self._lengths["stature"] / of_table if name in self._rows.get("with_stature", ()) else value


def _ends(name: str, top: str, low: float, high: float, other: float) -> tuple[float, float]:
    """Return the bounds [m] of the first or the second length of a ratio, given the other [m]."""
    return (low * other, high * other) if name == top else (other / high, other / low)
