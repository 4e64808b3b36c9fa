"""Goldens: everything that a run gives, beside a record of what it gave before: energies, outlines, lengths, file lists.

    WARPFLAT_DATA=DIR python benchmarks/goldens.py [--only NAME ...] [--jobs 2]     compare with benchmarks/goldens.json.gz
    WARPFLAT_DATA=DIR python benchmarks/goldens.py --record FILE [--only NAME ...]  record; cases that FILE has besides stay
    WARPFLAT_DATA=DIR python benchmarks/goldens.py --rounding 1 2 3                 compare runs that round as other processors might

With `--rounding` each case runs once for each seed, under the noise of `tests/rounding.py`; its name is followed by the seed.

Cases: every scene and the batch, as commands; three drapes; the meshes of WARPFLAT_DATA, flattened in an isotropic and in a woven
cloth; eight of its garments and two of its plush toys with seams that are found; three garments fitted to another body; its bodies, as
mannequins; twelve scripts. Each is a process of its own on one thread. Columns: model energy before and after, its
largest ratio, the ratio of strain energies, the distance of the outlines, the largest change of a length, the distance of lines on
paper, files missing and new,
processor seconds before and after. The exit code is 1 where a word is in capitals, a fault:

| word | meaning |
|---|---|
| HIGHER | a model energy is more than 1e-3 above the record |
| OUTLINE, LENGTH | an outline or a length differs by more than 0.2 mm, and no model energy is lower by more than 1e-3 |
| FILES, PIECES, CODE | other files, pieces or lengths, another exit code |
| COUNTS, REST | other vertices or faces, more flipped faces; no longer at rest |
| NUMBER | a derivative differs by more than 1e-3 |
| DRAWN, WORDS | a cutting line or a seam on paper is more than 0.2 mm elsewhere, while the layout is not; other labels or sewing steps |
| lower, moved | a model energy is more than 1e-3 below the record; and an outline or a length differs by more than 0.2 mm |
| message | the program refuses in other words |

An outline is all borders of a flat piece, those of its cuts among them; or the cutting line and the seams of a drawn one. The distance
is the largest from a corner of either outline to the other one, after the rigid motion that fits best. Pieces that are sewn to each
other are minimised together, and their energies count as a sum. The strain energy is not minimised: layouts that are equal within the
solver's tolerance differ more in it.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.optimize import least_squares

import warpflat
from warpflat.pattern.drafting.sewing_order import sewing_steps
from warpflat.pattern.export.pattern_json import read_pattern_json

ROUNDING = Path(__file__).parents[1] / "tests" / "rounding.py"
sys.path.insert(0, str(ROUNDING.parent))
from rounding import disturb  # noqa: E402

RECORD = Path(__file__).with_suffix(".json.gz")
SCENES = Path(__file__).parents[1] / "scenes"
DATA = os.environ.get("WARPFLAT_DATA")
SLOW = ("Female_T_Shirt",)  # takes minutes as one piece
DRAPED = ("basic_block", "tshirt", "trousers")
FOUND = {
    "garments/dress.obj": "woven", "garments/long_sleeve_shirt.obj": "woven", "garments/cardigan_scan.obj": "woven",
    "garments/Women_Skirt.usd": "woven", "garments/leggings.ply": "interlock", "garments/female_casualsuit01.obj": "interlock",
    "garments/female_sportsuit01.obj": "interlock", "garments/male_casualsuit04.obj": "woven",
    "things/koala.obj": "woven", "things/penguin.obj": "woven",
}  # fmt: skip
FITTED = {"long_sleeve_shirt.obj": "EU 44", "leggings.ply": "EU 42", "dress.obj": "EU 36"}

LARGEST_RISE = 1e-3  # of an energy or a derivative, over the record's
FARTHEST = 0.2  # of outlines and lengths [mm]
NO_ENERGY = 1e-9  # added to both energies, for surfaces that are developable [J]
GRID = 0.01  # on which outlines are recorded, and how far a corner that is left out may be from the outline [mm]

Record = dict[str, Any]


def line_record(line: shapely.LineString) -> list[int]:
    """Return the corners of a line [mm] that it needs, x, y, x, y ... in hundredths of a millimetre."""
    simple = shapely.simplify(line, GRID, preserve_topology=False)
    return np.rint(shapely.get_coordinates(simple) / GRID).astype(int).ravel().tolist()


def piece_record(measures: Mapping[str, Any], points: np.ndarray, faces: Iterable[Iterable[int]]) -> Record:
    """Return what is kept of a flat piece: energies [J], counts, and its borders as x, y, x, y ... in hundredths of a millimetre.

    Args:
        measures: its entry in `metrics.json`.
        points: #P by 2 [m].
        faces: vertices of each face, counted from 0; negative ones are none.
    """
    corners = [[corner for corner in face if corner >= 0] for face in faces]
    sides = {side for face in corners for side in zip(face, [*face[1:], face[0]], strict=True)}
    border = np.array(sorted((a, b) for a, b in sides if (b, a) not in sides))
    merged = shapely.line_merge(shapely.multilinestrings(shapely.linestrings(1e3 * points[border])))
    kept = ("model_energy_j", "strain_energy_j", "vertices", "faces", "flipped_faces", "converged")
    return {key: measures[key] for key in kept} | {"outline": [line_record(line) for line in shapely.get_parts(merged)]}


def pattern_record(
    pieces: Mapping[str, warpflat.Flattening],
    *,
    together: bool = False,
    lengths: Mapping[str, float] | None = None,
    numbers: Mapping[str, float] | None = None,
) -> Record:
    """Return the record of pieces in memory: lengths in millimetres, numbers of any unit."""
    made = {
        name: piece_record(each.layout_measures, each.positions, each.faces.tolist()) for name, each in pieces.items()
    }
    return {
        "pieces": made, "together": together, "lengths": dict(lengths or {}), "numbers": dict(numbers or {}), "drawn": {}, "words": [],
    }  # fmt: skip


def folder_record(folder: Path) -> Record:
    """Return the record of the run in a folder: its pieces, its seams, the levels of its mannequin, its drawing."""
    metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    pieces, lengths = {}, {}
    for name, measures in metrics.get("pieces", {}).items():
        rows = [line.split() for line in (folder / f"{name}.obj").read_text(encoding="utf-8").splitlines()]
        points = np.array([row[1:3] for row in rows if row[0] == "vt"], dtype=float)
        faces = [[int(corner.split("/")[1]) - 1 for corner in row[1:]] for row in rows if row[0] == "f"]
        pieces[name] = piece_record(measures, points, faces)
    for seam in metrics.get("seams", []):
        lengths |= {f"{seam['name']}: {n}, {side}": seam["length_mm"][n] for n, side in enumerate(seam["sides"])}
    for level, values in metrics.get("mannequin", {}).get("levels", {}).items():
        lengths |= {f"{level} {key}": 1e3 * values[key] for key in ("height_m", "girth_m") if key in values}
    drawn, words = {}, list[str]()
    if (folder / "pattern.json").exists():
        pattern = read_pattern_json(folder / "pattern.json")
        for size, row in pattern.pieces.items():
            words += [f"{size}: {step.words}" for step in sewing_steps(pattern, size)]
            for piece in row:
                title = f"{size} {piece.name}"
                lines = [np.vstack([piece.cut_line, piece.cut_line[:1]]), *(edge.line for edge in piece.edges)]
                drawn[title] = [line_record(shapely.LineString(1e3 * line)) for line in lines]
                label = " ".join(text for text, _ in piece.label.lines)
                words.append(f"{title}: {' '.join(label.split())}")
                notches = {f"{title}: notch {n}, {notch.edge}": notch for n, notch in enumerate(piece.notches)}
                lengths |= {name: 1e3 * notch.length for name, notch in notches.items()}
    return {
        "pieces": pieces, "together": "sewing" in metrics, "lengths": lengths, "numbers": {}, "drawn": drawn, "words": words,
    }  # fmt: skip


def command(arguments: Sequence[str], folder: Path, *, seed: int | None) -> Record:
    """Run a command of the program into a new folder, and return the record of all that it leaves there.

    Args:
        arguments: of the command.
        folder: an empty one.
        seed: of rounding noise, if there is any.
    """
    out = folder / "out"
    program = ["-m", "warpflat"] if seed is None else [str(ROUNDING), str(seed)]
    run = subprocess.run(
        [sys.executable, *program, *arguments, "--out", str(out), "-q"], capture_output=True, text=True
    )
    record: Record = {"code": run.returncode, "runs": {}, "files": []}
    if run.returncode not in (0, 1):
        words = run.stderr.strip().rpartition("\n")[2].split(" ")
        record["message"] = " ".join(Path(word).name if word.startswith("/") else word for word in words)
    titles = {".": "."}  # of the folders of a batch, whose own names change with the version
    for task in out.glob("*/task.json"):
        told = json.loads(task.read_text(encoding="utf-8"))
        titles[task.parent.name] = " ".join(str(told[key]) for key in ("body", "fabric"))
    for file in sorted(path.relative_to(out) for path in out.rglob("*") if path.is_file()):
        title = titles.get(str(file.parent), str(file.parent))
        record["files"].append(file.name if title == "." else f"{title}/{file.name}")
        if file.name == "metrics.json":
            record["runs"][title] = folder_record(out / file.parent)
    return record


def flatten_mesh(
    mesh: Path, fabric: str, folder: Path, *, which: Sequence[str] = ("--component", "all"), seed: int | None
) -> Record:
    """Flatten all pieces of a mesh, or its largest one with the seams that are found.

    The suits are in decimetres, which is no unit of the program.
    """
    if "suit" in mesh.name:
        rows = [line.split() for line in mesh.read_text(encoding="utf-8").splitlines()]
        rows = [["v", *(f"{float(x) / 10.0}" for x in row[1:4])] if row[:1] == ["v"] else row for row in rows]
        mesh = folder / mesh.name
        mesh.write_text("".join(f"{' '.join(row)}\n" for row in rows), encoding="utf-8")
    units = [] if mesh.suffix == ".usd" else ["--units", "m"]
    how = [*which, "--fabric", fabric, "--frames", "0", "--no-picture"]
    return command(["flatten", str(mesh), *units, *how], folder, seed=seed)


def flat_bodice(resolution: int = 33) -> warpflat.Flattening:
    """Return the bodice of a formula, flattened."""
    return warpflat.flatten(warpflat.make_shape("bodice", resolution=resolution), fabric="woven", datum="centre")


def four_cloths(_: Path) -> Record:
    """A dome in four fabrics."""
    dome = warpflat.make_shape("dome", resolution=33)
    fabrics = ("woven", "denim", "interlock", "wool-suiting")
    return pattern_record({fabric: warpflat.flatten(dome, fabric=fabric, datum="centre") for fabric in fabrics})


def both_models(_: Path) -> Record:
    """A bodice as springs and as a membrane, on the bias, by plain steps, and a saddle that is worn stretched."""
    bodice, saddle = (warpflat.make_shape(shape, resolution=33) for shape in ("bodice", "saddle"))
    wear, plain = warpflat.Wear(stretch_warp=0.05, stretch_weft=0.1), warpflat.RelaxOptions(solver="paper")
    return pattern_record(
        {
            "springs": warpflat.flatten(bodice, fabric="woven"),
            "membrane": warpflat.flatten(bodice, fabric="woven", model="membrane"),
            "isotropic membrane": warpflat.flatten(bodice, model="membrane"),
            "bias": warpflat.flatten(bodice, fabric="woven", grain_angle=45.0),
            "plain steps": warpflat.flatten(bodice, fabric="woven", relax=plain),
            "worn": warpflat.flatten(saddle, fabric="interlock", model="membrane", wear=wear),
        }
    )


def several_at_once(_: Path) -> Record:
    """The pieces of a form, not sewn."""
    pieces = warpflat.Mannequin.from_size("EU 40").form("basic_block").pieces
    flat = warpflat.flatten_all([piece.surface for piece in pieces.values()], fabric="denim")
    return pattern_record(dict(zip(pieces, flat, strict=True)))


def edits(_: Path) -> Record:
    """Another fabric, and a surface whose middle has moved."""
    pattern = flat_bodice()
    outwards = 0.005 * np.sin(np.pi * np.linspace(0.0, 1.0, 33)).repeat(33)
    moved = pattern.surface.vertices + outwards[:, None] * [0.0, 0.0, 1.0]
    changed = {"fabric": warpflat.change_fabric(pattern, "denim"), "surface": warpflat.change_surface(pattern, moved)}
    return pattern_record(changed)


def cut_twice(_: Path) -> Record:
    """Darts along the bust line, then one from the hem."""
    pattern = flat_bodice()
    sides = tuple(warpflat.line_part(pattern.surface, "bust", part) for part in ((0.0, 0.27), (1.0, 0.73)))
    hem = warpflat.CutPlan(name="hem", paths=(warpflat.line_part(pattern.surface, "centre", (0.0, 0.4)),))
    bust = warpflat.cut(pattern, warpflat.CutPlan(name="bust", paths=sides, tip_back=0.02))
    return pattern_record({"bust": bust, "bust and hem": warpflat.cut(bust, hem)})


def best_of_ledger(_: Path) -> Record:
    """The cut that a ledger ranks first, made."""
    pattern = flat_bodice(25)
    best = warpflat.make_ledger(pattern).entries[0]
    plan = warpflat.CutPlan(name=best.candidate.name, paths=best.candidate.paths)
    return pattern_record({plan.name: warpflat.cut(pattern, plan)}, lengths={"cut": 1e3 * best.length})


def constraints(_: Path) -> Record:
    """A straight hem, and a top that keeps its length."""
    straight = warpflat.Straight(piece="bodice", line="bottom", along="weft")
    asked = (straight, warpflat.FixedLength(piece="bodice", line="top"))
    return pattern_record(warpflat.sew({"bodice": flat_bodice()}, constraints=asked).pieces, together=True)


def steps(_: Path) -> Record:
    """The paper's steps, taken one by one until they are at rest, and `flatten` from there."""
    dome = warpflat.make_shape("dome", resolution=17)
    *_, last = warpflat.relaxation(dome, fabric="woven", datum="centre", energy_every=5)
    pattern = warpflat.flatten(dome, fabric="woven", datum="centre", start=last.positions)
    energies = {"model_energy_j": last.model_energy_j, "converged": last.converged}
    stepped = piece_record({**pattern.layout_measures, **energies}, last.positions, pattern.faces.tolist())
    record = pattern_record({"from there": pattern})
    return record | {"pieces": {"steps": stepped, **record["pieces"]}}


