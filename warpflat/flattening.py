"""`flatten`: one surface, one fabric, one relaxed pattern."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from warpflat.darts import AppliedCut, measure_cut
from warpflat.develop import Development, choose_datum, develop
from warpflat.errors import InputError, nearest
from warpflat.fabric import DEFAULT_FABRIC, Fabric, find_fabric
from warpflat.membrane import Model, check_model
from warpflat.multilevel import levels_pay, relax_multilevel
from warpflat.network import SpringNetwork, grain_axes
from warpflat.relax import Energies, Outcome, Relaxation, RelaxOptions, Upright, relax
from warpflat.strain import WornStrain, layout_errors, worn_strain
from warpflat.strain_map import energy_report
from warpflat.surface import Surface, components, line_from_indices, read_surface
from warpflat.tightness import Wear, WornFit, assess_fit, meant_stretch

if TYPE_CHECKING:
    from warpflat.export import PicturePiece

__all__ = ["Flattening", "Progress", "Stage", "flatten", "relax_cut"]

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
        stage: "develop", "relax" or "cut:NAME".
        step: approximate implicit steps so far, on the piece's own mesh.
        work_units: all work so far, in such steps.
        max_steps: at most so many.
        spring_energy: [J], of the last look (see `RelaxOptions.check_every`).
        residual: largest force over mean spring force, likewise.
    """

    def __init__(self, stage: str, state: Relaxation, *, energies: Energies, residual: float, max_steps: int) -> None:
        """Hold on to the running state; nothing is copied before it is asked for."""
        self.stage = stage
        self.step = state.steps
        self.work_units = state.work_units
        self.max_steps = max_steps
        self.spring_energy = energies.spring
        self.guard_energy = energies.guard
        self.residual = residual
        self._state = state

    @property
    def surface(self) -> Surface:
        """The surface with the present topology: after a cut its vertices are doubled."""
        return self._state.network.surface

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
        return int(self.measures["flipped_faces"])

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
    def measures(self) -> dict[str, Any]:
        """The piece's entry in `metrics.json`."""
        from warpflat.wear_report import wear_measures

        errors = layout_errors(self.network.surface, self.network, self.positions)
        last = self.stages[-1]
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
            "wear": wear_measures(self),
            "converged": self.converged,
            "stages": [stage.as_dict() for stage in self.stages],
            "cuts": [measure_cut(self.network.surface, self.positions, cut) for cut in self.cuts],
            "energy": energy_report(self.network.surface, self.worn.energy),
            "notes": list(self.notes),
        }

    def metrics(self) -> dict[str, Any]:
        """All of `metrics.json`."""
        from warpflat.result_files import metrics_of

        return metrics_of([self])

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
        from warpflat.result_files import write_results

        return write_results([self], folder, picture=picture, frames=frames)

    def write_obj(self, folder: Path) -> str:
        """Write `NAME.obj` and return its name."""
        from warpflat.export import write_obj

        file = f"{self.surface.name}.obj"
        write_obj(folder / file, self.surface, self.positions, faces=self.faces, pattern_to_surface=self.vertex_origin)
        return file

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
    if not isinstance(surface, Surface):
        surface = read_surface(surface, units=units)
    cloth = find_fabric(fabric) if isinstance(fabric, str) else fabric
    options = relax or RelaxOptions()
    options.validate()
    if not np.isfinite(grain_angle):
        raise InputError(f"grain_angle = {grain_angle} is not a number of degrees")
    check_model(model)
    where = _device(device)
    line, line_name, notes = _datum(surface, datum)

    begun = time.perf_counter()
    run = _Run(surface, cloth, grain_angle, where, options, callback, line, model=model, wear=wear)
    development = run.let_go(develop(surface, line))
    state = run.state_at(development.positions)
    stages = [run.stage("develop", state, seconds=time.perf_counter() - begun)]
    state, outcome = run.relax(state, mended=development.mended)
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
        wear=run.wear,
    )


