"""`warpflat review`: the review page of a run is written again."""

from __future__ import annotations

from pathlib import Path

import click

from warpflat.app.cli.options import DONE, ComputingCommand, files_line

__all__ = ["review"]


@click.command(cls=ComputingCommand)
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--film", is_flag=True, help="Write film.webp, too: the pattern while it relaxes.")
@click.option("--sheet", is_flag=True, help="Write contact_sheet.png, too: frames of the film on one sheet.")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
def review(folder: Path, film: bool, sheet: bool, quiet: bool) -> int:
    """Write review.html into the folder of a run: film, numbers, seams and pictures in one file that needs no network.

    \b
    Examples:
      warpflat review out/dress
      warpflat review out/dress --film --sheet
    """
    from warpflat.app.cli.run import start_warp_silently
    from warpflat.app.review.moving_picture import write_moving_pictures
    from warpflat.app.review.page import read_run, review_folder
    from warpflat.pattern import output_folder

    read_run(folder)
    with output_folder(folder, guard=True):
        files = [review_folder(folder).name]
        if film or sheet:
            start_warp_silently()
            files += write_moving_pictures(folder, film=film, sheet=sheet)
    if not quiet:
        click.echo(files_line(folder, files))
    return DONE
