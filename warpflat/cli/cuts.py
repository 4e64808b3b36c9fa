"""`warpflat cuts`: candidates for a cut are compared, and one is made on demand."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from warpflat.cli.options import DONE, EXIT_CODES, ComputingCommand, output_options
from warpflat.cli.run import report_run, start_warp_silently

__all__ = ["cuts"]


@click.command(cls=ComputingCommand, epilog=EXIT_CODES)
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("--apply", "apply", type=int, metavar="N", help="Make the cut of that number and run the scene with it.")
@click.option(
    "--by",
    type=click.Choice(["per_cm", "released"]),
    default="per_cm",
    show_default=True,
    help="What the order goes by: energy released per centimetre cut, or in all.",
)
@output_options(printed="ledger.json, with --apply metrics.json,")
def cuts(
    scene: Path,
    out: Path | None,
    quiet: bool,
    verbose: bool,
    as_json: bool,
    device: str | None,
    apply: int | None,
    by: Literal["per_cm", "released"],
) -> int:
    """Compare cuts: where the energy is, and what each candidate would release.

    Candidates are the feature lines through or near the peaks of the energy, whole or from the border to the peak, and
    paths that follow the energy. Each is tried with a coarse relaxation, without the scene's seams and constraints;
    --apply relaxes fully, with them. Writes ledger.json and ledger.png, with --apply all that a run leaves, too.

    \b
    Examples:
      warpflat cuts scenes/bodice.toml
      warpflat cuts scenes/bodice.toml --apply 1 --out cut
    """
    from warpflat.cli.progress_bar import ProgressBar
    from warpflat.cli.tables import ledger_table
    from warpflat.core.atomic_files import output_folder
    from warpflat.core.json_file import write_json
    from warpflat.cutting.ledger_picture import write_ledger_picture
    from warpflat.scene.cuts import cuts_of_entry
    from warpflat.scene.load import load_scene
    from warpflat.scene.run import files_of_run, run_scene, scene_ledger

    loaded = load_scene(scene)
    start_warp_silently()
    target = out if out is not None else Path("out") / loaded.name
    files = ["ledger.json", "ledger.png", *(files_of_run(loaded) if apply is not None else [])]
    result = None
    with (
        ProgressBar(loaded.name, hidden=quiet or as_json) as bar,
        output_folder(target, files, sources=loaded.sources) as folder,
    ):
        ledger = scene_ledger(loaded, by=by, device=device)
        write_json(folder / "ledger.json", ledger.as_dict())
        write_ledger_picture(folder / "ledger.png", ledger)
        if apply is not None:
            sequence = cuts_of_entry(ledger, apply)
            result = run_scene(loaded, folder, on_progress=bar, device=device, cuts=sequence)
    if as_json and result is None:
        click.echo((folder / "ledger.json").read_text(encoding="utf-8"), nl=False)
    elif not (quiet or as_json):
        for note in ledger.notes:
            click.echo(f"warpflat: note: {note}", err=True)
        click.echo(f"{ledger_table(ledger)}\n{folder}: ledger.json, ledger.png")
    return DONE if result is None else report_run(result, folder, quiet=quiet, verbose=verbose, as_json=as_json)
