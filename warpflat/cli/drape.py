"""`warpflat drape`: the garment of a scene is flattened, sewn, put on its body and measured."""

from __future__ import annotations

from pathlib import Path

import click

from warpflat.cli.options import EXIT_CODES, RUN_FILES, ComputingCommand, output_options
from warpflat.cli.run import run_and_report

__all__ = ["drape"]

_FILES = """\b
  NAME.draped.obj  each piece as it is worn [m], with the pattern [m] as texture coordinates
  drape.png        gap and strain from the front, the side and the back"""


@click.command(cls=ComputingCommand, epilog=f"{RUN_FILES}\n\n{_FILES}\n\n{EXIT_CODES}")
@click.argument("scene", type=click.Path(path_type=Path))
@output_options()
def drape(scene: Path, out: Path | None, quiet: bool, verbose: bool, as_json: bool, device: str | None) -> int:
    """Run a scene file and put the sewn garment on its body.

    It is as if the scene had a [drape] table; the settings of one that it has hold.

    \b
    Examples:
      warpflat drape scenes/basic_block.toml
      warpflat drape scenes/dress.toml --out dress --json
    """
    from dataclasses import replace

    from warpflat.core.errors import InputError
    from warpflat.scene.load import load_scene
    from warpflat.scene.schema import DrapeTable

    loaded = load_scene(scene)
    if loaded.settings.half:
        raise InputError(f"{scene}: half: a drape needs the whole garment; leave out half = true")
    table = loaded.settings.drape or DrapeTable()
    loaded = replace(loaded, settings=loaded.settings.model_copy(update={"drape": table}))
    return run_and_report(loaded, out, quiet=quiet, verbose=verbose, as_json=as_json, device=device)
