"""What results leave in a folder: `metrics.json`, `NAME.obj`, `picture.png` and `frames.usdc`, for one piece or several."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import warp as wp

from warpflat._version import __version__
from warpflat.strain import worn_strain

if TYPE_CHECKING:
    from warpflat.export import PicturePiece
    from warpflat.flattening import Flattening

__all__ = ["metrics_of", "picture_piece", "write_results"]


def metrics_of(results: Sequence[Flattening], more: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """All of `metrics.json` for pieces of different names, and what more there is to say of them together."""
    device = results[0].network.device
    return {
        "schema": 1,
        "warpflat": __version__,
        "warp": wp.config.version,
        "device": platform.machine() + " cpu" if device.is_cpu else str(device.name),
        "pieces": {result.surface.name: result.measures for result in results},
        **(more or {}),
    }


def write_results(
    results: Sequence[Flattening],
    folder: str | Path,
    *,
    picture: bool = True,
    frames: bool = True,
    more: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write the files of all pieces, together or not at all, and return their names.

    Args:
        results: the pieces, of different names.
        folder: made if need be.
        picture: whether to draw one.
        frames: whether to write a USD file with the development and the pattern.
        more: entries of `metrics.json` besides the pieces.

    Raises:
        InputError: the folder cannot be written, or a piece was read from a file that would be replaced.
    """
    from warpflat.export import output_folder, write_picture
    from warpflat.leftovers import require_own_metrics, write_metrics

    others = [*(["frames.usdc"] if frames else []), *(["picture.png"] if picture else []), "metrics.json"]
    sources = [source for result in results for source in result.surface.sources]
    with output_folder(folder, others, sources=sources) as to:
        require_own_metrics(to)
        files = [result.write_obj(to) for result in results]
        if frames:
            _write_frames(to / "frames.usdc", results)
        if picture:
            write_picture(to / "picture.png", [result.picture_piece() for result in results])
        write_metrics(to, metrics_of(results, more))
    return [*files, *others]


def picture_piece(result: Flattening) -> PicturePiece:
    """The piece's row in a picture; what was cut is shown as a crack, and named on the surface."""
    from warpflat.export import PicturePiece

    own, cut = result.surface.lines, result.network.surface.lines
    grain = result.datum_name
    datum = {} if grain in own else {grain: result.datum}
    cut_through = {int(v) for applied in result.cuts for path in applied.paths for v in path}
    in_space: dict[str, Any] = {name: line for name, line in own.items() if not cut_through.issuperset(line.tolist())}
    in_space |= {f"{applied.name} (cut)": list(applied.paths) for applied in result.cuts}
    in_plane: dict[str, Any] = {
        name: line for name, line in cut.items() if not result.cuts or not _runs_along_cut(name, own)
    }
    if grain not in in_plane and not datum:
        # A cut has parted the datum: its parts are one line still.
        parts = [name for name in in_plane if name.startswith(f"{grain}.")]
        in_plane[grain] = [in_plane.pop(name) for name in parts] or result.datum
    return PicturePiece(
        name=result.surface.name,
        surface=result.surface,
        faces=result.faces,
        positions=result.positions,
        face_energy_density=result.face_energy_density,
        lines={**in_plane, **datum},
        surface_lines={**in_space, **datum},
        datum=result.datum_name,
        grain_angle=result.grain_angle,
        captions=result.captions(),
    )


def _runs_along_cut(name: str, own: Mapping[str, Any]) -> bool:
    """Whether a line of the cut surface is one side of a crack: the outline shows it already."""
    return name not in own and (".left" in name or ".right" in name)


def _write_frames(path: Path, results: Sequence[Flattening]) -> None:
    from warpflat.export import FrameWriter

    with FrameWriter(path) as writer:
        for result in results:
            name, surface = result.surface.name, result.surface
            writer.add_piece(name, surface)
            if not result.cuts:
                first = worn_strain(result.network, result.development.positions).energy_density
                writer.write(name, positions=result.development.positions, face_energy_density=first)
            writer.write(
                name,
                positions=result.positions,
                face_energy_density=result.face_energy_density,
                faces=result.faces,
                lines=result.network.surface.lines,
                cuts={cut.name: [side for s in cut.seams for side in (s.left, s.right)] for cut in result.cuts},
            )
