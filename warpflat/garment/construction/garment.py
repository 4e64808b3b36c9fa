"""A garment: flat pieces and the seams between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, IntArray, arc_lengths, polyline_length
from warpflat.flat import Flattening, run_metrics, separate
from warpflat.garment.construction.edges import SAME_PIECE
from warpflat.garment.construction.laid_as_cut import CutPattern
from warpflat.garment.construction.mirror import even_sides, image_laid, mirror_images
from warpflat.garment.construction.sewn import MeasuredSeam, Sewn, Stitching
from warpflat.pattern import file_in, optional_file, output_folder, write_report

if TYPE_CHECKING:
    from warpflat.garment.construction.details import FinishingTable, OpeningTable, PocketTable, SeamTable
    from warpflat.garment.construction.rings import GarmentRing
    from warpflat.garment.construction.wearer import WearerFit
    from warpflat.pattern import Body, DraftedOutline

__all__ = ["Garment"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Garment:
    """Pieces, flattened, and sewn to each other or to themselves; a single piece without a seam is a garment, too.

    Attributes:
        name: the garment's.
        pieces: the flat pieces by name, in order; each whole, even where cuts have parted it.
        stitching: what is sewn to each other.
        sewn: outcome of relaxing them together under their seams and constraints; None if they were not sewn.
        border_seams: seams of a mesh that were named by lines along its border.
        openings: along its seams.
        finishing: of its free edges, in the pattern.
        pockets: in the pattern.
        remarks: what could not be had, one sentence each.
        as_cut: how a pattern that was taken as it is compares with what flattening gives; None if it was not.
        drape: the entry `drape` of `metrics.json`, by which the garment is judged then; None if it was not draped.
    """

    name: str
    pieces: Mapping[str, Flattening]
    stitching: Sequence[Stitching] = ()
    sewn: Sewn | None = None
    border_seams: Sequence[SeamTable] = ()
    openings: Sequence[OpeningTable] = ()
    finishing: Sequence[FinishingTable] = ()
    pockets: Sequence[PocketTable] = ()
    remarks: tuple[str, ...] = ()
    as_cut: CutPattern | None = None
    drape: Mapping[str, Any] | None = None

    def __repr__(self) -> str:
        energy = sum(piece.stages[-1].strain_energy_j for piece in self.pieces.values())
        return (
            f"<Garment {self.name!r}: {', '.join(self.pieces)}; {len(self.seams)} seams, strain energy {energy:.4g} J>"
        )

    @property
    def positions(self) -> dict[str, FloatArray]:
        """The layouts by piece, each #P by 2 [m]."""
        return {name: piece.positions for name, piece in self.pieces.items()}

    @cached_property
    def parts(self) -> dict[str, Flattening]:
        """What is cut from cloth, by name: the pieces, and the parts of those that cuts have parted."""
        return {part.surface.name: part for piece in self.pieces.values() for part in separate(piece)}

    def advised(self, advise: Callable[[Flattening], Flattening]) -> Garment:
        """Return the garment with what `advise` adds to each of its parts."""
        parts = {name: advise(part) for name, part in self.parts.items()}
        made = replace(self, pieces={name: parts.get(name, piece) for name, piece in self.pieces.items()})
        made.__dict__["parts"] = parts
        return made

    @property
    def seams(self) -> tuple[MeasuredSeam, ...]:
        """Every seam with the lengths of its two sides."""
        costs = {} if self.sewn is None else {made.name: made.cost for made in self.sewn.results if made.kind == "seam"}
        runs: dict[str, list[Stitching]] = {}
        for pair in self.stitching:
            if pair.sides is not None:
                runs.setdefault(pair.name, []).append(pair)
        found = []
        for name, pairs in runs.items():
            first, second = (self.pieces[piece] for piece in pairs[0].pieces)
            edges = [np.diff(arc_lengths(first.positions[pair.vertices[0]])) for pair in pairs]
            length = float(sum(edge.sum() for edge in edges))
            wished = sum(float((edge / pair.ratio).sum()) for edge, pair in zip(edges, pairs, strict=True))
            even = all(np.array_equal(pair.ratio, 1.0) for pair in pairs)
            assert pairs[0].sides is not None
            found.append(
                MeasuredSeam(
                    name=name,
                    sides=pairs[0].sides,
                    length_3d=sum(polyline_length(first.network.surface.vertices[pair.vertices[0]]) for pair in pairs),
                    lengths=(length, sum(polyline_length(second.positions[pair.vertices[1]]) for pair in pairs)),
                    ease=0.0 if even else wished / length - 1.0,
                    cost=costs.get(name),
                )
            )
        return tuple(found)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Pieces that are each other's mirror images, in space and, within 0.5 mm, in the pattern.

        One of the two is enough for the table: cut it twice, the second time turned over.
        """
        found, names = [], list(self.pieces)
        for first, (second, partners) in self.images.items():
            if names.index(second) > names.index(first):
                own = self.pieces[first].positions
                if np.abs(own - image_laid(own, self.pieces[second].positions, partners)).max() < SAME_PIECE:
                    found.append((first, second))
        return tuple(found)

    @cached_property
    def images(self) -> dict[str, tuple[str, IntArray]]:
        """By piece its mirror image in space, perhaps itself, and for each of its vertices that one's; without pieces that have none."""
        return mirror_images({name: piece.network.surface for name, piece in self.pieces.items()})

    def evened(self) -> dict[str, FloatArray]:
        """Return the layouts, each #P by 2 [m], as the means of themselves and their mirror images, if all pieces have one.

        A relaxation ends as far to the left or right of its symmetric rest as its tolerance leaves, some hundredths of a millimetre.
        """
        return even_sides(self.positions, self.images)

    @property
    def sources(self) -> tuple[Path, ...]:
        """The files that it was read from."""
        return tuple(source for piece in self.pieces.values() for source in piece.surface.sources)

    @property
    def rings(self) -> Sequence[GarmentRing]:
        """Every closed way around a garment on its mannequin, and what must pass through it."""
        return ()

    @property
    def wearer(self) -> WearerFit | None:
        """How it fits the person whose body it was made on; None without one."""
        return None

    @property
    def girths(self) -> Mapping[str, Mapping[str, float]]:
        """The entry `girths` of `metrics.json`: what it measures around a body, by level; empty without one."""
        return {}

    @property
    def body_girths(self) -> Mapping[str, float]:
        """Girths of the body by level, and of the "head" where that is known [m]; empty without one."""
        return {}

    @property
    def drawn_body(self) -> Body | None:
        """The body on which a picture shows it first."""
        return None

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on completions, repairs and choices, one sentence each."""
        alone = len(self.pieces) == 1
        of_pieces = (
            note if alone else f"{name}: {note}" for name, piece in self.pieces.items() for note in piece.messages
        )
        return (*self.remarks, *of_pieces)

    def metrics(self) -> dict[str, Any]:
        """Return the content of `metrics.json`."""
        device = next(iter(self.pieces.values())).network.device
        return run_metrics(self.piece_measures(), device, {**self.further_metrics(), **self.sewing_metrics()})

    def piece_measures(self) -> dict[str, dict[str, Any]]:
        """Return the entries of the parts in `metrics.json`, by name."""
        return {name: piece.measures for name, piece in self.parts.items()}

    def further_metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` beside pieces and seams."""
        found: dict[str, Any] = {} if self.as_cut is None else {"pattern_of_file": self.as_cut.as_dict()}
        return found if self.drape is None else {**found, "drape": self.drape}

    def summary(self) -> dict[str, Any]:
        """Return the entry of another size in `metrics.json`: convergence, flips, overlap, stages and seams."""
        pieces = {
            name: {
                "converged": piece.converged,
                "flipped_faces": piece.flipped_faces,
                "overlap_m2": piece.overlap,
                "stages": [stage.as_dict() for stage in piece.stages],
            }
            for name, piece in self.pieces.items()
        }
        return {"pieces": pieces, **self.sewing_metrics()}

    def sewing_metrics(self) -> dict[str, Any]:
        """Return the entries of `metrics.json` about seams and constraints; none of a mesh that has none."""
        found: dict[str, Any] = {}
        if self.sewn is not None:
            held = [result.as_dict() for result in self.sewn.constraints]
            found = {"constraints": held, "sewing": self.sewn.as_dict()}
        return {"seams": [seam.as_dict() for seam in self.seams], **found} if found or self.stitching else {}

    def save(self, folder: str | Path, *, picture: bool = True) -> list[str]:
        """Write `metrics.json`, an OBJ per piece and `picture.png`, all of them or none, and return their names.

        Raises:
            InputError: the folder cannot be written, or the body was read from a file there that would be replaced.
        """
        others = [*(["picture.png"] if picture else []), "metrics.json"]
        with output_folder(folder, others, sources=self.sources, guard=True) as to:
            files = self.write_files(to, picture=picture)
            write_report(to / "metrics.json", self.metrics(), name=self.name, files=files)
        return [*files, "metrics.json"]

    def write_wear(self, folder: Path) -> list[str]:
        """Draw how its parts are strained as they are worn, and return the names of the pictures."""
        from warpflat.pattern import write_wear_sheet

        files: list[str] = []
        for name, part in self.parts.items():
            with optional_file(file_in(folder, name, ".wear.png"), files) as path:
                write_wear_sheet(path, [part], title=name)
        return files

    def write_files(self, folder: Path, *, picture: bool, drafted: Sequence[DraftedOutline] = ()) -> list[str]:
        """Write an OBJ per piece and `picture.png`, but not `metrics.json`, and return their names.

        Args:
            folder: an existing one.
            picture: whether to draw one.
            drafted: pieces without a surface that it shows, too, as collars and pockets.

        Raises:
            InputError: the folder cannot be written.
        """
        from warpflat.pattern import write_pieces

        return write_pieces(
            list(self.parts.values()), folder, picture=picture, frames=False, body=self.drawn_body, drafted=drafted
        )
