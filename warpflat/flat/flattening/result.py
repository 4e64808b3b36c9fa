"""The result of flattening one piece: its layout, measures, history and files."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from warpflat._version import __version__
from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.flattening.applied_cut import AppliedCut, cut_sides, measure_cut
from warpflat.flat.flattening.develop import Development
from warpflat.flat.flattening.fit_report import Remedy, garment_wear, wear_measures
from warpflat.flat.flattening.progress import CONTACT, Stage
from warpflat.flat.flattening.stretched_faces import StretchedFaces, find_stretched_faces
from warpflat.flat.flattening.verdict import judge
from warpflat.flat.model.fit import WornFit, assess_fit
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import LayoutErrors, WornStrain, layout_errors, worn_strain
from warpflat.flat.model.wear import Wear
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.energy_map import energy_report
from warpflat.flat.surface.injective import overlap_area
from warpflat.flat.surface.mesh import Surface

__all__ = ["Flattening", "require_unsewn", "run_metrics"]

# What is measured of a layout, and does not change with the advice on it.
_MEASURED = ("vertex_origin", "_errors", "overlap", "worn", "fit", "stretched_faces", "layout_measures")


@dataclass(frozen=True, kw_only=True, eq=False)
class Flattening:
    """A relaxed pattern, with its measures and its history.

    Attributes:
        surface: the piece in space, uncut; `network.surface` is the cut one.
        fabric: the cloth.
        datum: vertex indices of the line from which the piece was developed, which is its grain.
        datum_name: name of that line.
        positions: #P by 2, the pattern [m], warp along +y (turned by `grain_angle` degrees).
        stages: development and relaxation, with their energies.
        history: #K by 4, step, model energy [J], guard energy [J], residual, at every convergence check.
        notes: what was repaired or chosen, one sentence each.
        relaxation_notes: those of the notes that tell how it was relaxed last; after an edit they hold no more.
        cuts: what `warpflat.cut` has cut since the first relaxation.
        wear: how the piece is to be worn, if that was asked for.
        options: options of the last relaxation.
        unsewn: the piece as it lay before it was sewn or given fullness; None if it was not.
        remedies: cuts that may help where the piece does not fit, found by `warpflat.advise`.
        close: #F, true where the surface lies close to the wearer's body; None where it is the body, or nothing is known of one. Elsewhere
            the cloth hangs, and what would hold it against the surface is no strain of the worn garment.
    """

    surface: Surface
    fabric: Fabric
    datum: IntArray
    datum_name: str
    grain_angle: float
    network: SpringNetwork
    development: Development
    positions: FloatArray
    stages: tuple[Stage, ...]
    history: FloatArray
    notes: tuple[str, ...]
    relaxation_notes: tuple[str, ...] = ()
    cuts: tuple[AppliedCut, ...] = ()
    wear: Wear | None = None
    options: RelaxOptions = field(default_factory=RelaxOptions)
    unsewn: Flattening | None = None
    remedies: tuple[Remedy, ...] = ()
    close: BoolArray | None = None

    def __post_init__(self) -> None:
        """Make the layout read-only for whoever holds the result."""
        shown = self.positions.view()
        shown.flags.writeable = False
        object.__setattr__(self, "positions", shown)

    def __repr__(self) -> str:
        last = self.stages[-1]
        return (
            f"<Flattening {self.surface.name!r}: {len(self.positions):,} vertices, {len(self.faces):,} faces, {self.fabric.name},\n"
            f" strain energy {last.strain_energy_j:.4g} J after {' > '.join(stage.name for stage in self.stages)},\n"
            f" {'at rest' if self.converged else 'NOT at rest'}, {self.flipped_faces} flipped faces>"
        )

    @property
    def faces(self) -> IntArray:
        """#F by 4, the surface's faces in the pattern's numbering, in which cuts have doubled vertices."""
        return self.network.surface.faces

    @cached_property
    def vertex_origin(self) -> IntArray:
        """#P, for each vertex of the pattern the vertex of the surface."""
        origin = np.arange(len(self.positions), dtype=np.int32)
        used = self.faces >= 0
        origin[self.faces[used]] = self.surface.faces[used]
        return origin

    @property
    def converged(self) -> bool:
        """False if the relaxation ran into its step limit, or was stopped."""
        return self.stages[-1].converged

    @property
    def start(self) -> str:
        """The layout from which the piece was relaxed, as text."""
        return self.development.start

    @property
    def flipped_faces(self) -> int:
        """Number of mirrored or collapsed faces."""
        return self._errors.flipped_faces

    @cached_property
    def overlap(self) -> float:
        """The area that the pattern covers more than once [m2], but for cuts whose sides lie over each other."""
        return overlap_area(self.network.surface, self.positions, cut_sides(self.cuts))

    @property
    def contact_energy(self) -> float:
        """The model energy that contact has cost where the piece would lie over itself [J]; 0 if the last stage is another one."""
        before, last = self.stages[-2:] if len(self.stages) > 1 else (self.stages[-1], self.stages[-1])
        return last.model_energy_j - before.model_energy_j if last.name == CONTACT else 0.0

    @cached_property
    def _errors(self) -> LayoutErrors:
        return layout_errors(self.network.surface, self.network, self.positions)

    @cached_property
    def worn(self) -> WornStrain:
        """Worn strain and strain energy per face."""
        return worn_strain(self.network, self.positions)

    @cached_property
    def fit(self) -> WornFit:
        """The fit when worn: strain, tension and pressure, and what lies beyond the fabric's limit."""
        return replace(assess_fit(self.network, self.positions), close=self.close)

    @property
    def face_energy_density(self) -> FloatArray:
        """#F, strain energy per flat area [J/m2]."""
        return self.worn.energy_density

    @cached_property
    def stretched_faces(self) -> StretchedFaces | None:
        """The faces that are more than twice as large as on the body; None if they hardly count or if fullness was asked for."""
        if any(stage.name == "fullness" for stage in self.stages):
            return None
        return find_stretched_faces(self.network, self.positions)

    @property
    def messages(self) -> tuple[str, ...]:
        """The notes, and a warning about faces that the pattern has stretched."""
        stretched = self.stretched_faces
        return self.notes if stretched is None else (*self.notes, stretched.message())

    @cached_property
    def layout_measures(self) -> dict[str, Any]:
        """The measures that are single numbers: counts, errors, energies [J] and the flat area [m2]."""
        errors, last = self._errors, self.stages[-1]
        return {
            "vertices": len(self.surface.vertices),
            "faces": len(self.surface.faces),
            "springs": self.network.spring_count,
            "flipped_faces": errors.flipped_faces,
            "length_error": errors.length_error,
            "area_error": errors.area_error,
            "boundary_error": errors.boundary_error,
            "strain_energy_j": last.strain_energy_j,
            "model_energy_j": last.model_energy_j,
            "guard_energy_j": last.guard_energy_j,
            "contact_energy_j": self.contact_energy,
            "overlap_m2": self.overlap,
            "area_m2": float(self.worn.area.sum()),
            "converged": self.converged,
        }

    @cached_property
    def measures(self) -> dict[str, Any]:
        """The piece's entry in `metrics.json`."""
        return self.measure()

    def measure(self, *, regions: Mapping[str, BoolArray] | None = None) -> dict[str, Any]:
        """Build the piece's entry in `metrics.json`.

        Args:
            regions: sets of faces by name, #F each, such as the bricks of a form; their strain energies are reported, too.
        """
        return {
            **self.layout_measures,
            "fabric": self.fabric.name,
            "model": self.network.model,
            "datum": self.datum_name,
            "development": self.development.method,
            "start": self.start,
            "wear": wear_measures(
                self.fit,
                wear=self.wear,
                unsewn=None if self.unsewn is None else self.unsewn.fit,
                remedies=self.remedies,
            ),
            "stages": [stage.as_dict() for stage in self.stages],
            "cuts": [measure_cut(self.network.surface, self.positions, cut) for cut in self.cuts],
            "energy": energy_report(self.network.surface, self.worn.energy, regions=regions),
            "opened": None if self.stretched_faces is None else self.stretched_faces.as_dict(),
            "notes": list(self.messages),
        }

    def with_remedies(self, remedies: Sequence[Remedy]) -> Flattening:
        """Return the piece with these cuts as `remedies`; what has been measured of its layout is kept."""
        advised = replace(self, remedies=tuple(remedies))
        kept = {name: self.__dict__[name] for name in _MEASURED if name in self.__dict__}
        advised.__dict__.update(kept)
        return advised

    def metrics(self) -> dict[str, Any]:
        """Build all of `metrics.json`."""
        return run_metrics({self.surface.name: self.measures}, self.network.device)


def run_metrics(
    pieces: Mapping[str, Mapping[str, Any]], device: wp.Device, more: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Assemble all of `metrics.json`.

    Args:
        pieces: the entries of the pieces by name, each of `Flattening.measure`.
        device: on which they were relaxed.
        more: entries besides the pieces.
    """
    metrics = {
        "schema": 1,
        "warpflat": __version__,
        "warp": wp.config.version,
        "device": platform.machine() + " cpu" if device.is_cpu else str(device.name),
        "pieces": dict(pieces),
        **(more or {}),
    }
    if any("wear" in piece for piece in pieces.values()):
        metrics["wear"] = {**garment_wear(pieces), **metrics.get("wear", {})}
    verdict = judge(metrics)
    return metrics if verdict is None else {**metrics, "verdict": verdict.as_dict()}


def require_unsewn(result: Flattening) -> None:
    """Refuse a piece that has been sewn or given fullness, since other pieces hold it there.

    Raises:
        InputError: it has been.
    """
    if result.unsewn is not None:
        raise InputError(
            f"piece {result.surface.name!r} has been sewn: edited alone it would lose its seams, folds and gathers; run the scene or "
            "flatten_form again with the change, or edit its `unsewn`, the piece as it lay before"
        )
