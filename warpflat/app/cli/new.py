"""`warpflat new`: the scene of a garment is written for a person, from a few choices."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpflat.app.cli.options import DONE, measure_option
from warpflat.core import InputError

if TYPE_CHECKING:
    from warpflat.app.scene.wardrobe import GarmentOffer

__all__ = ["new"]


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("words", nargs=-1, type=click.UNPROCESSED, metavar="[GARMENT] [--CHOICE OPTION]...")
@click.option("--size", metavar="SIZE", help='Of a size table: "EU 38", "US 8", "men 50".')
@measure_option()
@click.option("--scan", type=click.Path(path_type=Path), metavar="FILE", help="The mesh of a standing body.")
@click.option("--fabric", metavar="NAME", help="Another cloth than the garment's own.")
@click.option(
    "--card", type=click.Path(path_type=Path), metavar="FILE", help="Draw a measurement card, a PNG, and nothing else."
)
@click.option("-o", "--out", type=click.Path(path_type=Path), metavar="FILE", help="[default: GARMENT.toml]")
def new(
    words: tuple[str, ...],
    size: str | None,
    measures: tuple[str, ...],
    scan: Path | None,
    fabric: str | None,
    card: Path | None,
    out: Path | None,
) -> int:
    """Write the scene of a garment for a size, for measurements or for a body scan.

    Without a garment the garments are listed. Without a body the choices of a garment are listed, and nothing is written. Besides its
    own choices each garment takes the style keys that make sense on it: a length, a neckline, flare, a closure, ease at a level.

    \b
    Examples:
      warpflat new
      warpflat new shirt
      warpflat new shirt --size "EU 38" --collar stand --sleeve long --ease loose
      warpflat new shift_dress --size "EU 38" --measure waist=0.76 -o my_dress.toml
      warpflat new shift_dress --size "EU 38" --length knee+6 --neck-depth 8 --ease-waist 12
      warpflat new hoodie --scan body.obj
      warpflat new shirt --card shirt_card.png
    """
    from warpflat.app.scene.style import STYLE_KEYS, style_options
    from warpflat.app.scene.wardrobe import garment_offer, offer_tables, offers, scene_text, style_of, taken_options
    from warpflat.core import check_table
    from warpflat.flat import find_fabric, load_library
    from warpflat.garment import MannequinTable, mannequin_from_table
    from warpflat.pattern import atomic_path

    name, chosen = _read_choices(words)
    if name is None:
        if chosen or size or measures or scan or fabric or card or out:
            raise InputError(f"name a garment: {', '.join(offers())}")
        width = max(map(len, offers()))
        for offer in offers().values():
            click.echo(f"{offer.name:<{width}}  {offer.about}")
        click.echo(f"{'':<{width}}  warpflat new GARMENT lists what can be chosen")
        return DONE
    offer = garment_offer(name)
    taken = taken_options(offer, style_of(offer, chosen)[0])
    tables = offer_tables(offer, chosen)
    if fabric is not None:
        find_fabric(fabric, load_library(()))
    if card is not None:
        if not offer.on_body:
            raise InputError(f"a {offer.name} lies on no body; leave out --card")
        if out is not None or fabric is not None:
            raise InputError("--card draws a measurement card and writes no scene; leave out --out and --fabric")
        _draw_card(card, offer.name.replace("_", " "), tables, _body_table(size, measures, scan, card))
        return DONE
    if size is None and not measures and scan is None and (offer.on_body or out is None):
        if offer.on_body and (chosen or fabric or out):
            raise InputError('say whom it is for: --size "EU 38", --measure bust=0.90 or --scan body.obj')
        click.echo(f"{offer.name}: {offer.about}")
        _print_choices(offer, taken)
        for key, values in style_options(tables).items() if offer.on_body else ():
            click.echo(f"    --{key} ({values}): {STYLE_KEYS[key]}")
        own = '--size "EU 38"' if offer.on_body or offer.of_body else f"-o {offer.name}.toml"
        click.echo(f"write it with: warpflat new {offer.name} {own}")
        return DONE
    file = out or Path(f"{offer.name}.toml")
    if file.exists() or file.is_symlink():
        raise InputError(f"{file}: exists and is kept; name another file with -o")
    table = _body_table(size, measures, scan, file)
    if not offer.on_body and (scan is not None or (table and not offer.of_body)):
        raise InputError(f"a {offer.name} lies on no body; leave out {'--scan' if scan else '--size and --measure'}")
    body = check_table(MannequinTable, table, "command line") if table else None
    if body is None:
        pass
    elif scan is None:
        mannequin_from_table(body, path_of=Path)
    elif not scan.is_file():
        raise InputError(
            f"{scan}: no such file; give the mesh of a standing body, OBJ, PLY, STL, OFF, GLB, glTF, VRM or USD"
        )
    text = scene_text(offer, table, chosen, file=file.as_posix(), fabric=fabric)
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    click.echo(f"wrote {file}: {offer.about}")
    _print_choices(offer, taken)
    click.echo(f"make its pattern with: warpflat run {shlex.quote(str(file))}")
    return DONE


def _draw_card(card: Path, garment: str, tables: Mapping[str, Any], body: Mapping[str, Any]) -> None:
    """Draw what to measure for a garment, on the body of a table, or on that of a size where it says nothing."""
    from warpflat.app.scene.style import covered_bands
    from warpflat.core import check_table
    from warpflat.garment import MannequinTable, mannequin_from_table, write_measurement_card

    if card.exists() or card.is_symlink():
        raise InputError(f"{card}: exists and is kept; name another file")
    if card.suffix.lower() != ".png":
        raise InputError(f"{card}: a card is a picture; name it *.png")
    if "scan" in body:
        raise InputError("--card is for a tape measure; a scan is measured by itself: leave out --scan")
    wearer = check_table(MannequinTable, {**(body or {"size": "EU 38"}), "resolution_mm": 12.0}, "command line")
    mannequin = mannequin_from_table(wearer, path_of=Path)
    hood = any(wish["kind"] == "hood" for wish in tables.get("finishing", ()))
    guessed = {note.split(" = ")[0] for note in mannequin.notes} - set(body.get("measurements", ()))
    card.parent.mkdir(parents=True, exist_ok=True)
    write_measurement_card(
        card, mannequin, covered_bands(tables), hood=hood, title=f"What to measure: {garment}",
        values=mannequin.lengths if body else None, guessed=guessed,
    )  # fmt: skip
    click.echo(f"wrote {card}: what to measure for {garment}, and where")


def _body_table(size: str | None, measures: tuple[str, ...], scan: Path | None, file: Path) -> dict[str, Any]:
    """Return the table of the body, as a scene in a file has it."""
    from warpflat.app.cli.mannequin import sized_body

    table = sized_body(size, measures)
    if scan is not None:
        # Scenes start from their own folder.
        table["scan"] = Path(os.path.relpath(scan, file.parent)).as_posix()
    return table


def _read_choices(words: tuple[str, ...]) -> tuple[str | None, dict[str, str]]:
    """Return the garment and the options by choice.

    Raises:
        InputError: a choice without an option, one that is given twice, or two garments.
    """
    name, chosen, rest = None, dict[str, str](), list(words)
    while rest:
        word = rest.pop(0)
        if not word.startswith("-"):
            if name is not None:
                raise InputError(f"one garment at a time: {name} or {word}")
            name = word
            continue
        choice, equals, option = word.lstrip("-").partition("=")
        if not equals:
            # A number may be negative.
            if not rest or (rest[0].startswith("-") and not rest[0][1:2].isdigit()):
                raise InputError(f"{word} needs an option, as --collar stand; warpflat new GARMENT lists them")
            option = rest.pop(0)
        if choice in chosen:
            raise InputError(f"--{choice} is given twice")
        chosen[choice] = option
    return name, chosen


def _print_choices(offer: GarmentOffer, taken: Mapping[str, str]) -> None:
    """Print the options of every choice, a line each; a star is at those that are taken."""
    for choice, options in offer.choices.items():
        for option, (about, _) in options.items():
            click.echo(f"  {'*' if taken[choice] == option else ' '} --{choice} {option}: {about}")
