"""A scene is run in several fabrics, and the patterns are compared: in a table, a picture and a true-size drawing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from warpflat.app.review.figures import aligned
from warpflat.app.scene.comparison import Comparison, outline
from warpflat.app.scene.drape import drape_scene
from warpflat.app.scene.form_shaping import require_open_darts, settle_shape, with_open_darts
from warpflat.app.scene.load import Scene, scene_fabric
from warpflat.app.scene.plan import plan_scene
from warpflat.core import InputError, laid_upon
from warpflat.flat import Progress, advise, judge
from warpflat.garment import Garment
from warpflat.pattern import STRAINS

__all__ = ["compare_fabrics", "compared_files", "comparison_table", "save_comparison"]


def compare_fabrics(
    scene: Scene,
    fabrics: Sequence[str],
    *,
    on_progress: Callable[[str, Progress], bool | None] | None = None,
    device: str | None = None,
    drape: bool = False,
) -> Comparison:
    """Run a scene in each of several fabrics, with the same cuts, seams and constraints.

    Args:
        scene: a surface with its cuts, all of which are made, or a garment on a mannequin; its own fabric does not count.
        fabrics: two names or more, of the library or the scene's fabric files; others are compared with the first.
        on_progress: called with the fabric and its `Progress` after every step.
        device: Warp device, before the scene's own.
        drape: sew each of them and put it on its body, by the settings of the scene's `[drape]` table if it has one.

    Raises:
        InputError: fewer than two fabrics, one given twice or unknown, or the scene is wrong.
    """
    if len(fabrics) < 2:
        raise InputError(
            f"{len(fabrics)} fabric given to compare; name two or more, such as --fabric denim --fabric jersey"
        )
    # In the scene's own fabric, so that all patterns have the same darts.
    scene, notes = settle_shape(scene, device=device)
    called, known = dict[str, str](), dict[str, str]()
    for name in fabrics:
        fabric = scene_fabric(_in_fabric(scene, name))
        if fabric.name in known:
            raise InputError(f"fabric {name!r} is given twice ({known[fabric.name]}); compare different ones")
        known.update(dict.fromkeys((fabric.name, *fabric.aliases), fabric.name))
        called[fabric.name] = name

    def in_each(one: Scene) -> dict[str, Garment]:
        plan, made = plan_scene(one, device=device), dict[str, Garment]()
        for fabric, name in called.items():

            def report(_: str, progress: Progress, fabric: str = fabric) -> bool | None:
                return None if on_progress is None else on_progress(fabric, progress)

            made[fabric] = plan.in_cloth(_in_fabric(one, name)).flatten(callback=report)
        require_open_darts(one, made.values())
        return made

    scene, garments, closed = with_open_darts(scene, in_each)
    results = {name: {part: advise(flat) for part, flat in garment.parts.items()} for name, garment in garments.items()}
    first = next(iter(results.values()))
    layouts = {
        name: {piece: laid_upon(first[piece].positions, result.positions) for piece, result in pieces.items()}
        for name, pieces in results.items()
    }
    sewing = {name: garment.sewing_metrics() for name, garment in garments.items()}
    drapes = {
        name: drape_scene(_in_fabric(scene, called[name]), garments[name], device=device) for name in garments if drape
    }
    return Comparison(
        name=scene.name,
        results=results,
        layouts=layouts,
        sewing=sewing,
        drapes=drapes,
        notes=(*notes, *closed),
    )


def _in_fabric(scene: Scene, name: str) -> Scene:
    return replace(scene, settings=scene.settings.model_copy(update={"fabric": name}))


def compared_files(*, drape: bool) -> list[str]:
    """Return the names of the files of a comparison."""
    return ["compare.json", "compare.png", "compare.svg", *(["compare-drape.png"] if drape else [])]


def save_comparison(comparison: Comparison, folder: str | Path) -> tuple[list[str], tuple[str, ...]]:
    """Write `compare.json`, `compare.png` and `compare.svg` (outlines in true size), all of them or none.

    Returns:
        The names of the files, and what became of those of an earlier comparison, one sentence each.

    Raises:
        InputError: the folder cannot be written, or a surface was read from a file there that would be replaced.
    """
    from warpflat.app.scene.compare_picture import overlay_style, write_overlay_picture
    from warpflat.garment import write_compared_drapes
    from warpflat.pattern import optional_file, output_folder, remove_stale, write_overlay_svg

    sources = [
        file for pieces in comparison.results.values() for piece in pieces.values() for file in piece.surface.sources
    ]
    files = ["compare.svg"]
    with output_folder(folder, compared_files(drape=bool(comparison.drapes)), sources=sources, guard=True) as to:
        outlines = {
            piece: {
                fabric: outline(results[piece], comparison.layouts[fabric][piece])
                for fabric, results in comparison.results.items()
            }
            for piece in comparison.pieces
        }
        styles = {fabric: overlay_style(number) for number, fabric in enumerate(comparison.fabrics)}
        write_overlay_svg(to / "compare.svg", outlines, styles)
        with optional_file(to / "compare.png", files) as path:
            write_overlay_picture(path, comparison)
        if comparison.drapes:
            with optional_file(to / "compare-drape.png", files) as path:
                write_compared_drapes(path, comparison.drapes)
        _, notes = remove_stale(to, comparison.as_dict(), name="compare", files=files, report="compare.json")
    return [file for file in compared_files(drape=True) if file in ("compare.json", *files)], notes


def comparison_table(comparison: Comparison) -> str:
    """Return area, border lengths, energies, strains and distances as text: a block per piece, a column per fabric."""
    blocks = []
    for piece in comparison.pieces:
        distances = list(comparison.distances(piece).values())
        measures = [comparison.results[fabric][piece].measures for fabric in comparison.fabrics]
        borders = [comparison.borders(fabric, piece) for fabric in comparison.fabrics]
        rows = [
            ("area [cm2]", [f"{1e4 * m['area_m2']:.1f}" for m in measures]),
            *((f"{name} [mm]", [f"{1e3 * lengths[name]:.1f}" for lengths in borders]) for name in borders[0]),
            ("strain energy [mJ]", [f"{1e3 * m['strain_energy_j']:.4g}" for m in measures]),
            ("model energy [mJ]", [f"{1e3 * m['model_energy_j']:.4g}" for m in measures]),
            ("length error [%]", [f"{100 * m['length_error']:.2f}" for m in measures]),
            *_strain_rows([m["wear"] for m in measures], "min", "max"),
            ("beyond limit [%]", [f"{100 * m['wear']['outside']:.1f}" for m in measures]),
            ("held beyond it [%]", [f"{100 * m['wear']['held']:.1f}" for m in measures]),
            ("converged", ["yes" if m["converged"] else "NO" for m in measures]),
            *[(f"{point} [mm]", ["-", *(f"{1e3 * d[point]:.1f}" for d in distances)]) for point in distances[0]],
        ]
        blocks.append(aligned((piece, *comparison.fabrics), [(name, *cells) for name, cells in rows]))
    if comparison.drapes:
        # Gap, strain and pressure of each drape.
        found = [comparison.drapes[fabric].measures() for fabric in comparison.fabrics]
        verdicts = [verdict for m in found if (verdict := judge({"pieces": {}, "drape": m}))]

        def millimetres(key: str, part: str) -> list[str]:
            return [f"{1e3 * m[key][part]:.1f}" for m in found]

        rows = [
            ("largest gap [mm]", [f"{1e3 * max(m['gap_m'].values(), default=0.0):.1f}" for m in found]),
            ("gap at", [max(m["gap_m"], key=m["gap_m"].__getitem__, default="-") for m in found]),
            ("distance, mean [mm]", millimetres("distance_m", "mean")),
            ("misfit, mean [mm]", millimetres("misfit_m", "mean")),
            ("misfit, most [mm]", millimetres("misfit_m", "max")),
            *_strain_rows(found, "p5", "p95"),
            ("beyond limit [%]", [f"{100 * m['outside']:.1f}" for m in found]),
            ("pressure, mean [Pa]", [f"{m['pressure_pa']['mean']:.0f}" for m in found]),
            ("pressure, 95 % [Pa]", [f"{m['pressure_pa']['p95']:.0f}" for m in found]),
            ("touching [%]", [f"{100 * m['pressure_pa']['touching']:.0f}" for m in found]),
            ("fits", ["yes" if verdict.fits else "no" for verdict in verdicts]),
            ("at rest", ["yes" if m["converged"] else "NO" for m in found]),
        ]
        blocks.append(aligned(("worn", *comparison.fabrics), [(name, *cells) for name, cells in rows]))
    note = f"distances: from the pattern in {comparison.fabrics[0]}, the others laid upon it by turning and shifting"
    return "\n\n".join(blocks) + f"\n\n{note}"


def _strain_rows(measures: Sequence[Mapping[str, Any]], low: str, high: str) -> list[tuple[str, list[str]]]:
    """Return a row each for warp, weft and shear, from one key of an entry to another."""
    return [
        (
            f"{word if unit == 'degrees' else f'strain {word}'} [{unit}]",
            [f"{factor * each[key][low]:+.1f} to {factor * each[key][high]:+.1f}" for each in measures],
        )
        for key, word, factor, unit in STRAINS
    ]
