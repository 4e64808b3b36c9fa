"""`flatten`: one surface, one fabric, one relaxed pattern."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from warpflat._version import __version__
from warpflat.develop import Development, choose_datum, develop
from warpflat.errors import InputError, nearest
from warpflat.fabric import DEFAULT_FABRIC, Fabric, find_fabric
from warpflat.network import SpringNetwork
from warpflat.relax import Energies, Outcome, Relaxation, RelaxOptions, relax
from warpflat.strain import WornStrain, layout_errors, worn_strain
from warpflat.surface import Surface, line_from_indices, read_surface

if TYPE_CHECKING:
    from warpflat.export import PicturePiece

__all__ = ["Flattening", "Progress", "Stage", "flatten"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# A first round only turns and shapes the layout; its directions are measured again after it.
_FIRST_ROUND = 30.0


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A line of the history: energies [J] when a stage had ended, and what it took.

    `residual` is the largest force on a vertex over the mean spring force; `work_units` counts approximate implicit
    steps over all vertices.
    """

    name: str
    spring_energy_j: float
    guard_energy_j: float
    strain_energy_j: float
    steps: int
    work_units: float
    seconds: float
    converged: bool
    residual: float | None

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`."""
        return dict(self.__dict__)


class Progress:
    """Where a run stands; what a callback gets after every step.

    Attributes:
        stage: "develop" or "relax".
        step: approximate implicit steps so far.
        max_steps: at most so many.
        spring_energy: [J], of the last look (see `RelaxOptions.check_every`).
        residual: largest force over mean spring force, likewise.
    """

    def __init__(self, stage: str, state: Relaxation, *, energies: Energies, residual: float, max_steps: int) -> None:
        """Hold on to the running state; nothing is copied before it is asked for."""
        self.stage = stage
        self.step = state.steps
        self.max_steps = max_steps
        self.spring_energy = energies.spring
        self.guard_energy = energies.guard
        self.residual = residual
        self._state = state

    def positions(self) -> FloatArray:
        """#V by 2, the layout [m], a copy."""
        return self._state.positions()

    def face_energy_density(self) -> FloatArray:
        """#F, strain energy per flat area [J/m2]."""
        return worn_strain(self._state.network, self.positions()).energy_density


@dataclass(frozen=True, kw_only=True, eq=False)
class Flattening:
    """A relaxed pattern and what is known of it.

    Attributes:
        surface: the piece in space.
        fabric: the cloth.
        datum: vertex indices of the line from which it was developed; the grain.
        datum_name: its name, or how it was chosen.
        positions: #V by 2, the pattern [m], warp along +y (turned by `grain_angle` degrees).
        stages: development and relaxation, with their energies.
        history: #K by 4, step, spring energy [J], guard energy [J], residual, at every look.
        notes: what was mended or chosen on the way, one sentence each.
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

    @property
    def faces(self) -> IntArray:
        """#F by 4, as the surface's."""
        return self.surface.faces

    @property
    def converged(self) -> bool:
        """False if the relaxation ran into its step limit."""
        return self.stages[-1].converged

    @property
    def flipped_faces(self) -> int:
        """Number of mirrored or collapsed faces."""
        return int(self.measures["flipped_faces"])

    @cached_property
    def worn(self) -> WornStrain:
        """Worn strain and strain energy per face."""
        return worn_strain(self.network, self.positions)

    @property
    def face_energy_density(self) -> FloatArray:
        """#F, strain energy per flat area [J/m2]."""
        return self.worn.energy_density

    @cached_property
    def measures(self) -> dict[str, Any]:
        """The piece's entry in `metrics.json`."""
        errors = layout_errors(self.surface, self.network, self.positions)
        last = self.stages[-1]
        return {
            "vertices": len(self.surface.vertices),
            "faces": len(self.surface.faces),
            "springs": self.network.spring_count,
            "fabric": self.fabric.name,
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
            "converged": self.converged,
            "stages": [stage.as_dict() for stage in self.stages],
            "notes": list(self.notes),
        }

    def metrics(self) -> dict[str, Any]:
        """All of `metrics.json`."""
        return {
            "schema": 1,
            "warpflat": __version__,
            "warp": wp.config.version,
            "device": _device_name(self.network.device),
            "pieces": {self.surface.name: self.measures},
        }

    def save(self, folder: str | Path, *, picture: bool = True, frames: bool = True) -> list[str]:
        """Write `metrics.json`, `NAME.obj`, `picture.png` and `frames.usdc` (development and pattern), each atomically.

        Args:
            folder: made if need be.
            picture: whether to draw one.
            frames: whether to write a USD file; a run that streams its own frames does not want this one.

        Returns:
            The names of the files.

        Raises:
            InputError: the folder cannot be written.
        """
        from warpflat.export import FrameWriter, prepare_folder, write_json, write_picture

        to = prepare_folder(folder)
        name = self.surface.name
        files = [self.write_obj(to)]
        if frames:
            files.append("frames.usdc")
            with FrameWriter(to / files[-1]) as writer:
                writer.add_piece(name, self.surface)
                first = worn_strain(self.network, self.development.positions).energy_density
                writer.write(name, positions=self.development.positions, face_energy_density=first)
                writer.write(name, positions=self.positions, face_energy_density=self.face_energy_density)
        if picture:
            files.append("picture.png")
            write_picture(to / files[-1], [self.picture_piece()])
        files.append("metrics.json")
        write_json(to / files[-1], self.metrics())
        return files

    def write_obj(self, folder: Path) -> str:
        """Write `NAME.obj` and return its name."""
        from warpflat.export import write_obj

        file = f"{self.surface.name}.obj"
        write_obj(folder / file, self.surface, self.positions)
        return file

    def picture_piece(self) -> PicturePiece:
        """Its row in a picture."""
        from warpflat.export import PicturePiece

        lines = dict(self.surface.lines)
        lines.setdefault(self.datum_name, self.datum)
        return PicturePiece(
            name=self.surface.name,
            surface=self.surface,
            faces=self.faces,
            positions=self.positions,
            face_energy_density=self.face_energy_density,
            lines=lines,
            surface_lines=lines,
            datum=self.datum_name,
            captions=self.captions(),
        )

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
        relax: options of the relaxation.
        callback: called with a `Progress` for the development (step 0) and after every step.
        device: Warp device, "cpu" or "cuda:0"; Warp's own choice if not given.

    Raises:
        InputError: what was given cannot be flattened; one line says what, where, and what would be right.
    """
    if not isinstance(surface, Surface):
        surface = read_surface(surface, units=units)
    cloth = find_fabric(fabric) if isinstance(fabric, str) else fabric
    options = relax or RelaxOptions()
    options.validate()
    if not np.isfinite(grain_angle):
        raise InputError(f"grain_angle = {grain_angle} is not a number of degrees")
    where = _device(device)
    line, line_name, notes = _datum(surface, datum)

    begun = time.perf_counter()
    development = develop(surface, line)
    run = _Run(surface, cloth, grain_angle, where, options, callback, line)
    state = run.state_at(development.positions)
    stages = [run.stage("develop", state, seconds=time.perf_counter() - begun)]
    state, outcome = run.relax(state, development)
    stages.append(run.stage("relax", state, outcome=outcome, seconds=outcome.seconds))
    return Flattening(
        surface=surface,
        fabric=cloth,
        datum=line,
        datum_name=line_name,
        grain_angle=grain_angle,
        network=state.network,
        development=development,
        positions=state.positions(),
        stages=tuple(stages),
        history=np.array(run.history),
        notes=(*surface.notes, *notes, *development.notes, *run.notes),
    )


@dataclass
class _Run:
    """A run under way: what it was asked for, and the history it leaves."""

    surface: Surface
    fabric: Fabric
    grain_angle: float
    device: wp.Device
    options: RelaxOptions
    callback: Callable[[Progress], None] | None
    datum: IntArray

    def __post_init__(self) -> None:
        self.history: list[tuple[float, float, float, float]] = []
        self.notes: list[str] = []

    def state_at(self, positions: FloatArray, *, after: Relaxation | None = None) -> Relaxation:
        """A relaxation that starts at a layout, with directions measured in it."""
        network = SpringNetwork.build(
            self.surface, self.fabric, positions, grain_angle=self.grain_angle, device=self.device
        )
        ends = (int(self.datum[0]), int(self.datum[-1]))
        state = Relaxation(network, self.options, start=positions, upright=ends)
        if after is not None:
            state.steps, state.restarts = after.steps, after.restarts
        return state

    def relax(self, state: Relaxation, development: Development) -> tuple[Relaxation, Outcome]:
        """Relax; where the first layout says little of directions, in two rounds, measuring them again in between."""
        self._tell("develop", state, state.energies(), float("nan"))
        begun = time.perf_counter()
        clamped = state.network.spring_arrays.clamped_cells
        if clamped:
            self.notes.append(
                f"{clamped:,} quads are so long that their shear springs outweigh the fabric along them; their "
                "structural springs were kept at 5 % of it"
            )
        isotropic = _is_isotropic(self.fabric)
        if development.mended or (not isotropic and not self.surface.is_quad.all()):
            state.options = replace(
                self.options,
                energy_tolerance=_FIRST_ROUND * self.options.energy_tolerance,
                residual_tolerance=_FIRST_ROUND * self.options.residual_tolerance,
            )
            self._relax(state)
            state = self.state_at(state.positions(), after=state)
        state.options = self.options
        outcome = self._relax(state)
        return state, replace(outcome, steps=state.steps, seconds=time.perf_counter() - begun)

    def _relax(self, state: Relaxation) -> Outcome:
        return relax(state, watch=self._watch, each_step=None if self.callback is None else self._each_step)

    def _watch(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self.history.append((float(state.steps), energies.spring, energies.guard, residual))

    def _each_step(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self._tell("relax", state, energies, residual)

    def _tell(self, stage: str, state: Relaxation, energies: Energies, residual: float) -> None:
        if self.callback is not None:
            self.callback(
                Progress(stage, state, energies=energies, residual=residual, max_steps=self.options.max_steps)
            )

    def stage(self, name: str, state: Relaxation, *, seconds: float, outcome: Outcome | None = None) -> Stage:
        """The line of the history for a stage that ended in this state."""
        energies = state.energies() if outcome is None else outcome.energies
        steps = 0 if outcome is None else outcome.steps
        return Stage(
            name=name,
            spring_energy_j=energies.spring,
            guard_energy_j=energies.guard,
            strain_energy_j=float(worn_strain(state.network, state.positions()).energy.sum()),
            steps=steps,
            work_units=float(steps),
            seconds=seconds,
            converged=True if outcome is None else outcome.converged,
            residual=None if outcome is None else outcome.residual,
        )


def _is_isotropic(fabric: Fabric) -> bool:
    same = np.isclose(fabric.stiffness_warp, fabric.stiffness_weft, rtol=1e-9)
    return bool(same and np.isclose(fabric.shear_stiffness, fabric.stiffness_warp / 2 / (1 + fabric.poisson_ratio)))


def _datum(surface: Surface, datum: str | ArrayLike | None) -> tuple[IntArray, str, list[str]]:
    """The datum as vertex indices, its name, and a note where it was chosen."""
    if datum is None:
        line = choose_datum(surface)
        length = np.linalg.norm(np.diff(surface.vertices[line], axis=0), axis=1).sum()
        ends = ", ".join(f"vertex {int(surface.input_index[v])}" for v in (line[0], line[-1]))
        return line, "datum", [f"datum chosen: along the long axis through the middle, {100 * length:.1f} cm ({ends})"]
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


def _device(name: str | None) -> wp.Device:
    try:
        return wp.get_device(name)
    except Exception as error:
        devices: Sequence[str] = [d.alias for d in wp.get_devices()]
        raise InputError(f"device {name!r} is not available; {nearest(str(name), devices)}") from error


def _device_name(device: wp.Device) -> str:
    return platform.machine() + " cpu" if device.is_cpu else str(device.name)
