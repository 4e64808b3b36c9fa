"""The files of flat pieces without a pattern: an OBJ each, the picture, the film of development and pattern, and `metrics.json`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpflat.core import energy_words
from warpflat.flat import Flattening, worn_strain
from warpflat.pattern.export.obj import write_obj
from warpflat.pattern.files.output import file_in, optional_file, output_folder, write_report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from warpflat.pattern.export.dressed import Body
    from warpflat.pattern.export.picture import DraftedOutline, PicturePiece

__all__ = ["picture_piece", "plot", "save_piece", "write_pieces"]


def save_piece(pattern: Flattening, folder: str | Path, *, picture: bool = True, frames: bool = True) -> list[str]:
    """Write `metrics.json`, `NAME.obj`, `picture.png` and `frames.usdc` (development and pattern), all of them or none.

    Args:
        pattern: the piece.
        folder: made if need be.
        picture: whether to draw one.
        frames: whether to write a USD file.

    Returns:
        The names of the files.

    Raises:
        InputError: the folder cannot be written, or the surface was read from a file there that would be replaced.
    """
    others = [*(["frames.usdc"] if frames else []), *(["picture.png"] if picture else []), "metrics.json"]
    with output_folder(folder, others, sources=pattern.surface.sources, guard=True) as to:
        files = write_pieces([pattern], to, picture=picture, frames=frames)
        write_report(to / "metrics.json", pattern.metrics(), name=pattern.surface.name, files=files)
    return [*files, "metrics.json"]


def plot(pattern: Flattening) -> Figure:
    """Return a Matplotlib figure of a piece, on the body and in the plane, coloured by strain energy density."""
    from warpflat.pattern.export.picture import draw_figure

    return draw_figure([picture_piece(pattern)])


def picture_piece(pattern: Flattening) -> PicturePiece:
    """Return a piece's row in a picture, with its key measures as short texts."""
    from warpflat.pattern.export.picture import PicturePiece

    there, grain, made = pattern.surface.lines, pattern.datum_name, pattern.layout_measures
    datum = {} if grain in there else {grain: pattern.datum}
    # In the pattern cuts show as cracks.
    lines: dict[str, Any] = {
        name: line
        for name, line in pattern.network.surface.lines.items()
        if not pattern.cuts or name in there or not (".left" in name or ".right" in name)
    }
    if grain in there and grain not in lines:
        # A cut has parted the datum: its parts are drawn as one line.
        parts = [name for name in lines if name.startswith(f"{grain}.")]
        lines[grain] = [lines.pop(name) for name in parts] or pattern.datum
    cut = {int(v) for each in pattern.cuts for path in each.paths for v in path}
    uncut = {name: line for name, line in there.items() if not cut.issuperset(line.tolist())}
    captions = {
        "fabric": pattern.fabric.name,
        "strain energy": energy_words(made["strain_energy_j"]),
        "length error": f"{100 * made['length_error']:.2f} %",
        "area error": f"{100 * made['area_error']:.2f} %",
    }
    if made["flipped_faces"]:
        captions["flipped faces"] = f"{made['flipped_faces']:,}"
    if not pattern.converged:
        captions["converged"] = "NO"
    return PicturePiece(
        name=pattern.surface.name,
        surface=pattern.surface,
        faces=pattern.faces,
        positions=pattern.positions,
        face_energy_density=pattern.face_energy_density,
        lines={**lines, **datum},
        surface_lines={**uncut, **{f"{each.name} (cut)": list(each.paths) for each in pattern.cuts}, **datum},
        datum=grain,
        grain_angle=pattern.grain_angle,
        captions=captions,
    )


def write_pieces(
    pieces: Sequence[Flattening],
    folder: Path,
    *,
    picture: bool,
    frames: bool,
    body: Body | None = None,
    drafted: Sequence[DraftedOutline] = (),
) -> list[str]:
    """Write the files of several pieces, but not `metrics.json`, and return their names; a picture or film that fails is left out.

    Args:
        pieces: of different names.
        folder: an existing one, in a block of :func:`warpflat.pattern.files.output.output_folder`.
        picture: whether to draw one.
        frames: whether to write a USD file with the development and the pattern.
        body: on which the picture shows them first; none if not given.
        drafted: pieces without a surface that the picture shows, too.

    Raises:
        InputError: the folder cannot be written.
    """
    files = []
    for piece in pieces:
        file = file_in(folder, piece.surface.name, ".obj")
        write_obj(file, piece.surface, piece.positions, faces=piece.faces, pattern_to_surface=piece.vertex_origin)
        files.append(file.name)
    if frames:
        with optional_file(folder / "frames.usdc", files) as path:
            from warpflat.pattern.export.usd import FrameWriter, film_scale

            scale = film_scale([piece.surface for piece in pieces], [piece.face_energy_density for piece in pieces])
            with FrameWriter(path, scale=scale) as writer:
                for piece in pieces:
                    name, surface = piece.surface.name, piece.surface
                    writer.add_piece(name, surface)
                    if not piece.cuts:
                        first = worn_strain(piece.network, piece.development.positions).energy_density
                        writer.write(name, positions=piece.development.positions, face_energy_density=first)
                    writer.write(
                        name,
                        positions=piece.positions,
                        face_energy_density=piece.face_energy_density,
                        faces=piece.faces,
                        lines=piece.network.surface.lines,
                        cuts={cut.name: [side for s in cut.seams for side in (s.left, s.right)] for cut in piece.cuts},
                    )
    if picture:
        with optional_file(folder / "picture.png", files) as path:
            from warpflat.pattern.export.picture import write_picture

            write_picture(path, [picture_piece(piece) for piece in pieces], body=body, drafted=drafted)
    return files
