"""`flatten`: one surface, one fabric, one relaxed pattern."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpflat.core.compile import start_warp
from warpflat.core.errors import InputError, expect, expect_callback, nearest
from warpflat.core.free_memory import return_freed_memory
from warpflat.fabric.fabric import DEFAULT_FABRIC, Fabric
from warpflat.fabric.library import as_fabric
from warpflat.flattening.datum import resolve_datum
from warpflat.flattening.develop import Development, develop
from warpflat.flattening.progress import Progress, Stage
from warpflat.flattening.relax_pieces import Relaxed, Run, relax_runs
from warpflat.flattening.result import Flattening
from warpflat.model.membrane import Model, check_model
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import strain_energy
from warpflat.model.wear import Wear, unused_stretch
from warpflat.solver.multigrid.coarsen import hierarchy_in_background
from warpflat.solver.options import RelaxOptions, given_options
from warpflat.surface.io.read import read_surface
from warpflat.surface.mesh import Surface, is_large

if TYPE_CHECKING:
    pass

__all__ = ["flatten", "return_memory_of"]


def flatten(
    surface: Surface | str | Path,
    *,
    fabric: Fabric | str = DEFAULT_FABRIC,
    datum: str | ArrayLike | None = None,
    grain_angle: float = 0.0,
    units: str | None = None,
    model: Model = "springs",
    wear: Wear | None = None,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], None] | None = None,
    device: str | None = None,
) -> Flattening:
    """Flatten one piece: develop it from its datum line, then relax its mass-spring model to the minimum of its energy.

    Args:
        surface: a `Surface`, or the path of a mesh file.
        fabric: a `Fabric`, or a name of the library (`warpflat fabrics` lists it).
        datum: the line from which it is developed and which becomes the grain: a name in `surface.lines`, or vertex
            indices along mesh edges; if not given, the line along the long axis through the middle.
        grain_angle: of the warp against the datum, degrees; 45 cuts on the bias.
        units: of a mesh file that carries none: "m", "cm", "mm", "in", "ft".
        model: "springs", the paper's, or "membrane", the cloth measured as worn (see `warpflat.model.network`); what is
            minimised is reported as `spring_energy_j` either way.
        wear: the stretch or pressure it is meant to be worn with; the pattern is cut so much smaller.
        relax: options of the relaxation.
        callback: called with a `Progress` for the development (step 0) and after every step.
        device: Warp device, "cpu" or "cuda:0"; Warp's own choice if not given.

    Raises:
        InputError: what was given cannot be flattened; one line says what, where, and what would be right.
    """
    surface = given_surface(surface, units)
    expect_callback(callback)
    settings = check_settings(fabric, grain_angle=grain_angle, model=model, wear=wear, relax=relax, device=device)
    started = start(surface, datum, settings, callback)
    _refuse_unused_stretch(started)
    return finish([started])[0]


def _refuse_unused_stretch(piece: Started) -> None:
    """Which threads run around the body is known once a piece is developed; of several pieces each has its own, and a note says so."""
    wear, notes = piece.run.wear, piece.run.notes
    unused = [] if wear is None else [unused_stretch(wear, around) for around in ("warp", "weft")]
    for told in unused:
        if told in notes:
            raise InputError(f"piece {piece.run.surface.name!r}: wear: {told}; leave it out, or the pressure")


def given_surface(surface: Surface | str | Path, units: str | None) -> Surface:
    """The surface, read if it is a file's path.

    Raises:
        InputError: it is neither, or cannot be read.
    """
    if isinstance(surface, Surface):
        return surface
    expect(surface, (str, PathLike), "surface", "a Surface or the path of a mesh file")
    return read_surface(surface, units=units)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What several pieces that are flattened have in common; as `flatten` takes it, checked."""

    fabric: Fabric
    grain_angle: float
    model: Model
    wear: Wear | None
    options: RelaxOptions
    device: wp.Device


