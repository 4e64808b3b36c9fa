"""`warpflat flatten`: one mesh is flattened as a scene that the options describe."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.options import (
    EXIT_CODES,
    RUN_FILES,
    ComputingCommand,
    Output,
    output_options,
    scene_options,
)
from warpflat.app.cli.run import run_and_report
from warpflat.app.scene.plain_names import with_plain_letters
from warpflat.core import InputError, quote_value

__all__ = ["drawn_seam", "flatten"]

_CUT = re.compile(r"(?:(?P<name>[^:=]*)=)?\s*(?P<way>points|line|plane|edges|marked)\s*(?::(?P<body>.*))?", re.DOTALL)


@click.command(cls=ComputingCommand, epilog=f"{RUN_FILES}\n\n{EXIT_CODES}")
@click.argument("mesh", type=click.Path(path_type=Path))
@scene_options("surface.units", "datum")
@click.option(
    "--open",
    "openings",
    multiple=True,
    metavar="[PIECE:]LINE",
    help="Where a tube, such as a sleeve or a skirt, is cut open: two vertices A,B, one on each border, or a line of the file.  "
    "[default: where its borders are nearest]",
)
@scene_options("start", "output.picture")
@output_options()
def flatten(
    mesh: Path,
    datum: tuple[str, ...],
    openings: tuple[str, ...],
    grain_angle: tuple[str, ...],
    output: Output,
    **options: Any,
) -> int:
    """Flatten one mesh: OBJ, PLY, STL, OFF, GLB, glTF, VRM or USD.

    \b
    Examples:
      warpflat flatten front.obj --units cm
      warpflat flatten scan.ply --units mm --component largest --fabric jersey
      warpflat flatten dress.usdc --prim /World/front --datum /World/centre_front
      warpflat flatten front.obj --units m --datum 120,2087 --out front
      warpflat flatten garment.obj --units cm --component all
      warpflat flatten garment.obj --units cm --component all --datum front:left --grain-angle collar:45 --open sleeve:3,140
      warpflat flatten shirt.obj --units m --fabric woven --seams auto
      warpflat flatten shirt.obj --units m --keep waist --cut-seam "yoke=points:-0.2,1.4,-0.1 0,1.38,-0.12 0.2,1.4,-0.1"
      warpflat flatten leggings.ply --units m --seams none --cut-seam "plane:0,0,0 1,0,0"
      warpflat flatten tshirt.usd --pattern uv
    """
    from warpflat.app.scene.load import make_scene
    from warpflat.app.scene.options import COMMAND_LINE, errors_of_options, scene_tables

    drawn = options["cut_seam"]
    options["cut_seam"] = tuple(drawn_seam(text) for text in drawn)
    if options["component"] is not None and re.fullmatch(r"-?[0-9]{1,18}", options["component"]):
        options["component"] = int(options["component"])
    tables = scene_tables(options)
    tables["surface"] = {"file": str(mesh), **tables.get("surface", {})}
    pieces: dict[str, dict[str, Any]] = {}
    for option, values in (("--datum", datum), ("--open", openings), ("--grain-angle", grain_angle)):
        for value in values:
            piece, colon, text = value.rpartition(":")
            own: dict[str, Any] = pieces.setdefault(piece, {}) if colon else tables
            # A USD curve becomes a line of its name.
            line = text.rstrip("/").rpartition("/")[2]
            numbers = [int(v) for v in text.split(",")] if re.fullmatch(r"[0-9]{1,18}(,[0-9]{1,18})+", text) else []
            ends = {"from": numbers[0], "to": numbers[1]} if len(numbers) == 2 else {"vertices": numbers}
            angle: float | str = text
            with suppress(ValueError):  # the scene refuses what is no number
                angle = float(text)
            key, given = {
                "--datum": ("datum", "datum" if numbers else line),
                "--open": ("cuts", [{"name": "opening", **ends}] if len(numbers) == 2 else [{"line": line}]),
                "--grain-angle": ("grain_angle", angle),
            }[option]
            if key in own:
                what = f"piece {quote_value(piece)}" if colon else "the piece"
                raise InputError(
                    f"{option} is given twice for {what}; give it once, or of several pieces as {option} PIECE:..."
                )
            own[key] = given
            if option == "--datum" and numbers:
                own["lines"] = {"datum": ends}
    if pieces:
        tables["pieces"] = pieces
    with errors_of_options(mesh, drawn):
        scene = make_scene(tables, name=with_plain_letters(mesh.stem) or "piece", folder=Path(), where=COMMAND_LINE)
        return run_and_report(scene, output)


def drawn_seam(text: str) -> dict[str, Any]:
    """Return the table of a scene's `[[seams_cut]]` that an option `--cut-seam` stands for.

    Raises:
        InputError: it is none.
    """
    found = _CUT.fullmatch(text.strip())
    where = f"--cut-seam {quote_value(text)}"
    if found is None or (found["body"] is None) != (found["way"] == "marked"):
        raise InputError(
            f"{where}: give points:, line:, plane:, edges:FILE or marked, perhaps with NAME= before it, "
            'as "side left=points:0.2,1,0 0.2,0.6,0"'
        )
    way, body = found["way"], (found["body"] or "").strip()
    name = {} if found["name"] is None else {"name": found["name"].strip()}
    if way == "marked":
        return {**name, "marked": True}
    if way == "edges" or (way == "line" and "," not in body):
        return {**name, way: body}
    places: list[Any] = []
    for word in body.split():
        numbers = word.split(",")
        try:
            if way == "points" and re.fullmatch("[0-9]{1,18}", word):
                places.append(int(word))
                continue
            places.append([float(number) for number in numbers])
            if len(numbers) != 3:
                raise ValueError
        except ValueError:
            right = "X,Y,Z in metres" + (", or the number of a vertex" if way == "points" else "")
            raise InputError(f"{where}: {quote_value(word)} is no place; give {right}") from None
    if way != "plane":
        return {**name, way: places}
    if len(places) not in (2, 3):
        raise InputError(f"{where}: a plane is a point and a normal, and perhaps a direction; got {len(places)} places")
    plane = dict(zip(("point", "normal", "towards"), places, strict=False))
    return {**name, "plane": plane}
