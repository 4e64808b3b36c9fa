"""Options of the command line that stand for keys of a scene: the tables that they make, and how errors call them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from warpflat.core import InputError, quote_value

__all__ = ["COMMAND_LINE", "errors_of_options", "scene_tables"]

#: What messages about a scene that was made from options begin with.
COMMAND_LINE = "command line"
#: By option the key that it sets.
_KEYS = {
    "units": "surface.units", "component": "surface.component", "prim": "surface.prim", "pattern": "surface.pattern",
    "meet": "surface.meet_mm", "seams": "find_seams.find", "front": "find_seams.front", "up": "find_seams.up",
    "most_pieces": "find_seams.most_pieces", "limit": "find_seams.limit", "smooth": "find_seams.smooth_mm", "body": "find_seams.body",
    "no": "find_seams.no", "keep": "find_seams.keep", "cut_seam": "seams_cut", "name": "name", "fabric": "fabric",
    "fabric_file": "fabric_files", "shear_limit": "shear_limit", "start": "start", "model": "model", "bands": "bands",
    "bands_shorter": "bands_shorter", "stretch_warp": "wear.stretch_warp", "stretch_weft": "wear.stretch_weft",
    "pressure": "wear.pressure", "solver": "relax.solver", "max_steps": "relax.max_steps", "time_step": "relax.time_step",
    "gap": "relax.gap_mm", "frames": "output.frames", "datum": "datum", "grain_angle": "grain_angle", "device": "device",
}  # fmt: skip
_OPTIONS = {key: "--" + option.replace("_", "-") for option, key in _KEYS.items()}
# A scene's key at the beginning of a message, with its number in a list.
_KEY = re.compile(
    r"(?P<key>[a-z_]+(?:\.[a-z_]+|: [a-z_]+(?= = ))*)(?:\[(?P<number>\d+)\](?:\.[a-z_]+)*)?(?P<rest>(?:: | = | ').*)",
    re.DOTALL,
)


def scene_tables(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a scene that options make; those that are None or empty make none.

    Args:
        options: by their names, with "_"; what is no key of a scene is passed over.
    """
    tables: dict[str, Any] = {}
    for option, key in _KEYS.items():
        value = options.get(option)
        if value is not None and value != ():
            *table, last = key.split(".")
            inner = tables.setdefault(table[0], {}) if table else tables
            inner[last] = list(value) if isinstance(value, tuple) else value
    return tables


@contextmanager
def errors_of_options(mesh: Path, drawn: Sequence[str] = ()) -> Iterator[None]:
    """Let InputErrors about a scene that was made from options name the option, or the mesh where they are about none.

    Args:
        mesh: the file.
        drawn: what `--cut-seam` was given.
    """
    try:
        yield
    except InputError as error:
        text = re.sub(r'component = "(largest|all)"', r"--component \1", str(error))
        if not text.startswith(f"{COMMAND_LINE}: "):
            raise type(error)(text) from None
        text = text.removeprefix(f"{COMMAND_LINE}: ")
        found = _KEY.fullmatch(text)
        key = "" if found is None else found["key"].replace(": ", ".")
        # Options of the relaxation are named without their table.
        key = key if key in _OPTIONS else next((each for each in _OPTIONS if each.rpartition(".")[2] == key), key)
        if found is None:
            text = f"{mesh}: {text}"
        elif key in _OPTIONS:
            given = (
                f" {quote_value(drawn[int(found['number'])])}"
                if found["number"] and key == "seams_cut" and drawn
                else ""
            )
            text = f"{_OPTIONS[key]}{given}{found['rest']}"
        else:
            text = str(error)
        raise type(error)(text) from None
