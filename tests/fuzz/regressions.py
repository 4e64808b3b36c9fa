"""The regression files: each a past failure, in tests/regressions, run by its name.

NAME.obj, .ply, .stl, .off, .glb, .gltf, .usda, .usdc, .usdz   flattened
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
import json
from importlib.util import find_spec
from pathlib import Path

from .folders import unpacked
from .kinds import FILE_KINDS, case_of_arguments, cases_of_file
from .promise import Case
from .studio_messages import attack_case

__all__ = ["REGRESSIONS", "cases_of", "regression_files"]

REGRESSIONS = Path(__file__).resolve().parents[1] / "regressions"


def cases_of(file: Path) -> list[Case]:
    """The cases of a regression file, told by its name."""
    content, name = file.read_bytes(), file.name
    if name.endswith(".gz"):
        content, name = gzip.decompress(content), name.removesuffix(".gz")
    if name.endswith(".folder.json"):
        return [unpacked(content)]
    refused = True if ".refused." in name else False if ".accepted." in name else None
    if name.endswith(".arguments.json"):
        return [case_of_arguments(json.loads(content), name=name.partition(".")[0], refused=refused)]
    if name.endswith(".studio.json"):
        return [attack_case(content, refused=refused)]
    # ".scan.obj" before ".obj".
    kinds = [kind for kind, ending in FILE_KINDS.items() if name.endswith(ending)]
    if not kinds:
        raise ValueError(f"{file}: the name tells no kind; see {__name__}")
    kind = max(kinds, key=lambda kind: len(FILE_KINDS[kind]))
    return cases_of_file(kind, content, name=name.partition(".")[0], refused=refused)


def regression_files() -> list[Path]:
    """All of them; those of the studio only where its extra is installed."""
    files = [path for path in REGRESSIONS.iterdir() if path.is_file() and path.suffix != ".md"]
    return sorted(path for path in files if find_spec("viser") is not None or not path.name.endswith(".studio.json"))
