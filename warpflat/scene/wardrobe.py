"""The wardrobe: garments of which a scene is written for a person, from a few choices (`warpflat new`)."""

from __future__ import annotations

import functools
import importlib.resources
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from warpflat.core.errors import InputError, nearest
from warpflat.core.toml_file import document_as_toml, read_toml

__all__ = ["GarmentOffer", "garment_offer", "offers", "scene_text", "taken_options"]


@dataclass(frozen=True, kw_only=True)
class GarmentOffer:
    """A garment of the wardrobe.

    Attributes:
        name: of the garment.
        about: in a few words.
        scene: its tables.
        choices: by choice its options with what they are in words, and the tables that are laid over the scene's; the first option is
            taken if nothing is said.
    """

    name: str
    about: str
    scene: Mapping[str, Any]
    choices: Mapping[str, Mapping[str, tuple[str, Mapping[str, Any]]]]


@functools.cache
def offers() -> Mapping[str, GarmentOffer]:
    """Return the garments of the wardrobe by name."""
    with importlib.resources.as_file(importlib.resources.files("warpflat.scene") / "data/wardrobe.toml") as path:
        tables = read_toml(path)
    return {
        name: GarmentOffer(
            name=name,
            about=table["about"],
            scene=table["scene"],
            choices={
                choice: {option: (each["about"], each.get("scene", {})) for option, each in options.items()}
                for choice, options in table.items()
                if choice not in ("about", "scene")
            },
        )
        for name, table in tables.items()
    }


def garment_offer(name: str) -> GarmentOffer:
    """Return a garment of the wardrobe.

    Raises:
        InputError: there is none of that name; gives the nearest.
    """
    known = name.replace("-", "_").lower()
    if known not in offers():
        raise InputError(f"garment {name!r} is unknown: {nearest(known, offers())}")
    return offers()[known]


def taken_options(offer: GarmentOffer, chosen: Mapping[str, str]) -> dict[str, str]:
    """Return the option of every choice of a garment: the chosen one, or the first.

    Raises:
        InputError: an unknown choice or option; gives the nearest.
    """
    for choice, option in chosen.items():
        if choice not in offer.choices:
            raise InputError(f"a {offer.name} has no choice {choice!r}: {nearest(choice, offer.choices)}")
        if option not in offer.choices[choice]:
            raise InputError(f"{offer.name}: {choice} {option!r} is unknown: {nearest(option, offer.choices[choice])}")
    return {choice: chosen.get(choice, next(iter(options))) for choice, options in offer.choices.items()}


def scene_text(
    offer: GarmentOffer,
    mannequin: Mapping[str, Any],
    chosen: Mapping[str, str],
    *,
    file: str,
    fabric: str | None = None,
) -> str:
    """Return the text of a scene file.

    Args:
        offer: the garment.
        mannequin: the table of the body.
        chosen: option by choice; the first one where nothing is said.
        file: where it will lie.
        fabric: another cloth than the garment's own.

    Raises:
        InputError: an unknown choice or option; gives the nearest.
    """
    taken = taken_options(offer, chosen)
    tables: dict[str, Any] = _laid_over({}, offer.scene)
    for choice, option in taken.items():
        tables = _laid_over(tables, offer.choices[choice][option][1])
    if fabric is not None:
        tables["fabric"] = fabric
    tables["mannequin"] = dict(mannequin)
    words = [
        f"{choice.capitalize()}: {option}, {offer.choices[choice][option][0]}." for choice, option in taken.items()
    ]
    about = " ".join([f"{offer.about[0].upper()}{offer.about[1:]}.", *words])
    head = [*textwrap.wrap(about, 116), "", f"    warpflat run {file}"]
    return "".join(f"# {line}".rstrip() + "\n" for line in head) + f"\n{document_as_toml(tables)}"


def _laid_over(base: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with another one laid over it: tables are merged, lists of tables put together, other values replaced."""
    found = dict(base)
    for key, value in other.items():
        own = found.get(key)
        if isinstance(own, Mapping) and isinstance(value, Mapping):
            found[key] = _laid_over(own, value)
        elif (
            isinstance(own, list)
            and isinstance(value, list)
            and all(isinstance(each, Mapping) for each in (*own, *value))
        ):
            found[key] = [*own, *value]
        else:
            found[key] = value
    return found
