"""`warpflat export`: pattern files are written from a run's pattern.json, or from the pattern of another program."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import click

from warpflat.app.cli.options import DONE, ComputingCommand, out_option, tell_files
from warpflat.app.scene.options import Dialect, Paper, PatternFormat, PrintedUnit

__all__ = ["export"]


@click.command(cls=ComputingCommand)
@click.argument("source", metavar="DIR|PATTERN", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "formats",
    type=click.Choice(get_args(PatternFormat)),
    multiple=True,
    required=True,
    help="Which.",
)
@click.option("--dialect", type=click.Choice(get_args(Dialect)), default="aama", show_default=True, help="Of the DXF.")
@click.option(
    "--paper",
    type=click.Choice(get_args(Paper)),
    default="A4",
    show_default=True,
    help="Of the PDF.",
)
@click.option("--size", "sizes", multiple=True, metavar="SIZE", help="Only this size of a graded pattern; not of json.")
@click.option(
    "--allowance",
    type=click.FloatRange(0, 100),
    metavar="MM",
    help="Around the panels of GarmentCode, which has none.  [default: 10]  Of a DXF or an SVG without a sewing line: from its cutting "
    "line to the sewing line.  [default: 0]",
)
@click.option(
    "--units",
    type=click.Choice(get_args(PrintedUnit)),
    help="Of lengths that are printed; in: of the DXF, too.  [default: the pattern's, or cm]",
)
@out_option("Folder for the files.  [default: the run's, or out/NAME of another program's file]")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
def export(
    source: Path,
    formats: tuple[str, ...],
    dialect: str,
    paper: str,
    sizes: tuple[str, ...],
    allowance: float | None,
    units: str | None,
    out: Path | None,
    quiet: bool,
) -> int:
    """Write a run's pattern files again, from its pattern.json: another dialect, another paper, other units, one size.

    The pattern of another program, a DXF, an SVG or the JSON of GarmentCode, is drafted: its lines stay, and it gets labels, and
    notches where it names its seams. What of it is not read is said.

    \b
    Examples:
      warpflat export out/dress --format dxf --dialect astm
      warpflat export out/dress --format pdf --paper Letter --size "EU 38"
      warpflat export out/dress --format garmentcode
      warpflat export shirt_specification.json --format dxf --format pdf
      warpflat export bought.dxf --format pdf --units in
      warpflat export drawing.svg --format dxf --allowance 10
    """
    from warpflat.pattern import export_patterns

    files, notes = export_patterns(
        source,
        formats,
        out=out,
        allowance=None if allowance is None else 1e-3 * allowance,
        dialect=dialect,
        paper=paper,
        sizes=sizes or None,
        units=units,
    )
    if not quiet:
        tell_files(files, notes)
    return DONE
