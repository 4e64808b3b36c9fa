"""The same garment in several fabrics: how far the patterns differ, in figures, a picture and a true-size drawing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from warpflat._version import __version__
from warpflat.arrays import FloatArray
from warpflat.errors import InputError
from warpflat.flattening import Flattening, Progress
from warpflat.scene import Scene, flatten_scene, scene_cuts, scene_fabric
from warpflat.scene_cuts import CutStory
from warpflat.surface.topology import border_loops

__all__ = [
    "COMPARED_FILES",
    "Comparison",
    "compare_fabrics",
    "comparison_table",
    "laid_upon",
    "outline",
    "save_comparison",
]

COMPARED_FILES = ("compare.json", "compare.png", "compare.svg")


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """One scene in several fabrics.

    Attributes:
        name: of the scene.
        results: by fabric, then by piece; the first fabric is what the others are compared with.
        layouts: by fabric, then by piece: #P by 2 [m], laid upon the first fabric's pattern as well as it goes, turned
            and shifted only.
        sewing: by fabric, how its seams and constraints came out, as in `metrics.json`; empty where nothing was sewn.
    """

    name: str
    results: Mapping[str, Mapping[str, Flattening]]
    layouts: Mapping[str, Mapping[str, FloatArray]]
    sewing: Mapping[str, Mapping[str, Any]]

    @property
    def fabrics(self) -> list[str]:
        """Names of the fabrics, in the order asked for."""
        return list(self.results)

    @property
    def pieces(self) -> list[str]:
        """Names of the pieces."""
        return list(self.results[self.fabrics[0]])

    def points(self, piece: str) -> dict[str, int]:
        """Named points of a piece, vertices of its pattern: where its lines end on the outline; joint ends are one."""
        surface = self.results[self.fabrics[0]][piece].network.surface
        border = set(np.concatenate(border_loops(surface.faces)).tolist())
        names: dict[int, list[str]] = {}
        for name, line in surface.lines.items():
            if len(line) < 2 or line[0] == line[-1]:
                continue
            for vertex, end in ((int(line[0]), "start"), (int(line[-1]), "end")):
                if vertex in border:
                    names.setdefault(vertex, []).append(f"{name} {end}")
        return {" / ".join(label): vertex for vertex, label in names.items()}

    def distances(self, piece: str) -> dict[str, dict[str, float]]:
        """By fabric, how far each named point lies from that of the first fabric, and the outline's most [m]."""
        first = self.layouts[self.fabrics[0]][piece]
        border = np.concatenate(border_loops(self.results[self.fabrics[0]][piece].faces))
        found = {}
        for fabric in self.fabrics[1:]:
            apart = np.linalg.norm(self.layouts[fabric][piece] - first, axis=1)
            found[fabric] = {name: float(apart[vertex]) for name, vertex in self.points(piece).items()}
            found[fabric]["outline, most"] = float(apart[border].max())
            found[fabric]["outline, mean"] = float(apart[border].mean())
        return found

    def borders(self, fabric: str, piece: str) -> dict[str, float]:
        """Lengths of the lines on the outline, and of the whole of it [m]."""
        result = self.results[fabric][piece]
        loops = border_loops(result.faces)
        edges = {
            frozenset(edge) for loop in loops for edge in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
        }
        lengths = {"outline": sum(_length(result.positions[np.append(loop, loop[0])]) for loop in loops)}
        for name, line in result.network.surface.lines.items():
            row = line.tolist()
            if len(row) > 1 and all(frozenset(edge) in edges for edge in pairwise(row)):
                lengths[name] = _length(result.positions[line])
        return lengths

    def as_dict(self) -> dict[str, Any]:
        """As in `compare.json`."""
        return {
            "schema": 1,
            "warpflat": __version__,
            "scene": self.name,
            "compared_with": self.fabrics[0],
            "fabrics": {
                fabric: {
                    piece: {**result.measures, "border_lengths_m": self.borders(fabric, piece)}
                    for piece, result in pieces.items()
                }
                for fabric, pieces in self.results.items()
            },
            "sewing": {fabric: dict(how) for fabric, how in self.sewing.items()},
            "distances_m": {piece: self.distances(piece) for piece in self.pieces},
        }


