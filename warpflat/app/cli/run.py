"""`warpflat run`: a scene file is run, and what came out is reported."""

from __future__ import annotations

import shutil
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpflat.app.cli.options import (
    DONE,
    EXIT_CODES,
    FAULTY,
    RUN_FILES,
    ComputingCommand,
    Output,
    output_options,
    scene_option,
    tell,
)

if TYPE_CHECKING:
    from warpflat.app.scene.load import Scene
    from warpflat.app.scene.run import SceneResult

__all__ = ["report_run", "run", "run_and_report", "start_warp_silently"]


@click.command(cls=ComputingCommand, epilog=f"{RUN_FILES}\n\n{EXIT_CODES}")
@click.argument("scene", type=click.Path(path_type=Path))
@scene_option("shear_limit")
@output_options()
def run(scene: Path, shear_limit: float | None, output: Output) -> int:
    """Run a scene file.

    A scene is a TOML file that names a surface, its feature lines, a fabric and settings; see the folder scenes.

    \b
    Examples:
      warpflat run scenes/dome.toml
      warpflat run scenes/bodice.toml --out bodice --json
    """
    from warpflat.app.scene.load import load_scene

    return run_and_report(load_scene(scene).allowing(shear_limit), output)


def run_and_report(scene: Scene, output: Output) -> int:
    """Run a scene, print what came out, and return the exit code."""
    from warpflat.app.cli.progress_bar import ProgressBar
    from warpflat.pattern import Beside, work_beside

    folder = output.folder(scene.name)
    with ExitStack() as stack:
        bar = stack.enter_context(ProgressBar(scene.name, hidden=not output.tells))
        if "warp" in sys.modules:
            # A process beside this one asks Warp for its devices, which starts it.
            start_warp_silently()
        stack.enter_context(work_beside())
        built = None
        if scene.settings.mannequin is not None and scene.settings.auto_cut is None and scene.settings.shape != "auto":
            from warpflat.app.scene.form import scene_form

            # Before the solver is loaded, which takes as long.
            built = stack.enter_context(Beside(partial(scene_form, scene), "building the mannequin")).result
        from warpflat.app.scene.run import run_scene

        if built is not None and scene.settings.output.picture:
            # While the mannequin is waited for: the processes that draw have it from this one.
            import matplotlib.backends.backend_agg
            import matplotlib.figure  # noqa: F401

        start_warp_silently()
        result = run_scene(scene, folder, on_progress=bar, device=output.device, built=built)
    return report_run(result, folder, output)


def start_warp_silently() -> None:
    """Start Warp without its greeting: standard output is for results, and a mistake is one line on standard error."""
    import warp

    from warpflat.core import start_warp

    warp.config.log_level = warp.LOG_ERROR
    start_warp()


def report_run(result: SceneResult, folder: Path, output: Output) -> int:
    """Print the result of a run, and return the exit code."""
    from warpflat.app.cli.fit_lines import fit_lines
    from warpflat.app.cli.summary import notes_line, summary_lines
    from warpflat.app.cli.tables import drape_lines, run_summary
    from warpflat.app.review.faults import faults_of

    warnings = faults_of(result.metrics)
    if output.tells:
        # What was left out has a line of its own at the end.
        printed = {*warnings, *result.metrics.get("notes", ())}
        notes = [note for note in result.notes if note not in printed]
        for line in [f"note: {note}" for note in notes] if output.verbose else filter(None, [notes_line(notes)]):
            tell(line)
    for warning in warnings:
        tell(warning)

    def words() -> list[str]:
        metrics, files = result.metrics, result.files
        if output.verbose:
            size = [f"size: {result.size}"] if result.size else []
            return [*size, run_summary(metrics, files, str(folder)), *fit_lines(metrics), *drape_lines(metrics)]
        # A pipe takes whole lines.
        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        return summary_lines(metrics, files, str(folder), size=result.size, width=width)

    output.report(folder / "metrics.json", words)
    return FAULTY if warnings else DONE
