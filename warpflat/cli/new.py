"""`warpflat new`: the scene of a garment is written for a person, from a few choices."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpflat.cli.options import DONE
from warpflat.core.errors import InputError

if TYPE_CHECKING:
    from warpflat.scene.wardrobe import GarmentOffer

__all__ = ["new"]


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("words", nargs=-1, type=click.UNPROCESSED, metavar="[GARMENT] [--CHOICE OPTION]...")
@click.option("--size", metavar="SIZE", help='Of a size table: "EU 38", "US 8", "men 50".')
@click.option("--measure", "measures", multiple=True, metavar="NAME=METRES", help="A measurement, such as bust=0.88.")
@click.option("--scan", type=click.Path(path_type=Path), metavar="FILE", help="The mesh of a standing body.")
@click.option("--fabric", metavar="NAME", help="Another cloth than the garment's own.")
@click.option("-o", "--out", type=click.Path(path_type=Path), metavar="FILE", help="[default: GARMENT.toml]")
def new(
    words: tuple[str, ...],
    size: str | None,
    measures: tuple[str, ...],
    scan: Path | None,
    fabric: str | None,
    out: Path | None,
) -> int:
    """Write the scene of a garment for a size, for measurements or for a body scan.

    Without a garment the garments are listed. Without a body the choices of a garment are listed, and nothing is written.

    \b
    Examples:
      warpflat new
      warpflat new shirt
      warpflat new shirt --size "EU 38" --collar stand --sleeve long --ease loose
      warpflat new shift_dress --size "EU 38" --measure waist=0.76 -o my_dress.toml
      warpflat new hoodie --scan body.obj
    """
    from warpflat.cli.mannequin import read_lengths
    from warpflat.core.output import atomic_path
    from warpflat.core.toml_file import check_table
    from warpflat.fabric.library import find_fabric, load_library
    from warpflat.mannequin.table import MannequinTable, mannequin_from_table
    from warpflat.scene.wardrobe import garment_offer, offers, scene_text, taken_options

    name, chosen = _read_choices(words)
    if name is None:
        if chosen or size or measures or scan or fabric or out:
            raise InputError(f"name a garment: {', '.join(offers())}")
        width = max(map(len, offers()))
        for offer in offers().values():
            click.echo(f"{offer.name:<{width}}  {offer.about}")
        click.echo(f"{'':<{width}}  warpflat new GARMENT lists what can be chosen")
        return DONE
    offer = garment_offer(name)
    taken = taken_options(offer, chosen)
    if fabric is not None:
        find_fabric(fabric, load_library(()))
    if size is None and not measures and scan is None:
        if chosen or fabric or out:
            raise InputError('say whom it is for: --size "EU 38", --measure bust=0.90 or --scan body.obj')
        click.echo(f"{offer.name}: {offer.about}")
        _print_choices(offer, taken)
        click.echo(f'write it with: warpflat new {offer.name} --size "EU 38"')
        return DONE
    file = out or Path(f"{offer.name}.toml")
    if file.exists() or file.is_symlink():
        raise InputError(f"{file}: exists and is kept; name another file with -o")
    table: dict[str, object] = {}
    if size is not None:
        table["size"] = size
    if measures:
        table["measurements"] = read_lengths(measures, "--measure")
    if scan is not None:
        # Scenes start from their own folder.
        table["scan"] = Path(os.path.relpath(scan, file.parent)).as_posix()
    body = check_table(MannequinTable, table, "command line")
    if scan is None:
        mannequin_from_table(body, path_of=Path)
    elif not scan.is_file():
        raise InputError(f"{scan}: no such file; give the mesh of a standing body, OBJ, PLY, STL, OFF or GLB")
    text = scene_text(offer, table, chosen, file=file.as_posix(), fabric=fabric)
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    click.echo(f"wrote {file}: {offer.about}")
    _print_choices(offer, taken)
    click.echo(f"make its pattern with: warpflat run {file}")
    return DONE


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
            if not rest or rest[0].startswith("-"):
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
