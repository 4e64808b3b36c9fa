"""`warpflat fit`: a garment is carried from its body to another one, and flattened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.options import (
    EXIT_CODES,
    RUN_FILES,
    ComputingCommand,
    Output,
    files_line,
    output_options,
    scene_option,
    scene_options,
)
from warpflat.app.cli.run import report_run, start_warp_silently
from warpflat.app.scene.plain_names import with_plain_letters
from warpflat.core import InputError, find_unused_name, listening_to_reads, make_file_name, quote_value
from warpflat.pattern import refuse_to_replace_others

__all__ = ["fit"]

_ANEW = "--seams auto finds new seams, --seams uv flattens its pieces anew"
_FILES = """\b
  NAME.fitted.obj  the garment on the other body [m], with the islands, groups and materials of its file
  NAME.body.obj    that body, standing as the first one does, or with --keep-pose as its scan is posed [m]
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
@scene_option("surface.units", help="Of the garment's file: m, cm, mm, in ... Needed unless it says (USD).")
@scene_option("surface.prim", help="Which mesh of a USD file.  [default: all]")
@scene_option("find_seams.front", help="Where its front faces: +z, -z, +x, -x.  [default: found]")
@scene_option("find_seams.find", help="As for warpflat flatten.")
@scene_option(
    "seams_cut",
    help="A seam that you draw on the garment as its file has it, with points:, line: or plane: as for warpflat flatten; it is carried "
    "with the cloth.",
)
@scene_options("fabric", "shear_limit")
@scene_option("bands", help="As for warpflat flatten.")
@scene_option("name", help="Name of the files.  [default: the garment's]")
@scene_options("output.frames", "output.picture")
@output_options(folder="out/NAME-fitted", printed="fit.json")
def fit(
    garment: Path,
    body: str | None,
    bodies: tuple[str, ...],
    eases: tuple[str, ...],
    output: Output,
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
        STUDY_FILES,
        Fitted,
        check_tables,
        ease_wishes,
        fit_to,
        keeps_pattern,
        read_job,
        study_table,
        write_study,
    )
    from warpflat.app.scene.options import scene_tables
    from warpflat.garment import Carried

    ease = ease_wishes(eases)
    if len(set(bodies)) < len(bodies):
        raise InputError(f"--to: {next(b for b in bodies if bodies.count(b) > 1)!r} is given twice; give it once")
    name = with_plain_letters(options["name"] or garment.stem) or "garment"
    folder, drawn = output.folder(f"{name}-fitted"), options["cut_seam"]
    cuts = [drawn_seam(text) for text in drawn]
    for text, cut in zip(drawn, cuts, strict=True):
        if not cut.keys() & {"points", "plane"} and not isinstance(cut.get("line"), list):
            raise InputError(
                f"--cut-seam {quote_value(text)}: what is carried is drawn by points:, line:X,Y,Z ... or plane:"
            )
    # The carried mesh is one of its own, with its unit.
    of_file = dict.fromkeys(("units", "prim", "name"))
    tables = scene_tables({**options, **of_file, "cut_seam": tuple(cuts)})
    check_tables(tables, garment, drawn)
    refuse_to_replace_others(folder, STUDY_FILES)
    start_warp_silently()
    job = read_job(garment, units=options["units"], prim=options["prim"], name=name, front=options["front"], body=body)
    # Every body is built before the first pattern, so that a wrong one is refused at once.
    sources, carried = list(job.sources), list[Carried]()
    with listening_to_reads(sources.append):
        for wearer in bodies:
            one = job.to(wearer, ease, keep_pose=options["keep_pose"])
            carried.append(replace(one, body=find_unused_name(one.body, {other.body for other in carried})))
    job = replace(job, sources=tuple(sources))
    code, fitted = 0, []
    for one in carried:
        to = folder if len(bodies) == 1 else folder / make_file_name(one.body).replace(" ", "_")
        with ProgressBar(name, hidden=not output.tells) as bar:
            result = fit_to(job, one, tables, to, name=name, device=output.device, on_progress=bar)
        kept = (
            [f"its own pattern is kept, and graded by the growth of the cloth; {_ANEW}"]
            if keeps_pattern(job, tables)
            else []
        )
        output.tell_notes([*([*job.notes, *kept] if one is carried[0] else ()), *one.notes])
        if len(bodies) > 1 and output.tells:
            click.echo(f"{one.body}:")
        # Of JSON only that of all bodies is printed.
        code = max(code, report_run(result, to, replace(output, quiet=not output.tells, as_json=False)))
        fitted.append(Fitted(carried=one, folder=to, metrics=result.metrics))
        if output.tells:
            click.echo(fitted[-1].verdict())
    written, notes = write_study(folder, fitted)
    output.tell_notes(notes)
    output.report(
        folder / "fit.json",
        lambda: [*([study_table(fitted)] if len(fitted) > 1 else ()), f"fit: {files_line(folder, written)}"],
    )
    return code
