"""`flatten`: one surface, one fabric, one relaxed pattern."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpflat.arrays import FloatArray, IntArray
from warpflat.coarsen import levels_meanwhile
from warpflat.compiling import start_warp
from warpflat.darts import AppliedCut, measure_cut
from warpflat.develop import Development, chosen_datum, develop
from warpflat.errors import InputError, expect, expect_callback, nearest
from warpflat.fabric import DEFAULT_FABRIC, Fabric, as_fabric
from warpflat.heap import give_back_of
from warpflat.membrane import Model, check_model
from warpflat.network import SpringNetwork
from warpflat.opened import Opened, opened_faces
from warpflat.progress import Progress, Stage
from warpflat.relax import RelaxOptions, given_options
from warpflat.running import Relaxed, Run, relax_runs
from warpflat.strain import LayoutErrors, WornStrain, layout_errors, strain_energy, worn_strain
from warpflat.strain_map import energy_report
from warpflat.surface import Surface, line_from_indices, read_surface
from warpflat.tightness import Wear, WornFit, assess_fit, unused_stretch
from warpflat.wear_report import Remedy, wear_measures

if TYPE_CHECKING:
    from warpflat.export import PicturePiece

__all__ = ["Flattening", "Progress", "Stage", "flatten"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Flattening:
    """A relaxed pattern and what is known of it.

    Attributes:
        surface: the piece in space, uncut; with the cuts made it is `network.surface`.
        fabric: the cloth.
        datum: vertex indices of the line from which it was developed; the grain.
        datum_name: its name, or how it was chosen.
        positions: #P by 2, the pattern [m], warp along +y (turned by `grain_angle` degrees).
        stages: development and relaxation, with their energies.
        history: #K by 4, step, spring energy [J], guard energy [J], residual, at every look.
        notes: what was mended or chosen on the way, one sentence each.
        cuts: made since the first relaxation, see `warpflat.cutting`.
        wear: how it is meant to be worn, if that was asked for.
        options: of its last relaxation.
        alone: the piece as it lay before it was sewn or given fullness; None of one that was not.
        remedies: cuts that may help where it does not fit, once `warpflat.advise` has looked for them.
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
    cuts: tuple[AppliedCut, ...] = ()
    wear: Wear | None = None
    options: RelaxOptions = field(default_factory=RelaxOptions)
    alone: Flattening | None = None
    remedies: tuple[Remedy, ...] = ()

    @property
    def faces(self) -> IntArray:
        """#F by 4, the surface's faces in the pattern's numbering: cuts double vertices."""
        return self.network.surface.faces

    @cached_property
    def vertex_origin(self) -> IntArray:
        """#P, for each vertex of the pattern its vertex on the surface."""
        origin = np.arange(len(self.positions), dtype=np.int32)
        used = self.faces >= 0
        origin[self.faces[used]] = self.surface.faces[used]
        return origin

    @property
    def converged(self) -> bool:
        """False if the relaxation ran into its step limit."""
        return self.stages[-1].converged

    @property
    def flipped_faces(self) -> int:
        """Number of mirrored or collapsed faces."""
        return self._errors.flipped_faces

    @cached_property
    def _errors(self) -> LayoutErrors:
        return layout_errors(self.network.surface, self.network, self.positions)

    @cached_property
    def worn(self) -> WornStrain:
        """Worn strain and strain energy per face."""
        return worn_strain(self.network, self.positions)

    @cached_property
    def fit(self) -> WornFit:
        """How it sits when worn: strain, tension and pressure, against the fabric's limit."""
        return assess_fit(self.network, self.positions)

    @property
    def face_energy_density(self) -> FloatArray:
        """#F, strain energy per flat area [J/m2]."""
        return self.worn.energy_density

    @cached_property
    def opened(self) -> Opened | None:
        """The faces that are more than twice as large as on the body, if they matter and no fullness was asked for."""
        if any(stage.name == "fullness" for stage in self.stages):
            return None
        return opened_faces(self.network, self.positions)

    @property
    def told(self) -> tuple[str, ...]:
        """`notes`, and what is to be said of the pattern as it lies."""
        return self.notes if self.opened is None else (*self.notes, self.opened.words(self.network.model))

    @cached_property
    def measures(self) -> dict[str, Any]:
        """The piece's entry in `metrics.json`."""
        errors, last = self._errors, self.stages[-1]
        return {
            "vertices": len(self.surface.vertices),
            "faces": len(self.surface.faces),
            "springs": self.network.spring_count,
            "fabric": self.fabric.name,
            "model": self.network.model,
            "datum": self.datum_name,
            "development": self.development.method,
            "flipped_faces": errors.flipped_faces,
            "length_error": errors.length_error,
            "area_error": errors.area_error,
            "boundary_error": errors.boundary_error,
            "strain_energy_j": last.strain_energy_j,
            "spring_energy_j": last.spring_energy_j,
            "guard_energy_j": last.guard_energy_j,
            "area_m2": float(self.worn.area.sum()),
            "wear": wear_measures(
                self.fit,
                wear=self.wear,
                unsewn=None if self.alone is None else self.alone.fit,
                remedies=self.remedies,
            ),
            "converged": self.converged,
            "stages": [stage.as_dict() for stage in self.stages],
            "cuts": [measure_cut(self.network.surface, self.positions, cut) for cut in self.cuts],
            "energy": energy_report(self.network.surface, self.worn.energy),
            "opened": None if self.opened is None else self.opened.as_dict(),
            "notes": list(self.told),
        }

    def metrics(self) -> dict[str, Any]:
        """All of `metrics.json`."""
        from warpflat.result_files import metrics_of

        return metrics_of([self])

    def save(self, folder: str | Path, *, picture: bool = True, frames: bool = True) -> list[str]:
        """Write `metrics.json`, `NAME.obj`, `picture.png` and `frames.usdc` (development and pattern), all of them or none.

        Args:
            folder: made if need be.
            picture: whether to draw one.
            frames: whether to write a USD file; a run that streams its own frames does not want this one.

        Returns:
            The names of the files.

        Raises:
            InputError: the folder cannot be written, or the surface was read from a file there that would be replaced.
        """
        from warpflat.result_files import write_results

        return write_results([self], folder, picture=picture, frames=frames)

    def write_obj(self, folder: Path) -> str:
        """Write `NAME.obj` and return its name."""
        from warpflat.export import file_in, write_obj

        file = file_in(folder, self.surface.name, ".obj")
        write_obj(file, self.surface, self.positions, faces=self.faces, pattern_to_surface=self.vertex_origin)
        return file.name

    def picture_piece(self) -> PicturePiece:
        """Its row in a picture."""
        from warpflat.result_files import picture_piece

        return picture_piece(self)

    def captions(self) -> dict[str, str]:
        """The key measures as short texts."""
        m = self.measures
        captions = {
            "fabric": self.fabric.name,
            "strain energy": f"{1e3 * m['strain_energy_j']:.3g} mJ",
            "length error": f"{100 * m['length_error']:.2f} %",
            "area error": f"{100 * m['area_error']:.2f} %",
        }
        if m["flipped_faces"]:
            captions["flipped faces"] = f"{m['flipped_faces']:,}"
        if not self.converged:
            captions["converged"] = "NO"
        return captions


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
        model: "springs", the paper's, or "membrane", the cloth measured as worn (see `warpflat.network`); what is
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
        expect(wear, Wear, "wear", "a Wear, of warpflat.tightness")
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
    line, line_name, notes = _datum(surface, datum)
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
    give_back_of(surface)
    with levels_meanwhile(surface) if settings.options.solver == "multilevel" else nullcontext():
        development = run.let_go(develop(surface, line))
        give_back_of(surface)
        network = run.network_at(development.positions)
    give_back_of(surface)
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
        astray=[piece.run.astray(piece.development) for piece in pieces],
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