def relax_cut(
    result: Flattening,
    surface: Surface,
    positions: FloatArray,
    *,
    stage: str,
    cuts: Sequence[AppliedCut],
    options: RelaxOptions,
    callback: Callable[[Progress], None] | None = None,
) -> Flattening:
    """Go on from a layout of a piece whose topology has changed; `warpflat.cutting.cut` makes such.

    Args:
        result: of the piece before.
        surface: `result.surface` with vertices doubled (#P), of which the first keep their numbers.
        positions: #P by 2, where to go on from [m].
        stage: what it is called in the history.
        cuts: all that `surface` has.
        options: of the relaxation.
        callback: called with a `Progress` before the first step and after every step.
    """
    options.validate()
    part = components(surface.faces)
    part_of = np.full(len(surface.vertices), -1)
    used = surface.faces >= 0
    part_of[surface.faces[used]] = np.broadcast_to(part[:, None], surface.faces.shape)[used]
    # A cut may part the datum: then the first part of it stays upright.
    datum = result.datum[part_of[result.datum] == part_of[result.datum[0]]]
    run = _Run(surface, result.fabric, result.grain_angle, result.network.device, options, callback, datum, stage)
    run.model, run.wear = result.network.model, result.wear
    state, outcome = run.relax(run.state_at(positions), mended=False)
    return replace(
        result,
        network=state.network,
        positions=state.positions(),
        stages=(*result.stages, run.stage(stage, state, outcome=outcome, seconds=outcome.seconds)),
        history=np.concatenate([result.history.reshape(-1, 4), np.array(run.history).reshape(-1, 4)]),
        notes=(*result.notes, *(note for note in run.notes if note not in result.notes)),
        cuts=tuple(cuts),
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
    stage_name: str = "relax"
    model: Model = "springs"
    wear: Wear | None = None

    def __post_init__(self) -> None:
        self.history: list[tuple[float, float, float, float]] = []
        self.notes: list[str] = []

    def let_go(self, development: Development) -> Development:
        """The development made smaller by the mean stretch that is meant: the cloth as it was on the body, let go."""
        stretch, _ = self._meant(development.positions)
        if stretch is None:
            return development
        shrink = sum(
            np.outer(axis, axis) / s for axis, s in zip(grain_axes(self.grain_angle), stretch.mean(0), strict=True)
        )
        return replace(development, positions=development.positions @ shrink)

    def _meant(self, positions: FloatArray) -> tuple[FloatArray | None, tuple[str, ...]]:
        if self.wear is None:
            return None, ()
        return meant_stretch(self.surface, self.fabric, positions, self.wear, grain_angle=self.grain_angle)

    def state_at(self, positions: FloatArray, *, after: Relaxation | None = None) -> Relaxation:
        """A relaxation that starts at a layout, with directions measured in it."""
        stretch, notes = self._meant(positions)
        self.notes += [note for note in notes if note not in self.notes]
        network = SpringNetwork.build(
            self.surface,
            self.fabric,
            positions,
            grain_angle=self.grain_angle,
            device=self.device,
            model=self.model,
            stretch=stretch,
        )
        ends = Upright(lower=int(self.datum[0]), upper=int(self.datum[-1]))
        state = Relaxation(network, self.options, start=positions, upright=[ends])
        if after is not None:
            state.steps, state.restarts, state.work_units = after.steps, after.restarts, after.work_units
        return state

    def relax(self, state: Relaxation, *, mended: bool) -> tuple[Relaxation, Outcome]:
        """Relax; where the first layout says little of directions, in two rounds, measuring them again in between."""
        first = "develop" if self.stage_name == "relax" else self.stage_name
        self._tell(first, state, state.energies(), float("nan"))
        begun = time.perf_counter()
        clamped = state.network.spring_arrays.clamped_cells
        if clamped:
            self.notes.append(
                f"{clamped:,} quads are so long that their shear springs outweigh the fabric along them; their "
                "structural springs were kept at 5 % of it"
            )
        isotropic = _is_isotropic(self.fabric)
        if mended or (not isotropic and not self.surface.is_quad.all()):
            state.options = replace(
                self.options,
                energy_tolerance=_FIRST_ROUND * self.options.energy_tolerance,
                residual_tolerance=_FIRST_ROUND * self.options.residual_tolerance,
            )
            self._relax(state)
            state = self.state_at(state.positions(), after=state)
        state.options = self.options
        outcome = self._relax(state)
        seconds = time.perf_counter() - begun
        return state, replace(outcome, steps=state.steps, work_units=state.work_units, seconds=seconds)

    def _relax(self, state: Relaxation) -> Outcome:
        each_step = None if self.callback is None else self._each_step
        if self.options.solver == "plain" or not levels_pay(state.network):
            return relax(state, watch=self._watch, each_step=each_step)
        # After a cut the layout is near the minimum already.
        nested = self.stage_name == "relax" and state.steps == 0
        return relax_multilevel(state, nested=nested, watch=self._watch, each_step=each_step)

    def _watch(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self.history.append((float(state.steps), energies.spring, energies.guard, residual))

    def _each_step(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self._tell(self.stage_name, state, energies, residual)

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
            work_units=0.0 if outcome is None else outcome.work_units,
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
