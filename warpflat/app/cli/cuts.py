"""`warpflat cuts`: candidates for a cut are compared, and one is made on demand; darts of a form are rotated, split and turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

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
from warpflat.app.cli.run import report_run, start_warp_silently
from warpflat.core import InputError

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
@click.option("--rotate", nargs=2, metavar="DART LINE", help="A form's dart is to lie along another line of its piece.")
@click.option("--split", nargs=2, metavar="DART LINE", help="A second dart along LINE, or between the dart and LINE.")
@click.option(
    "--turn", nargs=2, metavar="DART KIND", help="A form's dart becomes a seam, ease, a pleat, gathers or nothing."
)
@click.option("--at", metavar="LINE", help="Where the mouth of the rotated or second dart lies, as 'shoulder left'.")
@output_options(printed="ledger.json, with --apply metrics.json, of an edited dart edit.json,")
def cuts(
    scene: Path,
    output: Output,
    apply: int | None,
    by: Literal["per_cm", "released"],
    rotate: tuple[str, str] | None,
    split: tuple[str, str] | None,
    turn: tuple[str, str] | None,
    at: str | None,
) -> int:
    """Compare cuts: where the energy is, and what each candidate would release.

    Candidates are the feature lines through or near the peaks of the energy, whole or from the border to the peak, straight
    ways there and, on a form, the darts of a pattern book. The eight that promise most are tried with a coarse relaxation, without the
    scene's seams and constraints; --apply relaxes fully, with them. Writes ledger.json and ledger.png, on a form cuts.toml,
    too, and with --apply all that a run leaves.

    A form's dart, named as "piece.dart", can be rotated, split or turned into something else. The energies of the sewn
    garment before and after are told, and the scene's tables that make the change are printed.

    \b
    Examples:
      warpflat cuts scenes/bodice.toml
      warpflat cuts scenes/bodice.toml --apply 1 --out cut
      warpflat cuts scenes/basic_block.toml --rotate "front_bodice.bust dart" "princess front left" --at "shoulder left"
      warpflat cuts scenes/basic_block.toml --turn "front_bodice.waist dart" seam
    """
    from warpflat.app.scene.load import load_scene

    loaded = load_scene(scene)
    start_warp_silently()
    target = output.folder(loaded.name)
    edits = [(how, edit) for how, edit in (("rotate", rotate), ("split", split), ("turn", turn)) if edit]
    if edits:
        # Edit a dart, and compare the garment before and after.
        from warpflat.app.cli.tables import edit_table
        from warpflat.app.review.faults import faults_of
        from warpflat.app.scene.form_edits import edit_dart
        from warpflat.pattern import output_folder, write_report

        (how, (dart, aim)), *more = edits
        if more:
            raise InputError(f"--{how} and --{more[0][0]}: give one edit at a time")
        if apply is not None:
            raise InputError(f"--{how} and --apply: give one edit at a time")
        if how == "turn" and at is not None:
            raise InputError("--at belongs to --rotate and --split")
        if loaded.settings.mannequin is None:
            raise InputError(f"{loaded.where}: --{how} edits the darts of a form; on a [surface] edit [[cuts]]")
        with output_folder(target, ["edit.json", "cuts.toml"], sources=loaded.sources, guard=True) as folder:
            made = edit_dart(loaded, dart, how=how, aim=aim, at=at, device=output.device)
            data = made.as_dict()
            _write_toml(folder, "The scene's cuts and seams after the edit, instead of its own.", [made.as_toml()])
            write_report(folder / "edit.json", data, name="edit", files=["cuts.toml"])
        output.tell_notes(made.notes)
        warnings = faults_of(made.after.metrics())
        for line in warnings:
            tell(line)
        output.report(
            folder / "edit.json",
            lambda: [edit_table(data), "", made.as_toml(), files_line(folder, ["edit.json", "cuts.toml"])],
        )
        return FAULTY if warnings else DONE
    if at is not None:
        raise InputError("--at belongs to --rotate and --split")
    from warpflat.app.cli.progress_bar import ProgressBar
    from warpflat.app.cli.tables import ledger_table
    from warpflat.app.scene.as_toml import tables_as_toml
    from warpflat.app.scene.form_shaping import sewn_form
    from warpflat.app.scene.ledger import cuts_of_entry, scene_ledger, with_cut
    from warpflat.app.scene.run import files_of_run, run_scene
    from warpflat.pattern import expect_files, optional_file, output_folder, write_ledger_picture, write_report

    expected = ["ledger.json", "ledger.png", *(files_of_run(loaded) if apply is not None else [])]
    result, written = None, list[str]()
    with (
        ProgressBar(loaded.name, hidden=not output.tells) as bar,
        output_folder(target, expected, sources=loaded.sources, guard=True) as folder,
    ):
        closed: tuple[str, ...] = ()
        if loaded.settings.mannequin is not None and loaded.settings.shape == "darts":
            loaded, _, closed = sewn_form(loaded, device=output.device)
        ledger = scene_ledger(loaded, by=by, device=output.device)
        ledger = replace(ledger, notes=(*closed, *ledger.notes))
        chosen = None if apply is None else ledger.entry(apply)
        with optional_file(folder / "ledger.png", written) as path:
            write_ledger_picture(path, ledger)
        listed = [entry.cut for entry in ([chosen] if chosen else ledger.entries) if entry.cut]
        if listed:
            expect_files(folder, ["cuts.toml"])
            pasted = [tables_as_toml({"cuts": [cut]}) for cut in listed]
            _write_toml(folder, "Cuts, the best first: paste one into the scene.", pasted)
            written.append("cuts.toml")
        write_report(folder / "ledger.json", ledger.as_dict(), name="ledger", files=written)
        if chosen is not None and chosen.cut:
            result = run_scene(with_cut(loaded, chosen.cut), folder, on_progress=bar, device=output.device)
        elif apply is not None:
            result = run_scene(loaded, folder, on_progress=bar, device=output.device, cuts=cuts_of_entry(ledger, apply))
    output.tell_notes(ledger.notes)
    if result is None or output.tells:
        output.report(
            folder / "ledger.json",
            lambda: [ledger_table(ledger), files_line(folder, ["ledger.json", *written])],
        )
    return DONE if result is None else report_run(result, folder, output)


def _write_toml(folder: Path, heading: str, tables: Sequence[str]) -> None:
    from warpflat.pattern import atomic_path

    with atomic_path(folder / "cuts.toml") as temporary:
        temporary.write_text("\n".join([f"# {heading}\n", *tables]), encoding="utf-8")
