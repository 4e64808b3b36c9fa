"""`warpflat fit`: a garment is carried from its body to another one, and flattened."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.options import (
    DONE,
    EXIT_CODES,
    RUN_FILES,
    ComputingCommand,
    fabric_file_option,
    output_options,
    shear_limit_option,
)
from warpflat.app.cli.run import report_run, start_warp_silently
from warpflat.core import InputError, make_file_name, plain_letters, quote_value

__all__ = ["fit"]

_ANEW = "--seams auto finds new seams, --seams uv flattens its pieces anew"
_FILES = """\b
  NAME.fitted.obj  the garment on the other body [m], with the islands, groups and materials of its file
  NAME.body.obj    that body, standing as the first one does [m]
  fit.json         ease by level before and after, of every body
  fit.csv          the same as a table, of several bodies, each of which has a folder in DIR"""


@click.command(cls=ComputingCommand, epilog=f"{RUN_FILES}\n\n{_FILES}\n\n{EXIT_CODES}")
@click.argument("garment", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "body",
    metavar="SIZE|SCAN",
    help='The body on which it lies: a size, such as "EU 38", or a scan\'s file, in the same axes and place.  [default: one is fitted '
    "inside it]",
)
@click.option(
    "--to",
    "bodies",
    multiple=True,
    required=True,
    metavar="SIZE|SCAN",
    help="The other body; several make a study, each in a folder of its own.",
)
@click.option(
    "--ease",
    "eases",
    multiple=True,
    metavar="LEVEL=LENGTH",
    help="Ease at bust, underbust, waist or hip, such as waist=40mm.  [default: as before]",
)
@click.option(
    "--keep-pose",
    is_flag=True,
    help="End on the other body as its scan is posed, on a chair or a saddle.  [default: as the first body stands]",
)
@click.option("--units", metavar="UNIT", help="Of the garment's file: m, cm, mm, in ... Needed unless it says (USD).")
@click.option("--prim", metavar="PATH", help="Which mesh of a USD file.  [default: all]")
@click.option("--front", metavar="AXIS", help="Where its front faces: +z, -z, +x, -x.  [default: found]")
@click.option("--seams", metavar="HOW", help="As for warpflat flatten.")
@click.option(
    "--cut-seam",
    "cut_seams",
    multiple=True,
    metavar="[NAME=]WAY",
    help="A seam that you draw on the garment as its file has it, with points:, line: or plane: as for warpflat flatten; it is carried "
    "with the cloth.",
)
@click.option("--fabric", metavar="NAME", help="A fabric of the library; warpflat fabrics lists them.")
@fabric_file_option
@shear_limit_option
@click.option("--bands", metavar="HOW", help="As for warpflat flatten.")
@click.option("--name", metavar="NAME", help="Name of the files.  [default: the garment's]")
@click.option("--frames", type=int, metavar="N", help="About how many frames, 0 for none.  [default: 60]")
@click.option("--no-picture", is_flag=True, help="Write no picture.png.")
@output_options(folder="out/NAME-fitted", printed="fit.json")
def fit(
    garment: Path,
    body: str | None,
    bodies: tuple[str, ...],
    eases: tuple[str, ...],
    out: Path | None,
    quiet: bool,
    verbose: bool,
    as_json: bool,
    device: str | None,
    **options: Any,
) -> int:
    """Carry a garment from its body to another one, keep its ease, and flatten it.

    Each point of the cloth goes with the skin under it and keeps its distance, so the style stays. A garment whose texture is its sewn
    pattern keeps that pattern and its grain, graded by the growth of the cloth. Of others seams are found, pieces are flattened and the
    pattern is drafted, as by warpflat flatten.

    \b
    Examples:
      warpflat fit shirt.obj --units m --from body.obj --to "EU 44"
      warpflat fit leggings.ply --units m --to scan.obj --fabric jersey
      warpflat fit out/dress/worn.usdc --from "EU 38" --to "EU 36" --to "EU 42" --out study
      warpflat fit trousers.usdc --from "EU 38" --to rider.obj --keep-pose
      warpflat fit trousers.usdc --from "EU 38" --to rider.obj --keep-pose --cut-seam "knee=plane:0,0.47,0 0,1,0"
      warpflat fit skirt.usd --to "EU 40" --ease waist=20mm --ease hip=5cm
    """
    from warpflat.app.cli.flatten import drawn_seam
    from warpflat.app.cli.progress_bar import ProgressBar
    from warpflat.app.scene.fit import (
        FitJob,
        Fitted,
        check_tables,
        ease_wishes,
        fit_to,
        require_own_study,
        study_table,
        write_study,
    )
    from warpflat.app.scene.options import scene_tables

    ease = ease_wishes(eases)
    if len(set(bodies)) < len(bodies):
        raise InputError(f"--to: {next(b for b in bodies if bodies.count(b) > 1)!r} is given twice; give it once")
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", plain_letters(options["name"] or garment.stem)).strip("_.-") or "garment"
    folder = out if out is not None else Path("out") / f"{name}-fitted"
    cuts = [drawn_seam(text) for text in options["cut_seams"]]
    for text, cut in zip(options["cut_seams"], cuts, strict=True):
        if not cut.keys() & {"points", "plane"} and not isinstance(cut.get("line"), list):
            raise InputError(
                f"--cut-seam {quote_value(text)}: what is carried is drawn by points:, line:X,Y,Z ... or plane:"
            )
    # The carried mesh is one of its own, with its unit.
    of_file = dict.fromkeys(("units", "prim", "name"))
    tables = scene_tables({**options, **of_file, "cut_seam": tuple(cuts), "fabric_file": options["fabric_files"]})
    tables["output"] = {"picture": not options["no_picture"], **tables.get("output", {})}
    check_tables(tables, garment, options["cut_seams"])
    require_own_study(folder)
    start_warp_silently()
    job = FitJob.start(
        garment, units=options["units"], prim=options["prim"], name=name, front=options["front"], body=body
    )
    # Every body is built before the first pattern, so that a wrong one is refused at once.
    carried = [job.to(wearer, ease, keep_pose=options["keep_pose"]) for wearer in bodies]
    shown = not (quiet or as_json)
    code, fitted = 0, []
    for one in carried:
        to = folder if len(bodies) == 1 else folder / make_file_name(one.body).replace(" ", "_")
        with ProgressBar(name, hidden=not shown) as bar:
            result = fit_to(job, one, tables, to, name=name, device=device, on_progress=bar)
        kept = (
            [f"its own pattern is kept, and graded by the growth of the cloth; {_ANEW}"]
            if job.keeps_pattern(tables)
            else []
        )
        told = [*([*job.notes, *kept] if shown and one is carried[0] else ()), *one.notes]
        for note in told:
            click.echo(f"warpflat: note: {note}", err=True)
        if len(bodies) > 1 and shown:
            click.echo(f"{one.body}:")
        ended = report_run(result, to, quiet=quiet or as_json, verbose=verbose, as_json=False)
        code = max(code, ended)
        fitted.append(Fitted(carried=one, folder=to, metrics=result.metrics, converged=ended == DONE))
        if shown:
            click.echo(fitted[-1].verdict())
    written = write_study(folder, fitted)
    if as_json:
        click.echo((folder / "fit.json").read_text(encoding="utf-8"), nl=False)
    elif shown:
        for line in study_table(fitted) if len(fitted) > 1 else ():
            click.echo(line)
        click.echo(f"fit: {folder}: {', '.join(written)}")
    return code