def _length(points: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def outline(result: Flattening, layout: FloatArray) -> list[FloatArray]:
    """The closed border curves of a piece in a layout, each #B by 2 [m]."""
    return [layout[np.append(loop, loop[0])] for loop in border_loops(result.faces)]


def compare_fabrics(
    scene: Scene,
    fabrics: Sequence[str],
    *,
    on_progress: Callable[[str, Progress], None] | None = None,
    device: str | None = None,
) -> Comparison:
    """Run a scene in each fabric, all else alike: its cuts, seams and constraints are kept in each of them.

    Args:
        scene: a surface with its cuts, all of which are made, or a garment on a mannequin; its own fabric does not count.
        fabrics: two names or more, of the library or the scene's fabric files; others are compared with the first.
        on_progress: called with the fabric and its `Progress` after every step.
        device: Warp device, before the scene's own.

    Raises:
        InputError: fewer than two fabrics, one given twice or unknown, or the scene is wrong.
    """
    if len(fabrics) < 2:
        raise InputError(
            f"{len(fabrics)} fabric given to compare; name two or more, such as --fabric denim --fabric jersey"
        )
    dressed = {}
    for name in fabrics:
        one = replace(scene, settings=scene.settings.model_copy(update={"fabric": name}))
        fabric = scene_fabric(one)
        if fabric.name in dressed:
            raise InputError(f"fabric {name!r} is given twice ({fabric.name}); compare different ones")
        dressed[fabric.name] = one
    # Cuts are the scene's, found once, and all of them made, so that all patterns have the same points.
    story = None
    if scene.settings.mannequin is None:
        story = replace(scene_cuts(scene, device=device), auto=None)
    results: dict[str, Mapping[str, Flattening]] = {}
    sewing: dict[str, Mapping[str, Any]] = {}
    for name, one in dressed.items():

        def told(progress: Progress, name: str = name) -> None:
            if on_progress is not None:
                on_progress(name, progress)

        results[name], sewing[name] = _run(one, story, told, device)
    first = next(iter(results.values()))
    layouts = {
        name: {piece: laid_upon(first[piece].positions, result.positions) for piece, result in pieces.items()}
        for name, pieces in results.items()
    }
    return Comparison(name=scene.name, results=results, layouts=layouts, sewing=sewing)


def _run(
    scene: Scene, story: CutStory | None, told: Callable[[Progress], None], device: str | None
) -> tuple[Mapping[str, Flattening], Mapping[str, Any]]:
    """The pieces as a run of the scene gives them, and how they were sewn."""
    from warpflat.cutting import separate
    from warpflat.scene_garment import plan_garment
    from warpflat.wear_report import advise

    if story is None:
        garment = plan_garment(scene, device=device).flatten(callback=lambda _, progress: told(progress))
        how = garment.summary()
        return {name: advise(piece) for name, piece in garment.pieces.items()}, {
            key: how[key] for key in how if key != "pieces"
        }
    result, sewn = flatten_scene(scene, story, callback=told, device=device)
    return {piece.surface.name: advise(piece) for piece in separate(result)}, {} if sewn is None else sewn.metrics()


def laid_upon(target: FloatArray, layout: FloatArray) -> FloatArray:
    """The layout turned and shifted to lie as near as it can to the target (Kabsch 1976)."""
    centre, aim = layout.mean(axis=0), target.mean(axis=0)
    u, _, v = np.linalg.svd((layout - centre).T @ (target - aim))
    turn = u @ np.diag([1.0, float(np.sign(np.linalg.det(u @ v)))]) @ v
    return np.asarray((layout - centre) @ turn + aim)


def save_comparison(comparison: Comparison, folder: str | Path) -> list[str]:
    """Write `compare.json`, `compare.png` and `compare.svg` (outlines in true size), all of them or none.

    Raises:
        InputError: the folder cannot be written, or a surface was read from a file there that would be replaced.
    """
    from warpflat.compare_sheet import write_overlay_picture, write_overlay_svg
    from warpflat.export import output_folder, write_json

    sources = [
        file for pieces in comparison.results.values() for piece in pieces.values() for file in piece.surface.sources
    ]
    with output_folder(folder, COMPARED_FILES, sources=sources) as to:
        write_overlay_svg(to / "compare.svg", comparison)
        write_overlay_picture(to / "compare.png", comparison)
        write_json(to / "compare.json", comparison.as_dict())
    return list(COMPARED_FILES)


def comparison_table(comparison: Comparison) -> str:
    """Area, border lengths, energies, worst strain and distances, a column per fabric, a block per piece."""
    blocks = []
    for piece in comparison.pieces:
        rows: list[tuple[str, list[str]]] = []
        measures = [comparison.results[fabric][piece].measures for fabric in comparison.fabrics]
        borders = [comparison.borders(fabric, piece) for fabric in comparison.fabrics]
        rows.append(("area [cm2]", [f"{1e4 * m['area_m2']:.1f}" for m in measures]))
        for name in borders[0]:
            rows.append((f"{name} [mm]", [f"{1e3 * lengths[name]:.1f}" for lengths in borders]))
        rows.append(("strain energy [mJ]", [f"{1e3 * m['strain_energy_j']:.4g}" for m in measures]))
        rows.append(
            ("minimised energy [mJ]", [f"{1e3 * (m['spring_energy_j'] + m['guard_energy_j']):.4g}" for m in measures])
        )
        rows.append(("length error [%]", [f"{100 * m['length_error']:.2f}" for m in measures]))
        for thread in ("warp", "weft"):
            worst = [m["wear"][f"strain_{thread}"] for m in measures]
            rows.append((f"strain {thread} [%]", [f"{100 * w['min']:+.1f} to {100 * w['max']:+.1f}" for w in worst]))
        rows.append(("beyond limit [%]", [f"{100 * m['wear']['outside']:.1f}" for m in measures]))
        rows.append(("fits", ["yes" if m["wear"]["fits"] else "no" for m in measures]))
        rows.append(("converged", ["yes" if m["converged"] else "NO" for m in measures]))
        apart = comparison.distances(piece)
        for point in next(iter(apart.values())):
            rows.append((f"{point} [mm]", ["-", *(f"{1e3 * d[point]:.1f}" for d in apart.values())]))
        blocks.append(_columns(piece, comparison.fabrics, rows))
    note = f"distances: from the pattern in {comparison.fabrics[0]}, the others laid upon it by turning and shifting"
    return "\n\n".join(blocks) + f"\n\n{note}"


def _columns(title: str, fabrics: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> str:
    left = max(len(title), *(len(name) for name, _ in rows))
    widths = [max(len(fabric), *(len(cells[k]) for _, cells in rows)) for k, fabric in enumerate(fabrics)]
    lines = ["  ".join([title.ljust(left), *(f.rjust(w) for f, w in zip(fabrics, widths, strict=True))])]
    lines += [
        "  ".join([name.ljust(left), *(cell.rjust(w) for cell, w in zip(cells, widths, strict=True))])
        for name, cells in rows
    ]
    return "\n".join(lines)
