"""`warpflat marker`: the pieces of a pattern are laid on cloth as short as can be found."""

from __future__ import annotations

import json
import re
from pathlib import Path

import click

from warpflat.app.cli.options import DONE, FAULTY, ComputingCommand, out_option, tell_files

__all__ = ["marker"]

_EPILOG = """\b
What comes out, in DIR:
  NAME.marker.svg   the lay in true size: pieces, grain and names on the cloth
  NAME.marker.json  its width and length [m], the share that is used, and where each piece lies
  NAME.CLOTH.marker.svg, NAME.CLOTH.marker.json
                    the same of every further cloth
  metrics.json      in a folder that holds no run: what was written

\b
Exit codes:
  0  done
  1  done, but a cloth of several has no marker
  2  bad input; one line says what is wrong, where, and what would be right"""


@click.command(cls=ComputingCommand, epilog=_EPILOG)
@click.argument("source", metavar="DIR|PATTERN", type=click.Path(path_type=Path))
@click.option(
    "--width", type=click.FloatRange(10, 1000), default=140.0, show_default=True, metavar="CM", help="Of the cloth."
)
@click.option(
    "--size",
    "sizes",
    multiple=True,
    metavar="SIZE[=N]",
    help="Lay N garments of this size, one if no number is given.  [default: one of each size]",
)
@click.option(
    "--folded", is_flag=True, help="The cloth lies double: halves lie against its fold, pairs are cut at once."
)
@click.option("--one-way", is_flag=True, help="All pieces point the same way, as for nap, pile and one-way prints.")
@click.option("--reversible", is_flag=True, help="Both faces are alike, so that none of a pair need be turned over.")
@click.option(
    "--gap",
    type=click.FloatRange(0, 100),
    default=2.0,
    show_default=True,
    metavar="MM",
    help="Between pieces, and to the edges of the cloth.",
)
@click.option(
    "--repeat-warp", type=click.FloatRange(0, 1000), default=0.0, metavar="MM", help="Of stripes along the warp."
)
@click.option(
    "--repeat-weft", type=click.FloatRange(0, 1000), default=0.0, metavar="MM", help="Of stripes along the weft."
)
@click.option(
    "--match",
    "seams",
    multiple=True,
    metavar="SEAM",
    help="Lay both sides of this seam on the same stripe; needs a repeat.",
)
@click.option(
    "--allowance",
    type=click.FloatRange(0, 100),
    metavar="MM",
    help="Around the panels of GarmentCode, which has none.  [default: 10]",
)
@click.option(
    "--seconds",
    type=click.IntRange(1, 600),
    default=20,
    show_default=True,
    help="To search: a longer search finds shorter lays.",
)
@out_option("Folder for the files.  [default: the run's, or out/NAME]")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print the measures of the markers on standard output, nothing else."
)
def marker(
    source: Path,
    width: float,
    sizes: tuple[str, ...],
    folded: bool,
    one_way: bool,
    reversible: bool,
    gap: float,
    repeat_warp: float,
    repeat_weft: float,
    seams: tuple[str, ...],
    allowance: float | None,
    seconds: int,
    out: Path | None,
    quiet: bool,
    as_json: bool,
) -> int:
    """Lay the pieces of a pattern on cloth: a run's, or that of a pattern.json, GarmentCode, a DXF or an SVG.

    Each piece is laid as often as it is cut, with its grain along the cloth, of a pair one turned over, and a half on the fold whole.
    A pattern of several cloths has a marker for each. On folded cloth, and where stripes match, all pieces point the same way.

    \b
    Examples:
      warpflat marker out/dress
      warpflat marker shirt.dxf --width 150 --size M=2 --size L
      warpflat marker shirt_specification.json --folded
      warpflat marker out/shirt --repeat-warp 40 --repeat-weft 40 --match "side left"
      warpflat marker drawing.svg --one-way --seconds 60
    """
    from warpflat.core import InputError
    from warpflat.pattern import Cloth, Stripes, lay_markers

    if seams and not (repeat_warp or repeat_weft):
        raise InputError("--match: needs the repeat of the stripes, --repeat-warp MM or --repeat-weft MM")
    wanted: dict[str, int] = {}
    for text in sizes:
        size, _, count = text.rpartition("=") if "=" in text else (text, "", "1")
        if not re.fullmatch(r"[1-9][0-9]{0,2}", count):
            raise InputError(f'--size: {text!r} is no size and number, such as "EU 38=2"')
        wanted[size] = wanted.get(size, 0) + int(count)
    stripes = Stripes(warp=1e-3 * repeat_warp, weft=1e-3 * repeat_weft, seams=seams)
    cloth = Cloth(
        width=1e-2 * width, one_way=one_way, reversible=reversible, gap=1e-3 * gap, folded=folded, stripes=stripes
    )
    files, notes, plans = lay_markers(
        source,
        cloth,
        out=out,
        allowance=None if allowance is None else 1e-3 * allowance,
        sizes=wanted or None,
        seconds=seconds,
    )
    if as_json:
        click.echo(json.dumps({"schema": 1, "markers": plans}))
    elif not quiet:
        tell_files(files, notes)
    return FAULTY if any("not_made" in plan for plan in plans) else DONE