def garment(_: Path) -> Record:
    """A dress on a dress form, in denim."""
    body = warpflat.Mannequin.from_size("EU 42")
    dress = warpflat.flatten_form(body, body.form("princess_dress"), fabric="denim")
    lengths = {f"{seam.name} {n}": 1e3 * length for seam in dress.seams for n, length in enumerate(seam.lengths)}
    return pattern_record(dress.pieces, together=True, lengths=lengths)


def pieces_of_a_file(folder: Path) -> Record:
    """Both halves of a bodice, read from one file and sewn where they meet."""
    bodice, lines, count = warpflat.make_shape("bodice", resolution=25), list[str](), 1
    is_left = bodice.vertices[bodice.faces, 0].mean(axis=1) < 0.0
    for name, half in (("left", bodice.faces[is_left]), ("right", bodice.faces[~is_left])):
        used, own = np.unique(half, return_inverse=True)
        lines += [f"o {name}", *(f"v {x} {y} {z}" for x, y, z in bodice.vertices[used].tolist())]
        lines += [f"f {' '.join(map(str, face))}" for face in (count + own.reshape(half.shape)).tolist()]
        count += len(used)
    (folder / "halves.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    pieces = warpflat.flatten_all(warpflat.read_pieces(folder / "halves.obj", units="m"), fabric="woven")
    sewn = warpflat.sew_pieces(pieces)
    assert sewn.sewn is not None, "both halves meet at the centre"
    lengths = {f"{seam.name} {n}": 1e3 * length for seam in sewn.seams for n, length in enumerate(seam.lengths)}
    return pattern_record(sewn.pieces, together=True, lengths=lengths)


def derivatives(_: Path) -> Record:
    """A length of a pattern at the exact minimum, and its derivatives by vertices, rest lengths and stiffnesses."""
    pattern = flat_bodice(13)
    found = warpflat.gradient(pattern, "bust")
    parts = {"vertices": found.vertices, "rest lengths": found.rest_lengths, "stiffness": found.stiffness}
    numbers = {f"by {name}": float(np.linalg.norm(part)) for name, part in parts.items()}
    exact = replace(pattern, positions=found.positions)
    return pattern_record({"exact": exact}, numbers=numbers, lengths={"bust": 1e3 * found.value})


def worn_bodice(_: Path) -> Record:
    """A bodice, sewn and worn: how far it is from the body and from the designed surface."""
    body = warpflat.Mannequin.from_size("EU 38", resolution_mm=14.0)
    bodice = warpflat.flatten_form(body, body.form("bodice"), fabric="woven")
    measures = warpflat.drape(bodice).measures()
    lengths = {f"gap {line}": 1e3 * gap for line, gap in measures["gap_m"].items()}
    for key in ("distance_m", "misfit_m"):
        lengths |= {f"{key[:-2]} {part}": 1e3 * value for part, value in measures[key].items()}
    return pattern_record(bodice.pieces, together=True, lengths=lengths)


SCRIPTS = (
    four_cloths, both_models, several_at_once, edits, cut_twice, best_of_ledger, constraints, steps, garment, pieces_of_a_file,
    derivatives, worn_bodice,
)  # fmt: skip


def all_cases(seed: int | None) -> dict[str, Callable[[Path], Record]]:
    """Return the cases by name, without those that need WARPFLAT_DATA where that is not set; commands have the noise of a seed."""
    cases: dict[str, Callable[[Path], Record]] = {}
    for scene in sorted(SCENES.glob("*.toml")):
        text = scene.read_text(encoding="utf-8")
        if DATA or "${WARPFLAT_DATA}" not in text:
            cases[f"scene {scene.stem}"] = partial(
                command, ["batch" if "\nscenes = [" in text else "run", str(scene)], seed=seed
            )
    for make in SCRIPTS:
        cases[f"script {make.__name__}"] = lambda folder, make=make: {
            "code": 0,
            "runs": {".": make(folder)},
            "files": [],
        }
    meshes = [*Path(DATA).glob("*.obj"), *(Path(DATA) / "garments").iterdir()] if DATA else []
    for mesh in sorted(path for path in meshes if path.stem not in SLOW):
        if mesh.stem.startswith("body_"):
            cases[f"scan {mesh.stem}"] = partial(command, ["mannequin", "--scan", str(mesh)], seed=seed)
        else:
            for fabric in ("isotropic", "woven"):
                cases[f"mesh {mesh.stem} {fabric}"] = partial(flatten_mesh, mesh, fabric, seed=seed)
    for name in DRAPED:
        cases[f"drape {name}"] = partial(command, ["drape", str(SCENES / f"{name}.toml")], seed=seed)
    if DATA:
        for name, fabric in FOUND.items():
            mesh = Path(DATA) / name
            cases[f"found {mesh.stem}"] = partial(flatten_mesh, mesh, fabric, which=("--seams", "auto"), seed=seed)
        for name, size in FITTED.items():
            mesh = Path(DATA) / "garments" / name
            cases[f"fit {mesh.stem}"] = partial(command, ["fit", str(mesh), "--units", "m", "--to", size], seed=seed)
    return cases


def run_case(name: str, seed: int | None) -> Record:
    """Run a case in a process of its own, under the noise of a seed if one is given."""
    setting = {**os.environ, "WARPFLAT_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    noise = [] if seed is None else ["--rounding", str(seed)]
    asked = [sys.executable, __file__, "--one", name, *noise]
    run = subprocess.run(asked, capture_output=True, text=True, env=setting)
    last = (run.stderr if run.returncode else run.stdout).strip().rpartition("\n")[2]
    failed = {"code": run.returncode, "runs": {}, "files": [], "seconds": 0.0, "message": last}
    return failed if run.returncode else json.loads(last)


def outline_distance(before: list[list[int]], after: list[list[int]]) -> float:
    """Return the largest distance of a corner of one outline from the other [mm], after the rigid motion that fits best."""
    ends = [[GRID * np.reshape(line, (-1, 2)) for line in lines] for lines in (before, after)]
    old_lines, new_lines = (shapely.multilinestrings([shapely.linestrings(line) for line in lines]) for lines in ends)
    old, new = (np.concatenate(lines) for lines in ends)
    shapely.prepare([old_lines, new_lines])
    middle, reach = new.mean(axis=0), np.ptp(new, axis=0).max()

    def apart(motion: np.ndarray) -> np.ndarray:
        """Return how far the new corners, turned about their middle and shifted, are from the old outline, and old ones from the new."""
        cos, sin = np.cos(motion[2] / reach), np.sin(motion[2] / reach)
        turn = np.array([[cos, sin], [-sin, cos]])
        there, back = (new - middle) @ turn + middle + motion[:2], (old - middle - motion[:2]) @ turn.T + middle
        ways = ((there, old_lines), (back, new_lines))
        return np.concatenate([shapely.distance(shapely.points(points), lines) for points, lines in ways])

    found = [apart(np.zeros(3)).max()]
    if found[0] > 2.0 * GRID:
        for shift in (np.zeros(2), old.mean(axis=0) - middle):
            fitted = least_squares(apart, [*shift, 0.0], diff_step=1e-4, x_scale=1.0, max_nfev=50)
            found.append(apart(fitted.x).max())
    return float(min(found))


def compare(before: Record, after: Record) -> Record:
    """Return the row of a case: energies, largest differences, files, and words on what differs, faults in capitals."""
    lost, new = ([file for file in a["files"] if file not in b["files"]] for a, b in ((before, after), (after, before)))
    differs = {
        "CODE": before["code"] != after["code"],
        "message": before.get("message") != after.get("message"),
        "FILES": bool(lost or new),
        "PIECES": before["runs"].keys() != after["runs"].keys(),
    }
    kinds = ("pieces", "lengths", "numbers", "drawn")
    ratios, outlines, lengths, on_paper, energies, strains = [1.0], [0.0], [0.0], [0.0], np.zeros(2), np.zeros(2)
    for run, then in before["runs"].items():
        now = after["runs"].get(run, {key: {} for key in kinds} | {"words": []})
        differs["PIECES"] |= any(then[key].keys() != now[key].keys() for key in kinds)
        pairs = [(piece, now["pieces"][name]) for name, piece in then["pieces"].items() if name in now["pieces"]]
        model = np.array([[piece["model_energy_j"] for piece in pair] for pair in pairs]).reshape(-1, 2)
        energies += model.sum(axis=0)
        strains += np.array([[piece["strain_energy_j"] for piece in pair] for pair in pairs]).reshape(-1, 2).sum(axis=0)
        minimised = model.sum(axis=0, keepdims=True) if then["together"] else model
        ratios += ((minimised[:, 1] + NO_ENERGY) / (minimised[:, 0] + NO_ENERGY)).tolist()
        drawn = [(lines, now["drawn"][name]) for name, lines in then["drawn"].items() if name in now["drawn"]]
        on_paper += [outline_distance(*pair) for pair in drawn]
        differs["WORDS"] = differs.get("WORDS", False) or then["words"] != now["words"]
        for old, piece in pairs:
            outlines.append(outline_distance(old["outline"], piece["outline"]))
            counts = any(old[key] != piece[key] for key in ("vertices", "faces"))
            differs["COUNTS"] = differs.get("COUNTS", False) or counts or piece["flipped_faces"] > old["flipped_faces"]
            differs["REST"] = differs.get("REST", False) or (old["converged"] and not piece["converged"])
        lengths += [abs(now["lengths"][key] - value) for key, value in then["lengths"].items() if key in now["lengths"]]
        numbers = [(value, now["numbers"].get(key, np.inf)) for key, value in then["numbers"].items()]
        differs["NUMBER"] = any(abs(b - a) > LARGEST_RISE * abs(a) for a, b in numbers) or differs.get("NUMBER", False)
    lower = min(ratios) < 1.0 - LARGEST_RISE
    far = {"OUTLINE": max(outlines) > FARTHEST, "LENGTH": max(lengths) > FARTHEST}
    differs |= {"HIGHER": max(ratios) > 1.0 + LARGEST_RISE, "lower": lower}
    differs |= {"moved": any(far.values())} if lower else far
    differs["DRAWN"] = max(on_paper) > FARTHEST and not any(far.values())
    return {
        "energies": energies, "ratio": max(ratios, key=lambda ratio: abs(ratio - 1.0)), "outline": max(outlines), "length": max(lengths),
        "strain": (strains[1] + NO_ENERGY) / (strains[0] + NO_ENERGY), "drawn": max(on_paper), "lost": lost, "new": new,
        "words": [word for word, is_so in differs.items() if is_so],
    }  # fmt: skip


def main() -> None:
    """Print the table, or write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--only", nargs="+", default=[""], metavar="NAME", help="cases whose names have one of these words"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--list", action="store_true", help="name the cases")
    parser.add_argument("--record", type=Path, metavar="FILE.json.gz", help="write a record instead")
    parser.add_argument(
        "--rounding", nargs="+", type=int, default=[None], metavar="SEED", help="seeds of rounding noise"
    )
    parser.add_argument("--one", metavar="CASE", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    cases = all_cases(chosen.rounding[0])
    if chosen.one:
        if chosen.rounding[0] is not None:
            disturb(chosen.rounding[0])
        with tempfile.TemporaryDirectory() as folder:
            record = cases[chosen.one](Path(folder))
        print(json.dumps({**record, "seconds": round(sum(os.times()[:4]), 1)}))
        return
    file: Path = chosen.record or RECORD
    golden: dict[str, Record] = json.loads(gzip.decompress(file.read_bytes())) if file.exists() else {}
    names = [name for name in cases if any(text in name for text in chosen.only)]
    if chosen.list:
        print("\n".join(names))
        return
    # The longest first, so that all processes end at about the same time.
    names.sort(key=lambda name: -golden[name]["seconds"] if name in golden else -np.inf)
    if not chosen.record:
        columns = f"{'before J':>10} {'after J':>10} {'ratio':>8} {'strain':>8} {'outline mm':>10} {'length mm':>9} {'drawn mm':>8} files"
        print(f"{'case':36} {columns} {'s':>11}", flush=True)
    faults = 0
    with ThreadPoolExecutor(chosen.jobs) as pool:
        running = {pool.submit(run_case, name, seed): (name, seed) for name in names for seed in chosen.rounding}
        for ended in as_completed(running):
            (name, seed), record = running[ended], ended.result()
            title = name if seed is None else f"{name}, {seed}"
            told = record.get("message", "")
            if chosen.record:
                golden[name] = record
                text = json.dumps(golden, separators=(",", ":"), sort_keys=True)
                file.write_bytes(gzip.compress(text.encode(), mtime=0))
                print(f"{name:36} exit code {record['code']}, {record['seconds']:5.1f} s  {told}", flush=True)
                continue
            if name not in golden:
                print(f"{name:36} is not in the record", flush=True)
                continue
            row = compare(golden[name], record)
            faults += any(word.isupper() for word in row["words"])
            told += "".join(f"; {word}: {', '.join(row[word][:5])}" for word in ("lost", "new") if row[word])
            print(
                f"{title:36} {row['energies'][0]:10.4g} {row['energies'][1]:10.4g} {row['ratio']:8.5f} {row['strain']:8.5f} "
                f"{row['outline']:10.3f} {row['length']:9.3f} {row['drawn']:8.3f} -{len(row['lost'])} +{len(row['new'])} "
                f"{golden[name]['seconds']:5.1f} {record['seconds']:5.1f}  {' '.join(row['words']) or 'equal'}  {told}",
                flush=True,
            )
    if not chosen.record:
        absent = [name for name in golden if name not in cases]
        print(
            f"{len(running)} cases, {faults} with faults"
            + (f"; cannot be run here: {', '.join(absent)}" if absent else "")
        )
        sys.exit(faults > 0)


if __name__ == "__main__":
    main()