def check_settings(
    fabric: Fabric | str,
    *,
    grain_angle: float,
    model: Model,
    wear: Wear | None,
    relax: RelaxOptions | None,
    device: str | None,
) -> Settings:
    """Look up what is named, and fill in what is not given.

    Raises:
        InputError: an unknown name, or a number out of its bounds.
    """
    cloth = as_fabric(fabric)
    options = given_options(relax)
    if wear is not None:
        expect(wear, Wear, "wear", "a Wear, of warpflat.model.fit")
    angle = np.asarray(grain_angle)
    if angle.ndim or angle.dtype.kind not in "iuf" or not np.isfinite(angle):
        raise InputError(f"grain_angle = {grain_angle!r} is not a number of degrees")
    check_model(model)
    return Settings(
        fabric=cloth, grain_angle=grain_angle, model=model, wear=wear, options=options, device=_device(device)
    )


@dataclass(frozen=True, kw_only=True)
class Started:
    """A piece that has been developed and is to be relaxed.

    Attributes:
        run: what was asked for.
        datum_name: its name, or how it was chosen.
        development: let go of the stretch that is meant.
        network: measured in it.
        notes: on the datum.
        seconds: that it took so far.
    """

    run: Run
    datum_name: str
    development: Development
    network: SpringNetwork
    notes: tuple[str, ...]
    seconds: float


def start(
    surface: Surface,
    datum: str | ArrayLike | None,
    settings: Settings,
    callback: Callable[[Progress], None] | None,
) -> Started:
    """The first half of `flatten`: develop the piece from its datum, and measure its network there.

    Raises:
        InputError: it cannot be developed.
    """
    line, line_name, notes = resolve_datum(surface, datum)
    begun = time.perf_counter()
    run = Run(
        surface,
        settings.fabric,
        settings.grain_angle,
        settings.device,
        settings.options,
        callback,
        line,
        model=settings.model,
        wear=settings.wear,
    )
    return_memory_of(surface)
    with hierarchy_in_background(surface) if settings.options.solver == "multilevel" else nullcontext():
        development = run.let_go(develop(surface, line))
        return_memory_of(surface)
        network = run.network_at(development.positions)
    return_memory_of(surface)
    return Started(
        run=run,
        datum_name=line_name,
        development=development,
        network=network,
        notes=tuple(notes),
        seconds=time.perf_counter() - begun,
    )


def finish(pieces: Sequence[Started]) -> list[Flattening]:
    """The second half of `flatten`: relax the pieces, of the same settings, side by side."""
    relaxed = relax_runs(
        [piece.run for piece in pieces],
        [piece.network for piece in pieces],
        [piece.development.positions for piece in pieces],
        again=[piece.run.measured_again(mended=piece.development.mended) for piece in pieces],
        needs_isotropic_start=[piece.run.needs_isotropic_start(piece.development) for piece in pieces],
    )
    return [_flattening(piece, end) for piece, end in zip(pieces, relaxed, strict=True)]


def _flattening(piece: Started, end: Relaxed) -> Flattening:
    run, development = piece.run, piece.development
    developed = Stage(
        name="develop",
        spring_energy_j=end.begin.spring,
        guard_energy_j=end.begin.guard,
        strain_energy_j=strain_energy(piece.network, development.positions),
        steps=0,
        work_units=0.0,
        seconds=piece.seconds,
        converged=True,
        residual=None,
    )
    return Flattening(
        surface=run.surface,
        fabric=run.fabric,
        datum=run.datum,
        datum_name=piece.datum_name,
        grain_angle=run.grain_angle,
        network=end.network,
        development=development,
        positions=end.positions,
        stages=(developed, run.stage("relax", end.network, end.positions, end.outcome)),
        history=np.array(run.history),
        notes=(*run.surface.notes, *piece.notes, *development.notes, *run.notes),
        wear=run.wear,
        options=run.options,
    )


def _device(name: str | None) -> wp.Device:
    start_warp()
    try:
        if name == "cuda" and not wp.get_cuda_devices():
            raise ValueError("no CUDA device")  # Warp would look for one, and print why there is none
        return wp.get_device(name)
    except Exception as error:
        devices: Sequence[str] = [d.alias for d in wp.get_devices()]
        raise InputError(f"device {name!r} is not available; {nearest(str(name), devices)}") from error


def return_memory_of(surface: Surface) -> None:
    """Give back what a part of the way to its relaxation has freed, where that is much: of many triangles."""
    if is_large(surface) and not surface.is_quad.all():
        return_freed_memory()
