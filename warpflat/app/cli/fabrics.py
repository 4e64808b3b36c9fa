"""`warpflat fabrics`: the fabrics of the library are listed."""

from __future__ import annotations

import json
from pathlib import Path

import click

__all__ = ["fabrics"]


@click.command()
@click.argument("name", required=False)
@click.option("--file", "files", multiple=True, type=click.Path(path_type=Path), help="A fabric file of your own.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def fabrics(name: str | None, files: tuple[Path, ...], as_json: bool) -> None:
    """List the fabrics, or one in detail with the source of each value.

    \b
    Examples:
      warpflat fabrics
      warpflat fabrics denim
      warpflat fabrics --file my_fabrics.toml --json
    """
    from warpflat.app.cli.tables import fabric_data, fabric_sheet, fabric_table
    from warpflat.flat import find_fabric, load_library

    library = load_library(files)
    shown = list(library.values()) if name is None else [find_fabric(name, library)]
    if as_json:
        click.echo(json.dumps({fabric.name: fabric_data(fabric) for fabric in shown}, indent=2))
    elif name is None:
        click.echo(fabric_table(shown))
    else:
        click.echo(fabric_sheet(shown[0]))
