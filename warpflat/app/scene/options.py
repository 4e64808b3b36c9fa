"""Options of the command line that stand for keys of a scene: the tables that they make, and how errors call them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

from warpflat.core import InputError, quote_value

__all__ = [
    "COMMAND_LINE",
    "SCENE_OPTIONS",
    "Dialect",
    "Paper",
    "PatternFormat",
    "PrintedUnit",
    "SceneOption",
    "errors_of_options",
    "scene_tables",
]

#: What messages about a scene that was made from options begin with.
COMMAND_LINE = "command line"
# A scene's key at the beginning of a message, with its number in a list.
_KEY = re.compile(
    r"(?P<key>[a-z_]+(?:\.[a-z_]+|: [a-z_]+(?= = ))*)(?:\[(?P<number>\d+)\](?:\.[a-z_]+)*)?(?P<rest>(?:: | = | ').*)",
    re.DOTALL,
)


#: Formats of pattern files, dialects of the DXF, papers of the PDF, and units of what is printed.
PatternFormat = Literal["dxf", "svg", "pdf", "json", "garmentcode", "plt"]
Dialect = Literal["aama", "astm"]
Paper = Literal["A4", "Letter", "A0", "Projector"]
PrintedUnit = Literal["mm", "cm", "in"]


class SceneOption(NamedTuple):
    """An option of the command line that sets a key of a scene.

    Attributes:
        declaration: its name with its dashes, and what its value is called where `kind` does not list the values.
        help: what it does.
        kind: of its value: text, a number, one of several words, or `bool` of a switch, which sets the key to false.
        multiple: whether it may be given several times.
    """

    declaration: str
    help: str
    kind: type | Sequence[str] = str
    multiple: bool = False

    @property
    def name(self) -> str:
        """Its name with its dashes."""
        return self.declaration.partition(" ")[0]


#: By key of a scene the option that sets it, in the order of `warpflat flatten --help`.
SCENE_OPTIONS: Mapping[str, SceneOption] = {
    "surface.units": SceneOption("--units UNIT", "Unit of the file: m, cm, mm, in ... Needed unless the file says (USD)."),
    "surface.component": SceneOption(
        "--component WHICH",
        "Which connected part: largest, or 0, 1, ... by area; all makes a piece of each, and seams of edges that meet.",
    ),
    "find_seams.find": SceneOption(
        "--seams HOW",
        "auto: cut a whole garment along islands of its texture that look like cut pieces, else where a tailor would; uv, "
        "materials, groups: along what the file has; file: along the first of these that it has; none: keep it whole.  "
        "[default: auto where one piece cannot lie flat]",
    ),
    "find_seams.front": SceneOption("--front AXIS", "Where the front of a whole garment faces: +z, -z, +x ...  [default: found]"),
    "find_seams.up": SceneOption("--up AXIS", "Where up is: +y, +z ...  [default: found]"),
    "find_seams.no": SceneOption(
        "--no SEAM",
        'A seam that is left closed: "shoulder", "side left"; "uv": not the texture\'s.', multiple=True,
    ),
    "find_seams.keep": SceneOption(
        "--keep SEAM",
        'A seam that is made in any case: "waist", "yoke", "centre back".', multiple=True,
    ),
    "seams_cut": SceneOption(
        "--cut-seam [NAME=]WAY",
        'A seam that you draw, in metres: "points:X,Y,Z X,Y,Z ..." over the cloth, "line:X,Y,Z X,Y,Z ..." projected onto '
        'it, "plane:POINT NORMAL" or "plane:POINT NORMAL TOWARDS" for half a plane, "edges:FILE" of vertex numbers, '
        '"line:NAME" of the file, "marked" for all lines and creases of the file.', multiple=True,
    ),
    "find_seams.body": SceneOption(
        "--body FILE",
        "A mesh of the body under a whole garment, in the same place and unit: seams at the waist are made at its waist.",
    ),
    "find_seams.smooth_mm": SceneOption("--smooth MM", "Smooth wrinkles over so many millimetres before it is cut.", float),
    "find_seams.most_pieces": SceneOption("--most-pieces N", "At most so many pieces.  [default: as usual for its kind]", int),
    "find_seams.limit": SceneOption(
        "--limit SHARE",
        "Of the cloth that may stay beyond its limit before darts and further seams are tried.  [default: 0.02]", float,
    ),
    "surface.meet_mm": SceneOption(
        "--meet MM",
        "With --component all: sew borders that run along each other within so many millimetres.  [default: 1]", float,
    ),
    "surface.pattern": SceneOption(
        "--pattern uv",
        "uv: the islands of the texture are the sewn pattern in true size, as of CLO, Style3D and GarmentCode: take it as "
        "it is, and compare it with what flattening gives.",
    ),
    "surface.prim": SceneOption("--prim PATH", "Which mesh of a USD file."),
    "name": SceneOption("--name NAME", "Name of the piece and its files.  [default: the file's]"),
    "fabric": SceneOption("--fabric NAME", "A fabric of the library; warpflat fabrics lists them."),
    "fabric_files": SceneOption(
        "--fabric-file FILE",
        "A fabric file of your own; its only fabric needs no --fabric.", multiple=True,
    ),
    "shear_limit": SceneOption(
        "--shear-limit DEGREES",
        "How far warp and weft may be off the right angle; tailors trust 5 to 8.  [default: the fabric's]", float,
    ),
    "datum": SceneOption(
        "--datum [PIECE:]LINE",
        "The line laid straight first: two vertices A,B, counted from 0 (the shortest path between them), a side of the "
        "piece (bottom, left, right, top), or a line of the file (a USD curve). Of several pieces for each by its name.  "
        "[default: a long line through the middle]", multiple=True,
    ),
    "start": SceneOption(
        "--start FILE",
        "An OBJ file of the same mesh: relax from its texture coordinates.  [default: chosen by cost]",
    ),
    "grain_angle": SceneOption("--grain-angle [PIECE:]DEGREES", "Turns the warp from the datum; 45 is the bias.", multiple=True),
    "bands": SceneOption(
        "--bands HOW",
        "Long strips of even width: straight: cut them straight, to be stretched as they are sewn; as worn: curved as they "
        "lie; auto: straight where a slender ring is sewn along one side, as a neck band.  [default: auto]",
    ),
    "bands_shorter": SceneOption("--bands-shorter SHARE", "Cut straight bands shorter still, as rib is: 0.1.", float),
    "model": SceneOption(
        "--model NAME",
        "auto: springs on quads along the grain, else membrane, cells in which the cloth is measured as worn; membrane: "
        "everywhere; springs: refused where they would be another cloth.  [default: auto]",
    ),
    "wear.stretch_warp": SceneOption("--stretch-warp SHARE", "Worn so much longer than flat along the warp: 0.1.", float),
    "wear.stretch_weft": SceneOption("--stretch-weft SHARE", "The same along the weft.", float),
    "wear.pressure": SceneOption("--pressure PA", "On the skin; sets the stretch that runs around the body.", float),
    "relax.solver": SceneOption(
        "--solver",
        "Paper: the paper's steps alone.  [default: auto]", ("auto", "paper"),
    ),
    "relax.max_steps": SceneOption("--max-steps N", "Give up after the work of so many steps.", int),
    "relax.time_step": SceneOption("--time-step SECONDS", "Of the approximate implicit integration.", float),
    "relax.gap_mm": SceneOption(
        "--gap MM",
        "A piece that would lie over itself is parted where its border is nearer than this; 0: not.  [default: 0.5]", float,
    ),
    "output.frames": SceneOption("--frames N", "About how many frames, 0 for none.  [default: 60]", int),
    "output.picture": SceneOption("--no-picture", "Write no pictures, and no review.html, which shows them.", bool),
    "device": SceneOption("--device NAME", "Warp device, such as cpu or cuda:0.  [default: Warp's choice]"),
}  # fmt: skip


def scene_tables(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a scene that options make; those that are None or empty make none.

    Args:
        options: by their names, with "_"; what is no key of a scene is passed over.
    """
    tables: dict[str, Any] = {}
    for key, option in SCENE_OPTIONS.items():
        value = options.get(option.name.removeprefix("--").replace("-", "_"))
        if value is not None and value != ():
            *table, last = key.split(".")
            inner = tables.setdefault(table[0], {}) if table else tables
            inner[last] = list(value) if isinstance(value, tuple) else value
    return tables