def _datum(surface: Surface, datum: str | ArrayLike | None) -> tuple[IntArray, str, list[str]]:
    """The datum as vertex indices, its name, and a note where it was chosen."""
    if datum is None:
        line, along = chosen_datum(surface)
        return line, "datum", [f"datum chosen: {along}, {datum_extent(surface, line)}"]
    if isinstance(datum, str):
        if datum not in surface.lines:
            raise InputError(
                f"piece {surface.name!r} has no line {datum!r} for its datum; {nearest(datum, surface.lines)}"
            )
        line, name = np.asarray(surface.lines[datum], dtype=np.int32), datum
    else:
        line, name = line_from_indices(surface, datum), "datum"
    if len(line) < 2:
        raise InputError(f"datum {name!r} of piece {surface.name!r} has {len(line)} vertex; it needs two or more")
    if line[0] == line[-1]:
        raise InputError(f"datum {name!r} of piece {surface.name!r} is closed; it must run from one end to another")
    chord = surface.vertices[line[-1]] - surface.vertices[line[0]]
    # A pattern lies as the piece hangs on the body (+y is up), whichever way its line happens to run.
    downward = chord[1] < -0.1 * float(np.linalg.norm(chord))
    return np.ascontiguousarray(line[::-1] if downward else line), name, []


def datum_extent(surface: Surface, line: IntArray) -> str:
    """How long a datum is (vertex indices of the line), and its ends as they were read."""
    length = np.linalg.norm(np.diff(surface.vertices[line], axis=0), axis=1).sum()
    ends = ", ".join(f"vertex {int(surface.input_index[v])}" for v in (line[0], line[-1]))
    return f"{100 * length:.1f} cm ({ends})"


def _device(name: str | None) -> wp.Device:
    start_warp()
    try:
        if name == "cuda" and not wp.get_cuda_devices():
            raise ValueError("no CUDA device")  # Warp would look for one, and print why there is none
        return wp.get_device(name)
    except Exception as error:
        devices: Sequence[str] = [d.alias for d in wp.get_devices()]
        raise InputError(f"device {name!r} is not available; {nearest(str(name), devices)}") from error
