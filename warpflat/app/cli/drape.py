"""`warpflat drape`: a garment is sewn, put on its body and measured: a scene's, a run's, or a pattern's from a file."""

from __future__ import annotations

from pathlib import Path

import click

from warpflat.app.cli.options import (
    DONE,
    EXIT_CODES,
    RUN_FILES,
    ComputingCommand,
    Output,
    output_options,
    scene_option,
)
from warpflat.app.cli.run import report_run, run_and_report, start_warp_silently

__all__ = ["drape"]

_FILES = """\b
  NAME.draped.obj  each piece as it is worn [m], with the pattern [m] as texture coordinates
  drape.png        gap, strain and shear from the front, the side and the back
  drape.webp       how the cloth comes to rest
  worn.usdc        with --usd: the worn garment as one mesh
  corrected.png, NAME.corrected.dxf, NAME.corrected.svg
                   with --correct: the outlines before and after, and the corrected pattern
Of a pattern these, frames.usdc and metrics.json come out alone."""


@click.command(cls=ComputingCommand, epilog=f"{RUN_FILES}\n\n{_FILES}\n\n{EXIT_CODES}")
@click.argument("scene", metavar="SCENE|DIR|PATTERN", type=click.Path(path_type=Path))
@click.option("--body", metavar="SIZE|SCAN", help='Of a pattern: a size, such as "EU 38", or a scan\'s file.')
@click.option("--fabric", metavar="NAME", help="Of a pattern.  [default: its own, or woven]")
@scene_option("shear_limit")
@click.option("--seams", type=click.Path(path_type=Path), metavar="FILE", help="Of a pattern: TOML with its [[seams]].")
@click.option("--units", metavar="UNIT", help="Of a mesh whose texture is its sewn pattern, unless the file says.")
@click.option("--size", metavar="SIZE", help="Of a graded pattern.  [default: its sample size]")
@click.option(
    "--correct",
    is_flag=True,
    help="Change the pattern until the worn garment lies where a scene designed it; let one of a file out where it is stretched too far.",
)
@click.option(
    "--edges", is_flag=True, help="Print the edges of a pattern's pieces, to name them in [[seams]]; drape nothing."
)
@click.option("--usd", is_flag=True, help="Write worn.usdc, too: the worn garment as one mesh with its pattern.")
@output_options()
def drape(
    scene: Path,
    output: Output,
    body: str | None,
    fabric: str | None,
    shear_limit: float | None,
    seams: Path | None,
    units: str | None,
    size: str | None,
    edges: bool,
    correct: bool,
    usd: bool,
) -> int:
    """Put a sewn garment on its body: a scene's, a run's, or that of a pattern (pattern.json, GarmentCode, DXF, SVG, or a
    mesh whose texture is its sewn pattern, as of CLO and Style3D).

    For a scene it is as if it had a [drape] table; the settings of one that it has hold. A pattern is placed by its seams. A DXF
    or an SVG of another program names none: they stand in a TOML file.

    \b
    Examples:
      warpflat drape scenes/basic_block.toml
      warpflat drape scenes/basic_block.toml --correct
      warpflat drape out/dress --fabric denim
      warpflat drape shirt_specification.json --body scan.obj
      warpflat drape tshirt.usd --body avatar.usd
      warpflat drape shirt.dxf --edges
      warpflat drape shirt.dxf --seams shirt.toml --body "EU 38"
    """
    from dataclasses import replace

    from warpflat.app.scene.load import load_scene
    from warpflat.app.scene.outside_pattern import OutsideJob, drape_outside, edge_table, is_pattern_file
    from warpflat.app.scene.schema import DrapeTable
    from warpflat.core import InputError

    if is_pattern_file(scene):
        if edges:
            lines, notes = edge_table(scene, sewing=seams, units=units)
            output.tell_notes(notes)
            click.echo("\n".join(lines))
            return DONE
        start_warp_silently()
        job = OutsideJob.read(scene, sewing=seams, body=body, units=units)
        folder = output.folder(f"{job.name}-draped")
        result = drape_outside(
            job, folder, fabric=fabric, shear_limit=shear_limit, size=size, device=output.device, usd=usd,
            correct=correct,
        )  # fmt: skip
        return report_run(result, folder, output)
    of_pattern = {"units": units, "body": body, "fabric": fabric, "seams": seams, "size": size, "edges": edges or None}
    for option, value in of_pattern.items():
        if value is not None:
            raise InputError(
                f"--{option}: is for a pattern's file or a run's folder; {scene} is a scene, which says it itself"
            )
    loaded = load_scene(scene).allowing(shear_limit)
    if loaded.settings.half:
        raise InputError(f"{scene}: half: a drape needs the whole garment; leave out half = true")
    asked = {key: True for key, wanted in (("correct", correct), ("usd", usd)) if wanted}
    table = (loaded.settings.drape or DrapeTable()).model_copy(update=asked)
    loaded = replace(loaded, settings=loaded.settings.model_copy(update={"drape": table}))
    return run_and_report(loaded, output)
