"""`warpflat compare`: a scene is run in several fabrics, and the outlines are compared."""

from __future__ import annotations

from pathlib import Path

import click

from warpflat.app.cli.options import (
    DONE,
    EXIT_CODES,
    FAULTY,
    ComputingCommand,
    Output,
    files_line,
    output_options,
    tell,
)
from warpflat.app.cli.run import start_warp_silently

__all__ = ["compare"]


_COMPARED = """\b
What comes out, in DIR:
  compare.json  measures of every piece in each fabric, and how far the outlines lie apart [m]
  compare.png   the outlines laid upon each other
  compare.svg   the same in true size
  compare-drape.png  with --drape: gap and strain of each, worn"""


@click.command(cls=ComputingCommand, epilog=f"{_COMPARED}\n\n{EXIT_CODES}")
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--fabric", "fabrics", multiple=True, metavar="NAME", help="One of those to compare; the first is the base."
)
@click.option("--drape", is_flag=True, help="Sew each of them and put it on its body: gap, strain and pressure, too.")
@output_options(folder="out/NAME-compared", printed="compare.json", verbose=False)
def compare(scene: Path, fabrics: tuple[str, ...], drape: bool, output: Output) -> int:
    """Run a scene in several fabrics and lay the outlines upon each other: table, compare.png, compare.svg, compare.json.

    Cuts, seams and constraints are the scene's in each of them; cuts found automatically are found once and all made.

    \b
    Examples:
      warpflat compare scenes/bodice.toml --fabric denim --fabric jersey --fabric power-net
      warpflat compare scenes/dress.toml --fabric cotton --fabric denim --drape
    """
    from warpflat.app.cli.progress_bar import ProgressBar
    from warpflat.app.review.faults import faults_of
    from warpflat.app.scene.compare import compare_fabrics, compared_files, comparison_table, save_comparison
    from warpflat.app.scene.load import load_scene
    from warpflat.pattern import output_folder

    job = load_scene(scene)
    start_warp_silently()
    with (
        ProgressBar(job.name, hidden=not output.tells) as bar,
        output_folder(
            output.folder(f"{job.name}-compared"), compared_files(drape=drape), sources=job.sources, guard=True
        ) as folder,
    ):
        comparison = compare_fabrics(
            job, fabrics, on_progress=lambda _, progress: bar(progress), device=output.device, drape=drape
        )
        files, notes = save_comparison(comparison, folder)
    warnings = [
        f"{fabric}: {line}"
        for fabric, pieces in comparison.results.items()
        for line in faults_of(
            {
                "pieces": {name: piece.measures for name, piece in pieces.items()},
                **comparison.sewing[fabric],
                **({"drape": comparison.drapes[fabric].measures()} if drape else {}),
            }
        )
    ]
    output.tell_notes((*comparison.notes, *notes))
    for line in warnings:
        tell(line)
    output.report(folder / "compare.json", lambda: [comparison_table(comparison), files_line(folder, files)])
    return FAULTY if warnings else DONE
