"""`warpflat export`: pattern files are written again from a run's pattern.json."""

from __future__ import annotations

from pathlib import Path

import click

from warpflat.cli.options import DONE, ComputingCommand

__all__ = ["export"]


@click.command(cls=ComputingCommand)
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--format", "formats", type=click.Choice(["dxf", "svg", "pdf", "json"]), multiple=True, required=True, help="Which."
)
@click.option("--dialect", type=click.Choice(["aama", "astm"]), default="aama", show_default=True, help="Of the DXF.")
@click.option(
    "--paper",
    type=click.Choice(["A4", "Letter", "A0", "Projector"]),
    default="A4",
    show_default=True,
    help="Of the PDF.",
)
@click.option("--size", "sizes", multiple=True, metavar="SIZE", help="Only this size of a graded pattern; not of json.")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
def export(
    folder: Path, formats: tuple[str, ...], dialect: str, paper: str, sizes: tuple[str, ...], quiet: bool
) -> int:
    """Write a run's pattern files again, from its pattern.json: another dialect, another paper, one size.

    \b
    Examples:
      warpflat export out/dress --format dxf --dialect astm
      warpflat export out/dress --format pdf --paper Letter --size "EU 38"
    """
    from warpflat.garment.pattern_files import export_patterns

    if folder.name == "pattern.json" and folder.is_file():
        folder = folder.parent
    files = export_patterns(folder, formats, dialect=dialect, paper=paper, sizes=sizes or None)
    if not quiet:
        click.echo(f"{folder}: {', '.join(files)}")
    return DONE
