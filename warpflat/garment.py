"""A garment: the pieces of a form on a mannequin, each flattened, and the seams between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.errors import InputError, nearest
from warpflat.fabric import DEFAULT_FABRIC, Fabric
from warpflat.flattening import Flattening, Progress, flatten
from warpflat.mannequin import Carrier, FormResult, FormSeam, Mannequin
from warpflat.relax import RelaxOptions
from warpflat.sewing import SeamPair, Sewn, sew
from warpflat.strain_map import energy_report

__all__ = ["Garment", "SeamLengths", "flatten_form"]


@dataclass(frozen=True, kw_only=True)
class SeamLengths:
    """A seam, measured.

    Attributes:
        name: after the feature line.
        sides: "piece.edge" twice.
        length_3d: of the one curve in space that both sides come from [m].
        lengths: of its two sides in the pattern [m].
        difference: first minus second [m].
        ease: first over second, minus 1.
    """

    name: str
    sides: tuple[str, str]
    length_3d: float
    lengths: tuple[float, float]

    @property
    def difference(self) -> float:
        """First side minus second [m]."""
        return self.lengths[0] - self.lengths[1]

    @property
    def ease(self) -> float:
        """How much longer the first side is, as a share of the second."""
        return self.lengths[0] / self.lengths[1] - 1.0

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`."""
        return {
            "name": self.name,
            "sides": list(self.sides),
            "length_mm": [1e3 * length for length in self.lengths],
            "length_3d_mm": 1e3 * self.length_3d,
            "difference_mm": 1e3 * self.difference,
            "ease": self.ease,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Garment:
    """A form's pieces, flattened.

    Attributes:
        name: the garment's.
        mannequin: whose form it is.
        form: the pieces in space, with their edges and seams.
        pieces: the flat pieces by name, in the form's order.
        sewn: how they were relaxed together under their seams, and what equal seams cost; None if they were not.
    """

    name: str
    mannequin: Mannequin
    form: FormResult
    pieces: Mapping[str, Flattening]
    sewn: Sewn | None = None

    @property
    def seams(self) -> tuple[SeamLengths, ...]:
        """Every seam with the lengths of its two sides."""
        return tuple(self._measured(seam) for seam in self.form.seams)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was completed, mended or chosen, one sentence each."""
        of_pieces = (f"{name}: {note}" for name, piece in self.pieces.items() for note in piece.notes)
        return (*self.mannequin.notes, *of_pieces)

    def _measured(self, seam: FormSeam) -> SeamLengths:
        first, second = (self.pieces[piece] for piece in seam.pieces)
        return SeamLengths(
            name=seam.name,
            sides=(f"{seam.pieces[0]}.{seam.edges[0]}", f"{seam.pieces[1]}.{seam.edges[1]}"),
            length_3d=_length(first.surface.vertices[seam.vertices[0]]),
            lengths=(_length(first.positions[seam.vertices[0]]), _length(second.positions[seam.vertices[1]])),
        )

    def carrier(self, piece: str) -> Carrier:
        """What carries points and drawn lines between a piece's pattern and the body, both ways.

        Raises:
            InputError: there is no such piece.
        """
        if piece not in self.pieces:
            raise InputError(f"garment {self.name!r} has no piece {piece!r}; {nearest(piece, self.pieces)}")
        flat = self.pieces[piece]
        return Carrier(flat.surface.vertices, flat.positions, flat.faces)

    def _measures(self, name: str) -> dict[str, Any]:
        """The piece's measures, its energy also brick by brick."""
        piece, brick = self.pieces[name], np.array(self.form.pieces[name].face_brick)
        bricks = {each: brick == each for each in dict.fromkeys(brick.tolist())}
        return {**piece.measures, "energy": energy_report(piece.network.surface, piece.worn.energy, regions=bricks)}

    def metrics(self) -> dict[str, Any]:
        """All of `metrics.json`."""
        first = next(iter(self.pieces.values()))
        return {
            **first.metrics(),
            "pieces": {name: self._measures(name) for name in self.pieces},
            "mannequin": self.mannequin.metrics(),
            "seams": [seam.as_dict() for seam in self.seams],
            **({} if self.sewn is None else {"sewing": self.sewn.as_dict()}),
        }

    def save(self, folder: str | Path, *, picture: bool = True) -> list[str]:
        """Write `metrics.json`, an OBJ per piece and `picture.png`, each atomically; returns their names.

        Raises:
            InputError: the folder cannot be written.
        """
        from warpflat.export import prepare_folder, write_json, write_picture

        to = prepare_folder(folder)
        files = [piece.write_obj(to) for piece in self.pieces.values()]
        if picture:
            files.append("picture.png")
            write_picture(to / files[-1], [piece.picture_piece() for piece in self.pieces.values()])
        files.append("metrics.json")
        write_json(to / files[-1], self.metrics())
        return files


def flatten_form(
    mannequin: Mannequin,
    form: FormResult,
    *,
    fabric: Fabric | str = DEFAULT_FABRIC,
    grain_angle: float = 0.0,
    relax: RelaxOptions | None = None,
    callback: Callable[[str, Progress], None] | None = None,
    device: str | None = None,
    sewn: bool = True,
    **options: Any,
) -> Garment:
    """Flatten every piece of a form, each from its own datum line, then all together, so that their seams match.

    Args:
        mannequin: whose form it is.
        form: what `Mannequin.form` gives.
        fabric, grain_angle, relax, device, options: as :func:`warpflat.flatten` takes them.
        callback: called with the piece's name and its `Progress` after every step of its own.
        sewn: relax the pieces together, both sides of every seam equally long, and folds straight; otherwise each piece
            keeps its own minimum.

    Raises:
        InputError: a piece cannot be flattened; one line says which and why.
    """
    pieces = {}
    for name, piece in form.pieces.items():

        def told(progress: Progress, name: str = name) -> None:
            if callback is not None:
                callback(name, progress)

        pieces[name] = flatten(
            piece.surface,
            fabric=fabric,
            datum=piece.datum or None,
            grain_angle=grain_angle,
            relax=relax,
            callback=told if callback is not None else None,
            device=device,
            **options,
        )
    if not sewn:
        return Garment(name=form.name, mannequin=mannequin, form=form, pieces=pieces)
    pairs = [SeamPair(name=seam.name, pieces=seam.pieces, vertices=seam.vertices) for seam in form.seams]
    folds = {name: piece.edges[piece.fold] for name, piece in form.pieces.items() if piece.fold}
    together = sew(pieces, pairs, straight=folds, options=relax)
    return Garment(name=form.name, mannequin=mannequin, form=form, pieces=together.pieces, sewn=together)


def _length(points: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
