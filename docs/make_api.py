"""Write `docs/api.md`: every public name of the package with its signature and docstring, for autodoc.

python docs/make_api.py
"""

from __future__ import annotations

from pathlib import Path

import warpflat

GROUPS = {
    "Surfaces": ("flat.surface",),
    "Fabrics and wear": ("flat.fabric", "flat.model"),
    "Flattening": ("flat.flattening", "flat.solver"),
    "Cutting": ("flat.cutting", "garment.seams"),
    "Bodies and forms": ("garment.mannequin",),
    "Garments and patterns": ("garment.construction", "pattern.drafting", "pattern.export"),
    "Drape": ("garment.draping",),
    "Scenes": ("app.scene",),
    "Errors": ("core",),
}


def api_page() -> str:
    """Return the page.

    Raises:
        ValueError: a public name lies in a room that no group lists.
    """
    names = [name for name in warpflat.__all__ if not name.startswith("_")]
    homes = {name: getattr(warpflat, name).__module__.removeprefix("warpflat.") for name in names}
    known = tuple(f"{room}." for rooms in GROUPS.values() for room in rooms)
    if lost := sorted(name for name, home in homes.items() if not home.startswith(known)):
        raise ValueError(f"no group for {', '.join(lost)}")
    blocks = [
        "# Python reference",
        "Every public name is `warpflat.NAME`. Lengths are metres, energies joules, stiffnesses N/m, arrays NumPy's.",
    ]
    for title, rooms in GROUPS.items():
        blocks.append(f"## {title}")
        for name, home in sorted(homes.items(), key=lambda each: each[0].lower()):
            if not home.startswith(tuple(f"{room}." for room in rooms)):
                continue
            kind = "autoclass" if isinstance(getattr(warpflat, name), type) else "autofunction"
            members = "\n   :members:" if kind == "autoclass" else ""
            blocks.append(f"```{{eval-rst}}\n.. {kind}:: warpflat.{name}{members}\n```")
    return "\n\n".join(blocks) + "\n"


if __name__ == "__main__":
    (Path(__file__).parent / "api.md").write_text(api_page(), encoding="utf-8")
