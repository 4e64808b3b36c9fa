"""The kinds of input: how often each is drawn, how it is damaged, by which ending a file of it is known, and which commands read it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from random import Random

from . import composed_files, damage, folders, foreign_files, geometry, seeds, studio_messages
from .promise import CLOTH, Case, words

__all__ = ["FILE_KINDS", "KINDS", "case_of_arguments", "cases_of_file", "random_case"]

BARE = seeds.BARE
CLOTH_AND_FABRIC = {"cloth.obj": CLOTH, "own.toml": seeds.FABRIC.encode()}
FLATTEN_CLOTH = f"flatten cloth.obj --units m --out out {BARE}"


@dataclass(frozen=True)
class Read:
    """A command that reads a file."""

    command: str
    """Its words; FILE stands for the file."""
    file: str = "NAME"
    """Where the file lies; NAME stands for its name with the ending of its kind, STEM for that without it."""
    beside: Callable[[bytes], Mapping[str, bytes]] = lambda content: {}
    """The files that the command needs besides."""
    leaves: str | None = None
    replaces: str = ""
    is_named: bool = True
    """Whether a refusal must name a file."""
    seconds: float = 20.0


@dataclass(frozen=True)
class Kind:
    """A kind of input."""

    share: int
    """How many of a hundred cases, or so, are of it: few where one takes seconds."""
    draw: Callable[[Random], bytes | Case]
    """Makes a damaged file, or a case where there is more to it than one file."""
    ending: str = ""
    """Of its files, in tests/regressions, too; "" where there is more to it."""
    reads: Sequence[Read] = ()


def _damaged_mesh(kind: str, random: Random) -> bytes:
    if kind == "gltf" and random.randrange(2):
        return damage.damaged_json(random, json.loads(seeds.meshes("gltf")[0]))
    return damage.damaged_bytes(random, random.choice(seeds.meshes(kind)))


def _damaged_scene(random: Random) -> bytes:
    slow = random.randrange(20) == 19
    return damage.little_work(
        damage.damaged_toml(random, seeds.FORM_SCENE if slow else random.choice(list(seeds.SCENES.values())))
    )


def _mesh(kind: str, share: int) -> Kind:
    """Of USD and glTF the file says in which unit it is."""
    units = "" if kind.startswith(("usd", "gl")) else "--units m "
    read = Read(f"flatten FILE {units}--out out {BARE}", leaves="out/metrics.json")
    return Kind(share, partial(_damaged_mesh, kind), f".{kind}", [read])


def _foreign(kind: str, share: int, ending: str, *commands: str, **more: object) -> Kind:
    reads = [Read(command, **{"seconds": 60.0, **more}) for command in commands]  # type: ignore[arg-type]
    return Kind(share, partial(foreign_files.damaged_foreign, kind), ending, reads)


def _member(kind: str, share: int, ending: str, *commands: str) -> Kind:
    """A file in the folder of a run."""
    member, files = f"out/{foreign_files.MEMBERS[kind]}", lambda _: foreign_files.in_out()
    reads = [Read(each, member, files, replaces="" if "drape" in each else "*", seconds=60.0) for each in commands]
    return Kind(share, partial(foreign_files.damaged_foreign, kind), ending, reads)


_REVIEW, _EXPORT, _EDGES = "review out --quiet", "export out --format svg --format dxf --quiet", "drape out --edges"
_FIT = f"--units m --to 'EU 38' --out out {BARE}"
# Of a drawing, edges are listed in half of the cases.
_DRAWING = (
    "drape FILE --edges",
    "drape FILE --edges",
    "export FILE --format svg --format dxf --format json --quiet",
    "marker FILE --seconds 1 --quiet",
)
_FORMATS = "".join(f"--format {name} " for name in ("dxf", "svg", "pdf", "json", "garmentcode", "plt"))
KINDS = {
    **{
        kind: _mesh(kind, share)
        for kind, share in zip(seeds.MESHES, (9, 10, 6, 7, 6, 6, 6, 7, 3), strict=True)
    },
    "scene": Kind(12, _damaged_scene, ".scene.toml", [
        Read("run FILE --out out --quiet", beside=lambda _: CLOTH_AND_FABRIC, leaves="out/metrics.json"),
    ]),
    "fabric": Kind(9, lambda random: damage.damaged_toml(random, seeds.FABRIC), ".fabric.toml", [
        Read("fabrics --file FILE"),
        Read(f"{FLATTEN_CLOTH} --fabric-file FILE --fabric own", beside=lambda _: CLOTH_AND_FABRIC, leaves="out/metrics.json",
             is_named=False),
    ]),
    "pattern": Kind(11, lambda random: damage.damaged_json(random, seeds.pattern()), ".pattern.json", [
        Read(f"export out {_FORMATS}--quiet", "out/pattern.json", replaces="*",
             beside=lambda content: {"out/metrics.json": seeds.record({"pattern.json": content})}),
    ]),
    "metrics": Kind(4, lambda random: damage.damaged_json(random, seeds.METRICS), ".metrics.json", [
        Read(FLATTEN_CLOTH, "out/metrics.json", lambda _: {**CLOTH_AND_FABRIC, "out/old.svg": b"<svg/>"},
             leaves="out/metrics.json", replaces="out/metrics.json", is_named=False),
    ]),
    # A standing body is searched for limbs: it takes long.
    "scan": Kind(1, lambda random: damage.damaged_bytes(random, random.choice(seeds.bodies())), ".scan.obj", [
        Read("mannequin --scan FILE --units m --resolution 40 --out out --quiet", "STEM.obj", leaves="out/metrics.json", seconds=90.0),
    ]),
    # A garment, and the body on which it lies: a body is fitted, which takes seconds.
    "fit": Kind(4, lambda random: damage.damaged_bytes(random, seeds.SKIRT), ".fit.obj", [
        Read(f"fit FILE {_FIT}", "STEM.obj", leaves="out/fit.json", seconds=90.0, is_named=False),
        Read(f"fit skirt.obj {_FIT} --from FILE", "STEM.obj", lambda _: {"skirt.obj": seeds.SKIRT}, leaves="out/fit.json",
             seconds=90.0, is_named=False),
    ]),
    # A worn garment whose texture is its sewn pattern: taken as it is, and its edges listed.
    "sewn": Kind(4, lambda random: damage.damaged_bytes(random, seeds.SEWN), ".sewn.obj", [
        Read(f"flatten FILE --units m --pattern uv --out out {BARE}", "STEM.obj", leaves="out/metrics.json"),
        Read("drape FILE --units m --edges", "STEM.obj"),
    ]),
    "arguments": Kind(12, lambda random: case_of_arguments(damage.odd_arguments(random))),
    **{
        kind: Kind(share, partial(folders.random_folder, kind))
        for kind, share in {"batch": 6, "result": 4, "folder": 6}.items()
    },
    # A form takes seconds.
    **{
        kind: Kind(share, partial(geometry.geometry_case, kind))
        for kind, share in {
            "form": 3, "finishing": 2, "tables": 6, "pieces": 6, "open": 4, "garment": 4, "islands": 5, "body": 2, "worn body": 2,
        }.items()
    },
    "dxf": _foreign("dxf", 10, ".dxf", *_DRAWING),
    "svg": _foreign("svg", 10, ".svg", *_DRAWING),
    "sewing": _foreign("sewing", 3, ".sewing.toml", "drape p.dxf --seams FILE --edges",
                       beside=lambda _: {"p.dxf": foreign_files.drawing()}),
    "garmentcode": _foreign("garmentcode", 3, ".garmentcode.json", *_DRAWING),
    "rul": _foreign("rul", 1, ".rul", "drape FILE"),
    "frames": _member("frames", 3, ".frames.usdc", _REVIEW),
    "lift": _member("lift", 4, ".lift.obj", _EDGES),
    "runmetrics": _member("runmetrics", 4, ".runmetrics.json", _REVIEW, _EXPORT),
    "runpattern": _member("runpattern", 3, ".runpattern.json", _EXPORT, _EDGES),
    "worn": _foreign("worn", 2, ".worn.json", "drape FILE --body 'EU 38' --out worn --quiet"),
    "drawn": Kind(8, composed_files.drawn),
    "stage": Kind(3, composed_files.stage),
    "gltf extension": Kind(4, composed_files.extension),
}  # fmt: skip
if find_spec("viser") is not None:  # the extra `studio`
    KINDS["studio"] = Kind(10, studio_messages.random_attack)
FILE_KINDS = {kind: each.ending for kind, each in KINDS.items() if each.ending}


def random_case(kind: str, random: Random) -> Case:
    """A damaged input of a kind, and a command that reads it."""
    drawn = KINDS[kind].draw(random)
    return drawn if isinstance(drawn, Case) else random.choice(cases_of_file(kind, drawn))


def cases_of_file(kind: str, content: bytes, *, name: str = "odd", refused: bool | None = None) -> list[Case]:
    """The cases that read a file of a kind, each with the files that it needs beside it.

    Args:
        kind: one of FILE_KINDS.
        content: of the file.
        name: of the file, without its ending.
        refused: whether it must be refused, or must not.
    """
    cases = []
    for read in KINDS[kind].reads:
        file = read.file.replace("NAME", name + KINDS[kind].ending).replace("STEM", name)
        command = tuple(word.replace("FILE", file) for word in words(read.command))
        # A body takes seconds.
        seconds = 90.0 if kind == "scene" and b"mannequin" in content else read.seconds
        case = Case(kind, {**read.beside(content), file: content}, command, file if read.is_named else "", read.leaves)
        cases.append(replace(case, replaces=read.replaces, refused=refused, seconds=seconds, name=name))
    return cases


def case_of_arguments(arguments: Sequence[str], **more: object) -> Case:
    """The case of a command line, with the files that seeds.COMMANDS need."""
    replaces = "done/pattern.json" if "export" in arguments else ""
    files = seeds.beside_commands()
    return Case("arguments", files, tuple(arguments), replaces=replaces, seconds=90.0, **more)  # type: ignore[arg-type]
