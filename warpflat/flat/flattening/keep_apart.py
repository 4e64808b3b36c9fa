"""A piece that has come to rest lying over itself is relaxed once more, with contact."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.flattening.conformal_layout import conformal_layout
from warpflat.flat.flattening.harmonic_layout import harmonic_layout
from warpflat.flat.flattening.progress import CONTACT, Stage, make_stage, make_stages
from warpflat.flat.flattening.relaxation_task import RelaxationTask, RelaxedPiece
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.contact import open_cracks, relax_with_contact, swirl
from warpflat.flat.solver.grain import grain_alignments
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.connectivity import components_of
from warpflat.flat.surface.injective import is_injective, overlap_area
from warpflat.flat.surface.laplacian import factor_pays
from warpflat.flat.surface.mesh import Surface

__all__ = ["costs_much", "keep_apart"]

# Where contact costs much, relaxation also starts from its layout swirled by these angles about the middle [rad]. A spiral of 2.5 turns
# needs the wide ones; by the narrow ones the sides of a slit slide along each other.
_SWIRLS = (-3.0, -1.5, -0.1, 0.1, 1.5, 3.0)
# Pieces of more vertices are not: that takes six times as long as contact alone. Nor does contact start again where it has not come to
# rest.
_MOST_SWIRLED = 10_000
# Contact that strains a piece by less than this costs little: a part of a circle lies flat almost without energy.
_IMPERCEPTIBLE = 1e-3


def costs_much(network: SpringNetwork, options: RelaxOptions, free: float, parted: float) -> bool:
    """Return whether contact, from the energy without to that with it [J], costs more than the share that is allowed, and is to be felt."""
    least = network.spring_arrays.energy_of_strain(_IMPERCEPTIBLE)
    return parted > free + max(options.contact_share * free, least)


def on_the_way(surface: Surface, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the layout (#V by 2 [m]) farthest on the straight way from one to another, by tenths, that is injective; else the start."""
    for share in np.arange(9, 0, -1) / 10.0:
        between = start + share * (end - start)
        if is_injective(surface, between):
            return np.asarray(between)
    return start


def keep_apart(
    task: RelaxationTask, end: RelaxedPiece, start: FloatArray, cut_sides: IntArray
) -> tuple[FloatArray, tuple[Stage, ...]]:
    """Relax a piece once more, with contact, if it has come to rest lying over itself; add a note.

    Args:
        task: of the piece.
        end: the piece relaxed without contact.
        start: #V by 2, the layout from which it was relaxed, and from which contact starts if it is injective [m]; else it starts from a
            conformal or a harmonic layout.
        cut_sides: the vertices on the sides of its cuts; a cut whose sides lie over each other is left as it is.

    Returns:
        The layout, #V by 2 [m], and the stages: those of the relaxation, and "contact" if there was one that succeeded.
    """
    surface, network, free = end.network.surface, end.network, end.positions
    stages = make_stages(task.stage_name, network, free, end.outcome)
    relaxed = stages[-1]
    overlap = overlap_area(surface, free, cut_sides) if task.options.gap_mm and not task.stopped else 0.0
    if overlap == 0.0:
        return free, stages
    words = f"flat, the piece lies over itself by {1e6 * overlap:.3g} mm2"
    alignments = grain_alignments(surface, task.datum, free)
    starts = [lambda: on_the_way(surface, open_cracks(surface, start), free)]
    if not components_of(surface).any():
        starts.append(lambda: harmonic_layout(surface))
        if factor_pays(surface):
            starts.insert(1, lambda: open_cracks(surface, conformal_layout(surface)))
    for first in starts:
        state = Relaxation(network, task.options, start=first(), alignments=alignments)
        outcome = relax_with_contact(state, 1e-3 * task.options.gap_mm)
        if outcome is not None and outcome.converged:
            before = relaxed.model_energy_j
            costly = costs_much(network, task.options, before, outcome.energies.potential)
            if costly and len(surface.vertices) <= _MOST_SWIRLED:
                # Which stretches of a border come to lie beside each other is a matter of the start: a spiral may be
                # wound up or unwound. So it begins once more where the piece began, and with what comes of that, swirled.
                layout, settled = start, state.positions()
                for turn in (0.0, *_SWIRLS):
                    other = Relaxation(
                        state.network, state.options, start=swirl(layout, turn), alignments=state.alignments
                    )
                    wound = relax_with_contact(other, 1e-3 * state.options.gap_mm)
                    if layout is start:
                        layout = settled if wound is None else other.positions()
                    if wound is not None and wound.converged and wound.energies.potential < outcome.energies.potential:
                        state, outcome = other, wound
            after = outcome.energies.potential
            share = f" ({100 * (after - before) / before:+.2g} %)" if after < 2.0 * before else ""
            task.notes.append(f"{words}; contact has parted it, at a price of {1e3 * (after - before):.3g} mJ{share}")
            return state.positions(), (*stages, make_stage(CONTACT, network, state.positions(), outcome))
        if outcome is not None and len(surface.vertices) > _MOST_SWIRLED:
            task.notes.append(
                f"{words}, and contact could not part it in {outcome.steps:,} iterations: cut it apart there, or make the mesh coarser"
            )
            return free, stages
    task.notes.append(f"{words}, and contact could not part it: cut it apart there")
    return free, stages
