"""The regression files: each a past failure, in tests/regressions, run by its name.

NAME.obj, .ply, .stl, .off, .glb, .gltf, .usd, .usda, .usdc, .usdz   flattened
NAME.scene.toml                                                      run
NAME.fabric.toml                                                     listed, and flattened with
NAME.pattern.json                                                    exported in all formats
NAME.metrics.json                                                    in the folder of results before a run
NAME.scan.obj                                                        made a mannequin
NAME.fit.obj                                                         fitted to a size, and taken for a body
NAME.sewn.obj                                                        taken as a sewn pattern by its texture
NAME.dxf, .svg, .garmentcode.json                                    its edges listed by `drape --edges`; .rul too
NAME.sewing.toml                                                     beside a DXF
NAME.frames.usdc, .lift.obj, .runmetrics.json, .runpattern.json      in the folder of a run: reviewed, exported, draped
NAME.worn.json                                                       a pattern, draped on a body
NAME.arguments.json                                                  a list of strings: the command line
NAME.studio.json                                                     done to the studio, as studio_messages says
NAME.folder.json                                                     files, links and command line (see `folders.py`)

NAME says what the file has, such as `one_vertex_far_away`. A file must keep the promise, and may be refused or not;
NAME.refused.obj must be refused, NAME.accepted.obj must not. `NAME.obj.gz` is unpacked first.
"""

from __future__ import annotations

import gzip
from importlib.util import find_spec
from pathlib import Path

from .folders import unpacked
from .foreign_files import FOREIGN_ENDINGS, foreign_cases_of_file
from .promise import Case
from .seeds import MESHES, case_of_file
from .studio_messages import attack_case

__all__ = ["REGRESSIONS", "cases_of", "regression_files"]

REGRESSIONS = Path(__file__).resolve().parents[1] / "regressions"
_TWO_ENDINGS = {
    ".scene.toml": "scene",
    ".fabric.toml": "fabric",
    ".pattern.json": "pattern",
    ".metrics.json": "metrics",
    ".scan.obj": "scan",
    ".fit.obj": "fit",
    ".sewn.obj": "sewn",
    ".arguments.json": "arguments",
    ".studio.json": "studio",
    **FOREIGN_ENDINGS,
}


def cases_of(file: Path) -> list[Case]:
    """The cases of a regression file, told by its name."""
    content, name = file.read_bytes(), file.name
    if name.endswith(".gz"):
        content, name = gzip.decompress(content), name.removesuffix(".gz")
    if name.endswith(".folder.json"):
        return [unpacked(content)]
    kind = next((kind for ending, kind in _TWO_ENDINGS.items() if name.endswith(ending)), name.rpartition(".")[2])
    if kind not in (*MESHES, "usd", *_TWO_ENDINGS.values()):
        raise ValueError(f"{file}: the name tells no kind; see {__name__}")
    refused = True if ".refused." in name else False if ".accepted." in name else None
    if kind == "studio":
        return [attack_case(content, refused=refused)]
    read = foreign_cases_of_file if kind in FOREIGN_ENDINGS.values() else case_of_file
    return read(kind, content, name=name.partition(".")[0], refused=refused)


def regression_files() -> list[Path]:
    """All of them; those of the studio only where its extra is installed."""
    files = [path for path in REGRESSIONS.iterdir() if path.is_file() and path.suffix != ".md"]
    return sorted(path for path in files if find_spec("viser") is not None or not path.name.endswith(".studio.json"))
