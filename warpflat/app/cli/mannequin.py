"""`warpflat mannequin`: a dress form is built and written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.options import DONE, ComputingCommand, files_line, measure_option, out_option, tell
from warpflat.app.cli.run import start_warp_silently
from warpflat.core import InputError, require_memory_for_usd

__all__ = ["mannequin", "read_lengths", "sized_body"]


@click.command(cls=ComputingCommand)
@click.option("--size", metavar="SIZE", help='Of a size table: "EU 38", "UK 10", "US 8", "JIS 9AR", "men 50".')
@measure_option()
@click.option(
    "--table",
    type=click.Choice(["women", "men", "children"]),
    help="Completes the measurements.  [default: the size's, or women]",
)
@click.option("--scan", metavar="FILE", help="The mesh of a standing body: OBJ, PLY, STL, OFF, GLB, glTF, VRM or USD.")
@click.option("--units", metavar="UNIT", help="Of the scan: m, cm, mm ...  [default: told from its height]")
@click.option("--facing", metavar="AXIS", help="Where the scan looks, such as +z.  [default: told from its shape]")
@click.option("--up", metavar="AXIS", help="Where the scan's head is, such as +y.  [default: told from its shape]")
@click.option("--landmark", "landmarks", multiple=True, metavar="NAME=METRES", help="A height known better.")
@click.option("--keep-pose", is_flag=True, help="Keep the scan's arms and legs; else it stands as a tape asks.")
@click.option("--keep-sides", is_flag=True, help="Keep the scan's left and right; else they are averaged.")
@click.option(
    "--resolution", type=click.FloatRange(2, 40), metavar="MM", help="Wished edge of the quads.  [default: 10]"
)
@out_option("[default: out/mannequin]")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
@click.option("--json", "as_json", is_flag=True, help="Print metrics.json on standard output, nothing else.")
def mannequin(
    size: str | None,
    measures: tuple[str, ...],
    landmarks: tuple[str, ...],
    resolution: float | None,
    out: Path | None,
    quiet: bool,
    as_json: bool,
    **source: Any,
) -> int:
    """Build a dress form of feature lines and bricks, and write USD, OBJ, measures and a labelled picture.

    \b
    Examples:
      warpflat mannequin --size "EU 38"
      warpflat mannequin --measure bust=0.90 --measure waist=0.74 --measure hip=0.99
      warpflat mannequin --size "EU 38" --measure waist=0.76
      warpflat mannequin --scan body.obj --units m --out body
    """
    from warpflat.app.cli.tables import mannequin_table, measures_table
    from warpflat.core import check_table
    from warpflat.garment import MANNEQUIN_FILES, MannequinTable, mannequin_from_table, write_mannequin
    from warpflat.pattern import output_folder

    require_memory_for_usd()  # mannequin.usdc is always written
    tables: dict[str, Any] = {key: value for key, value in source.items() if value not in (None, False)}
    scan = tables.get("scan")
    if (scan is None) == (size is None and not measures):
        raise InputError(
            "command line: give the body in one way: --size or --measure, or both, which replaces some of the size's; or --scan"
        )
    of_scan = [f"--{key.replace('_', '-')}" for key in tables if key not in ("scan", "table")]
    of_scan += ["--landmark"] if landmarks else []
    if scan is None and of_scan:
        raise InputError(f"command line: {of_scan[0]} is about a --scan; leave it out")
    if scan is not None and "table" in tables:
        raise InputError("command line: --table completes measurements; a scan has its own: leave it out")
    if tables.pop("keep_pose", False):
        tables["pose"] = "scan"
    if tables.pop("keep_sides", False):
        tables["symmetric"] = False
    tables |= sized_body(size, measures)
    if landmarks:
        tables["landmarks"] = read_lengths(landmarks, "--landmark")
    if resolution is not None:
        tables["resolution_mm"] = resolution
    table = check_table(MannequinTable, tables, "command line")
    if scan is not None:
        start_warp_silently()
    names = [name for kind, name in MANNEQUIN_FILES.items() if kind != "distances" or source["scan"] is not None]
    with output_folder(out if out is not None else Path("out") / "mannequin", names, guard=True) as folder:
        body = mannequin_from_table(table, path_of=Path)
        files = write_mannequin(body, folder)
    if as_json:
        click.echo(files["metrics"].read_text(encoding="utf-8"), nl=False)
    elif not quiet:
        for note in body.notes:
            tell(f"note: {note}")
        click.echo(mannequin_table(body))
        if tapes := measures_table(body):
            click.echo(f"\n{tapes}\n")
        click.echo(files_line(folder, (file.name for file in files.values())))
    return DONE


def sized_body(size: str | None, measures: Sequence[str]) -> dict[str, Any]:
    """Return the table of the body that --size and --measure give; empty without them."""
    lengths = {"measurements": read_lengths(measures, "--measure")} if measures else {}
    return lengths if size is None else {"size": size, **lengths}


def read_lengths(texts: Sequence[str], option: str) -> dict[str, float]:
    """Return the lengths of all NAME=LENGTH, each name once."""
    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        try:
            metres = float(value)
        except ValueError:
            metres = math.nan
        if not math.isfinite(metres):
            shown = f"{name}=0.88" if equals else "bust=0.88"
            raise InputError(f"command line: {option} {text!r} is not NAME=LENGTH, such as {shown}")
        if name in found:
            raise InputError(
                f"command line: {option} {name} is given twice, {found[name]:g} and {metres:g}; give it once"
            )
        found[name] = metres
    return found
