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
    fabric_file_option,
    output_options,
    shear_limit_option,
)
from warpflat.app.cli.run import run_and_report
from warpflat.core import InputError, plain_letters, quote_value

__all__ = ["drawn_seam", "flatten"]

_CUT = re.compile(r"(?:(?P<name>[^:=]*)=)?\s*(?P<way>points|line|plane|edges|marked)\s*(?::(?P<body>.*))?", re.DOTALL)


@click.command(cls=ComputingCommand, epilog=f"{RUN_FILES}\n\n{EXIT_CODES}")
@click.argument("mesh", type=click.Path(path_type=Path))
@click.option("--units", metavar="UNIT", help="Unit of the file: m, cm, mm, in ... Needed unless the file says (USD).")
@click.option(
    "--component",
    metavar="WHICH",
    help="Which connected part: largest, or 0, 1, ... by area; all makes a piece of each, and seams of edges that meet.",
)
@click.option(
    "--seams",
    metavar="HOW",
    help="auto: cut a whole garment along islands of its texture that look like cut pieces, else where a tailor would; uv, materials, "
    "groups: along what the file has; file: along the first of these that it has; none: keep it whole.  [default: auto where one piece "
    "cannot lie flat]",
)
@click.option(
    "--front", metavar="AXIS", help="Where the front of a whole garment faces: +z, -z, +x ...  [default: found]"
)
@click.option("--up", metavar="AXIS", help="Where up is: +y, +z ...  [default: found]")
@click.option(
    "--no",
    multiple=True,
    metavar="SEAM",
    help='A seam that is left closed: "shoulder", "side left"; "uv": not the texture\'s.',
)
@click.option(
    "--keep", multiple=True, metavar="SEAM", help='A seam that is made in any case: "waist", "yoke", "centre back".'
)
@click.option(
    "--cut-seam",
    "cut_seams",
    multiple=True,
    metavar="[NAME=]WAY",
    help='A seam that you draw, in metres: "points:X,Y,Z X,Y,Z ..." over the cloth, "line:X,Y,Z X,Y,Z ..." projected onto it, '
    '"plane:POINT NORMAL" or "plane:POINT NORMAL TOWARDS" for half a plane, "edges:FILE" of vertex numbers, "line:NAME" of the file, '
    '"marked" for all lines and creases of the file.',
)
@click.option(
    "--body",
    metavar="FILE",
    help="A mesh of the body under a whole garment, in the same place and unit: seams at the waist are made at its waist.",
)
@click.option("--smooth", type=float, metavar="MM", help="Smooth wrinkles over so many millimetres before it is cut.")
@click.option("--most-pieces", type=int, metavar="N", help="At most so many pieces.  [default: as usual for its kind]")
@click.option(
    "--limit",
    type=float,
    metavar="SHARE",
    help="Of the cloth that may stay beyond its limit before darts and further seams are tried.  [default: 0.02]",
)
@click.option(
    "--meet",
    type=float,
    metavar="MM",
    help="With --component all: sew borders that run along each other within so many millimetres.  [default: 1]",
)
@click.option(
    "--pattern",
    metavar="uv",
    help="uv: the islands of the texture are the sewn pattern in true size, as of CLO, Style3D and GarmentCode: take it as it is, and "
    "compare it with what flattening gives.",
)
@click.option("--prim", metavar="PATH", help="Which mesh of a USD file.")
@click.option("--name", metavar="NAME", help="Name of the piece and its files.  [default: the file's]")
@click.option("--fabric", metavar="NAME", help="A fabric of the library; warpflat fabrics lists them.")
@fabric_file_option
@shear_limit_option
@click.option(
    "--datum",
    "datums",
    multiple=True,
    metavar="[PIECE:]LINE",
    help="The line laid straight first: two vertices A,B, counted from 0 (the shortest path between them), a side "
    "of the piece (bottom, left, right, top), or a line of the file (a USD curve). Of several pieces for each by its name.  "
    "[default: a long line through the middle]",
)
@click.option(
    "--open",
    "openings",
    multiple=True,
    metavar="[PIECE:]LINE",
    help="Where a tube, such as a sleeve or a skirt, is cut open: two vertices A,B, one on each border, or a line of the file.  "
    "[default: where its borders are nearest]",
)
@click.option(
    "--start",
    metavar="FILE",
    help="An OBJ file of the same mesh: relax from its texture coordinates.  [default: chosen by cost]",
)
@click.option(
    "--grain-angle",
    "grain_angles",
    multiple=True,
    metavar="[PIECE:]DEGREES",
    help="Turns the warp from the datum; 45 is the bias.",
)
@click.option(
    "--bands",
    metavar="HOW",
    help="Long strips of even width: straight: cut them straight, to be stretched as they are sewn; as worn: curved as they lie; auto: "
    "straight where a slender ring is sewn along one side, as a neck band.  [default: auto]",
)
@click.option("--bands-shorter", type=float, metavar="SHARE", help="Cut straight bands shorter still, as rib is: 0.1.")
@click.option(
    "--model",
    metavar="NAME",
    help="auto: springs on quads along the grain, else membrane, cells in which the cloth is measured as worn; membrane: everywhere.  "
    "[default: auto]",
)
@click.option("--stretch-warp", type=float, metavar="SHARE", help="Worn so much longer than flat along the warp: 0.1.")
@click.option("--stretch-weft", type=float, metavar="SHARE", help="The same along the weft.")
@click.option("--pressure", type=float, metavar="PA", help="On the skin; sets the stretch that runs around the body.")
@click.option(
    "--solver",
    type=click.Choice(["auto", "paper", "multilevel", "plain"]),
    help="Paper: the paper's steps alone.  [default: auto]",
)
@click.option("--max-steps", type=int, metavar="N", help="Give up after the work of so many steps.")
@click.option("--time-step", type=float, metavar="SECONDS", help="Of the approximate implicit integration.")
@click.option(
    "--gap",
    type=float,
    metavar="MM",
    help="A piece that would lie over itself is parted where its border is nearer than this; 0: not.  [default: 0.5]",
)
@click.option("--frames", type=int, metavar="N", help="About how many frames, 0 for none.  [default: 60]")
@click.option("--no-picture", is_flag=True, help="Write no picture.png.")
@output_options()
def flatten(
    mesh: Path,
    out: Path | None,
    quiet: bool,
    verbose: bool,
    as_json: bool,
    device: str | None,
    datums: tuple[str, ...],
    openings: tuple[str, ...],
    grain_angles: tuple[str, ...],
    **options: Any,
) -> int:
    """Flatten one mesh: OBJ, PLY, STL, OFF, GLB, VRM, glTF or USD.

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

    options["cut_seam"] = tuple(drawn_seam(text) for text in options["cut_seams"])
    options["fabric_file"] = options["fabric_files"]
    if options["component"] is not None and re.fullmatch(r"-?[0-9]{1,18}", options["component"]):
        options["component"] = int(options["component"])
    tables = scene_tables(options)
    tables["surface"] = {"file": str(mesh), **tables.get("surface", {})}
    tables["output"] = {"picture": not options["no_picture"], **tables.get("output", {})}
    pieces: dict[str, dict[str, Any]] = {}
    for option, values in (("--datum", datums), ("--open", openings), ("--grain-angle", grain_angles)):
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
    # "Ärmel (1).obj" gives files "Armel_1".
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", plain_letters(mesh.stem)).strip("_.-") or "piece"
    with errors_of_options(mesh, options["cut_seams"]):
        scene = make_scene(tables, name=name, folder=Path(), where=COMMAND_LINE)
        return run_and_report(scene, out, quiet=quiet, verbose=verbose, as_json=as_json, device=device)


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