@contextmanager
def errors_of_options(mesh: Path, drawn: Sequence[str] = ()) -> Iterator[None]:
    """Let InputErrors about a scene that was made from options name the option, or the mesh where they are about none.

    Args:
        mesh: the file.
        drawn: what `--cut-seam` was given.
    """
    try:
        yield
    except InputError as error:
        text = re.sub(r'component = "(largest|all)"', r"--component \1", str(error))
        if not text.startswith(f"{COMMAND_LINE}: "):
            raise type(error)(text) from None
        text = text.removeprefix(f"{COMMAND_LINE}: ")
        found = _KEY.fullmatch(text)
        key = "" if found is None else found["key"].replace(": ", ".")
        # Options of the relaxation are named without their table.
        key = (
            key
            if key in SCENE_OPTIONS
            else next((each for each in SCENE_OPTIONS if each.rpartition(".")[2] == key), key)
        )
        if found is None:
            text = f"{mesh}: {text}"
        elif key in SCENE_OPTIONS:
            given = (
                f" {quote_value(drawn[int(found['number'])])}"
                if found["number"] and key == "seams_cut" and drawn
                else ""
            )
            text = f"{SCENE_OPTIONS[key].name}{given}{found['rest']}"
        else:
            text = str(error)
        raise type(error)(text) from None
