"""`warpflat studio`: a scene is edited on a page in the browser."""

from __future__ import annotations

import time
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpflat.app.cli.options import DONE, ComputingCommand, tell

if TYPE_CHECKING:
    from warpflat.app.scene.load import Scene

__all__ = ["scene_of_mesh", "studio"]

# What is edited where no scene is given.
_BLOCK = {
    "fabric": "woven",
    "form": "basic_block",
    "shape": "darts",
    "ease": "close",
    "mannequin": {"size": "EU 38"},
}


@click.command(cls=ComputingCommand)
@click.argument("scene", metavar="[SCENE|MESH]", type=click.Path(path_type=Path), required=False)
@click.option("--units", metavar="UNIT", help="Of a mesh that carries none: m, dm, cm, mm, in or ft.")
@click.option("--fabric", metavar="NAME", help="Of a mesh.  [default: isotropic]")
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Address to serve on; 0.0.0.0 opens it to other machines."
)
@click.option("--port", type=click.IntRange(1, 65535), default=8220, show_default=True, help="Port to serve on.")
@click.option(
    "--out",
    "-o",
    type=click.Path(path_type=Path),
    default=Path("out"),
    metavar="DIR",
    help="Where runs are saved.  [default: out]",
)
@click.option("--open/--no-open", "show", default=True, help="Open the page in the browser.  [default: open]")
def studio(
    scene: Path | None, units: str | None, fabric: str | None, host: str, port: int, out: Path, show: bool
) -> int:
    """Edit a scene on a page in the browser: body, form, cloth, ease, grain and cuts, with the pattern beside it.

    Saving writes a scene file beside the scene or mesh that was opened, under a name of its own, and runs it from scratch. A MESH
    is one piece: OBJ, PLY, STL, OFF, GLB, glTF, VRM or USD. Without either it begins with the basic block of size EU 38. Ctrl-C ends
    the studio. The address that it prints has a token in it: only who opens that address is let in.

    It needs viser: pip install ".[studio]" in a checkout.

    \b
    Examples:
      warpflat studio scenes/bodice.toml
      warpflat studio front.obj --units cm --fabric denim
      warpflat studio
    """
    from warpflat.app.cli.run import start_warp_silently
    from warpflat.app.scene.load import load_scene, make_scene
    from warpflat.core import InputError

    if find_spec("viser") is None:
        raise InputError('the studio needs viser: pip install ".[studio]" in a checkout')
    if scene is not None and scene.suffix.lower() != ".toml":
        made = scene_of_mesh(scene, units=units, fabric=fabric)
    else:
        for option, value in (("--units", units), ("--fabric", fabric)):
            if value is not None:
                raise InputError(f"{option}: is for a mesh; a scene says it itself")
        made = load_scene(scene) if scene else make_scene(_BLOCK, name="block", folder=Path(), where="studio")
    start_warp_silently()
    from warpflat.app.studio.page import Page

    page = Page(made, host=host, port=port, out=out)
    click.echo(f"{page.url}  (Ctrl-C ends the studio)")
    if page.door.opens:
        tell(f"note: {page.door.opens}")
    if show:
        import webbrowser

        webbrowser.open(page.url)
    try:
        while True:
            time.sleep(3600.0)
    finally:
        page.close()
    return DONE


def scene_of_mesh(mesh: Path, *, units: str | None = None, fabric: str | None = None) -> Scene:
    """Return a scene of one piece of a mesh file, which lies where a scene of it will be saved.

    Raises:
        InputError: there is no such file, or it has no unit and none is given.
    """
    from warpflat.app.scene.load import make_scene
    from warpflat.app.scene.options import scene_tables
    from warpflat.app.scene.surface import scene_surface
    from warpflat.core import make_file_name

    tables = scene_tables({"units": units, "fabric": fabric})
    tables["surface"] = {"file": mesh.name, **tables.get("surface", {})}
    made = make_scene(tables, name=make_file_name(mesh.stem), folder=mesh.parent, where=str(mesh))
    # Before a page is opened: what is wrong with the file is one line here.
    scene_surface(made)
    return made
