"""The wardrobe: garments of which a scene is written for a person, from a few choices (`warpflat new`)."""

from __future__ import annotations

import functools
import importlib.resources
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warpflat.app.scene.as_toml import document_as_toml, laid_over
from warpflat.app.scene.style import STYLE_KEYS, with_style
from warpflat.core import InputError, check_table, nearest, read_toml
from warpflat.garment import MannequinTable, mannequin_from_table

__all__ = ["GarmentOffer", "garment_offer", "offer_tables", "offers", "scene_text", "style_of", "taken_options"]


@dataclass(frozen=True, kw_only=True)
class GarmentOffer:
    """A garment of the wardrobe.

    Attributes:
        name: of the garment.
        about: in a few words.
        scene: its tables.
        choices: by choice its options with what they are in words, and the tables that are laid over the scene's; the first option is
            taken if nothing is said.
        of_body: of what has a surface of its own, by parameter of its shape a measurement of the body, a share of that, and what is
            added [m].
    """

    name: str
    about: str
    scene: Mapping[str, Any]
    choices: Mapping[str, Mapping[str, tuple[str, Mapping[str, Any]]]]
    of_body: Mapping[str, tuple[str, float, float]] = field(default_factory=dict)

    @property
    def on_body(self) -> bool:
        """Whether it is a garment on a body; not what has a surface of its own, as a bag."""
        return "surface" not in self.scene


@functools.cache
def offers() -> Mapping[str, GarmentOffer]:
    """Return the garments of the wardrobe by name."""
    with importlib.resources.as_file(importlib.resources.files("warpflat.app.scene") / "data/wardrobe.toml") as path:
        tables = read_toml(path)
    return {
        name: GarmentOffer(
            name=name,
            about=table["about"],
            scene=table["scene"],
            choices={
                choice: {option: (each["about"], each.get("scene", {})) for option, each in options.items()}
                for choice, options in table.items()
                if choice not in ("about", "scene", "of_body")
            },
            of_body={key: tuple(rule) for key, rule in table.get("of_body", {}).items()},
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
        kinds = [each for each in offers() if known in each.split("_")]
        raise InputError(
            f"garment {name!r} is unknown: " + (f"valid: {', '.join(kinds)}" if kinds else nearest(known, offers()))
        )
    return offers()[known]


def taken_options(offer: GarmentOffer, chosen: Mapping[str, str]) -> dict[str, str]:
    """Return the option of every choice of a garment: the chosen one, or the first.

    Raises:
        InputError: an unknown choice or option; gives the nearest.
    """
    for choice, option in chosen.items():
        if choice not in offer.choices:
            known = [*offer.choices, *STYLE_KEYS]
            raise InputError(f"a {offer.name} has no choice {choice!r}: {nearest(choice, known)}")
        if option not in offer.choices[choice]:
            raise InputError(f"{offer.name}: {choice} {option!r} is unknown: {nearest(option, offer.choices[choice])}")
    return {choice: chosen.get(choice, next(iter(options))) for choice, options in offer.choices.items()}


def style_of(offer: GarmentOffer, chosen: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the choices that are the garment's own, and the style edits, of which a garment's own choice takes the place."""
    style = {
        key: text
        for key, text in chosen.items()
        if key not in offer.choices and (key in STYLE_KEYS or key.startswith(("ease-", "hem-")))
    }
    return {key: text for key, text in chosen.items() if key not in style}, style


def offer_tables(offer: GarmentOffer, chosen: Mapping[str, str]) -> dict[str, Any]:
    """Return the tables of a garment's scene for its choices and style edits, without those of the body.

    Raises:
        InputError: an unknown choice or option (gives the nearest), or a style edit that makes no sense on this garment.
    """
    own, style = style_of(offer, chosen)
    tables: dict[str, Any] = laid_over({}, offer.scene)
    for choice, option in taken_options(offer, own).items():
        tables = laid_over(tables, offer.choices[choice][option][1])
    if not offer.on_body:
        if style:
            raise InputError(f"--{next(iter(style))} makes no sense on a {offer.name}, which lies on no body")
        return tables
    return with_style(tables, style, offer.name)


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
        mannequin: the table of the body; nothing for what lies on none.
        chosen: option by choice, the first one where nothing is said; and style edits.
        file: where it will lie.
        fabric: another cloth than the garment's own.

    Raises:
        InputError: an unknown choice or option (gives the nearest), or a style edit that makes no sense on this garment.
    """
    own, style = style_of(offer, chosen)
    taken, tables = taken_options(offer, own), offer_tables(offer, chosen)
    if fabric is not None:
        tables["fabric"] = fabric
    if offer.on_body:
        tables["mannequin"] = dict(mannequin)
    elif offer.of_body and mannequin:
        lengths = mannequin_from_table(check_table(MannequinTable, mannequin, "body"), path_of=Path).lengths
        sized = {key: round(share * lengths[name] + more, 3) for key, (name, share, more) in offer.of_body.items()}
        tables = laid_over(tables, {"surface": sized})
    words = [
        f"{choice.capitalize()}: {option}, {offer.choices[choice][option][0]}." for choice, option in taken.items()
    ]
    words += [f"{key.replace('-', ' ').capitalize()}: {text}." for key, text in style.items()]
    about = " ".join([f"{offer.about[0].upper()}{offer.about[1:]}.", *words])
    head = [*textwrap.wrap(about, 116), "", f"    warpflat run {file}"]
    return "".join(f"# {line}".rstrip() + "\n" for line in head) + f"\n{document_as_toml(tables)}"
