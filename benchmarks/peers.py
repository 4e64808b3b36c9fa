"""The peers: libigl's ARAP and SLIM, SciPy's L-BFGS, and majorization with a sparse Cholesky factor.

Each takes a `Problem` and a first layout and shows every iterate to a `Clock`, which stands while it looks. Packages that are
not installed leave their rows out. Programs that show no iterate (boundary first flattening, Blender, xatlas) give their layout and
the processor seconds that it took.
"""

from __future__ import annotations

import math
import resource
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from energy import LayoutEnergy
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse.linalg import splu

from warpflat.flat.surface.untangle import signed_cell_areas

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
Solve = Callable[[FloatArray], FloatArray]

# What time is read from: `time.perf_counter`, or `time.process_time` on a machine that others use (speed.py --clock cpu).
_clock: list[Callable[[], float]] = [time.perf_counter]

# ARAP and SLIM minimise energies of their own and are stopped where these change by less per iteration.
_OWN_CHANGE = 1e-4


def now() -> float:
    """Seconds, by the clock that was chosen."""
    return _clock[0]()


def choose_clock(name: str) -> None:
    """ "wall", or "cpu": that of the process, all its threads together."""
    _clock[0] = {"wall": time.perf_counter, "cpu": time.process_time}[name]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One surface to be flattened by everybody.

    Attributes:
        vertices: #V by 3 [m]. triangles: #T by 3, of the surface; quads are split along their first diagonal.
        corner: #C by 3, the cells on which mirrored faces are counted.
        energy: what is minimised.
    """

    vertices: FloatArray
    triangles: IntArray
    corner: IntArray
    energy: LayoutEnergy

    def mirrored(self, positions: FloatArray) -> int:
        """Number of mirrored or collapsed cells of a layout."""
        return int((signed_cell_areas(self.corner, positions) <= 0).sum())


class Done(Exception):
    """A solver has shown enough."""


@dataclass(kw_only=True)
class Clock:
    """Runs while a solver works, and stands while its iterates are looked at.

    Attributes:
        problem: whose energy is asked.
        limit: seconds after which it is enough.
        stall: it is enough when this many iterates in a row have not improved the best unfolded energy by 1e-5.
        history: seconds, energy [J] (infinite where folded), number of mirrored cells, at each iterate.
        best: the iterate of least energy without a mirrored cell.
    """

    problem: Problem
    limit: float
    stall: int
    history: list[tuple[float, float, int]] = field(default_factory=list)
    best: FloatArray | None = None
    best_energy: float = math.inf
    last: FloatArray | None = None
    failure: str = ""

    def run(self, solver: Solver, start: FloatArray) -> Clock:
        """Let a solver solve."""
        self._since_better = 0
        self._begun = now()
        try:
            solver(self.problem, start.copy(), self)
        except Done:
            pass
        except Exception as error:
            self.failure = f"{type(error).__name__}: {error}"
        return self

    def look(self, positions: FloatArray) -> float:
        """Note an iterate; returns its energy."""
        seconds = now() - self._begun
        flips = self.problem.mirrored(positions)
        energy = self.problem.energy.value(positions) if flips == 0 else math.inf
        self.history.append((seconds, energy, flips))
        self._since_better += 1
        if not np.isfinite(positions).all():
            raise Done
        self.last = positions.copy()
        if energy < self.best_energy * (1.0 - 1e-5):
            self._since_better = 0
        if energy < self.best_energy:
            self.best, self.best_energy = self.last, energy
        if seconds > self.limit or self._since_better >= self.stall:
            raise Done
        self._begun = now() - seconds
        return energy

    def reached(self, energy: float) -> float:
        """Seconds after which an unfolded iterate had at most this energy; infinite if none had."""
        return min((seconds for seconds, value, _ in self.history if value <= energy), default=math.inf)

    @property
    def seconds(self) -> float:
        """Until the last iterate."""
        return self.history[-1][0] if self.history else math.inf


Solver = Callable[[Problem, FloatArray, Clock], None]


def lscm(problem: Problem) -> FloatArray:
    """Least-squares conformal map (Lévy et al. 2002) by libigl, pinned at two border vertices far apart, scaled to the
    surface's area. #V by 2 [m]."""
    import igl

    v, t = problem.vertices, problem.triangles.astype(np.int64)
    border = np.asarray(igl.boundary_loop(t)).ravel()
    first = border[np.argmax(np.linalg.norm(v[border] - v[border[0]], axis=1))]
    second = border[np.argmax(np.linalg.norm(v[border] - v[first], axis=1))]
    length = float(np.linalg.norm(v[second] - v[first]))
    layout = np.asarray(igl.lscm(v, t, np.array([first, second]), np.array([[0.0, 0.0], [length, 0.0]]))[0])
    return as_cloth(problem, layout)


def as_cloth(problem: Problem, layout: FloatArray) -> FloatArray:
    """Return a layout (#V by 2) scaled to the surface's area, and mirrored where most of it lies face down."""
    v, t = problem.vertices, problem.triangles
    area = 0.5 * np.linalg.norm(np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]]), axis=1).sum()
    flat = signed_cell_areas(problem.triangles, layout).sum()
    return np.ascontiguousarray(layout * np.array([1.0, math.copysign(1.0, flat)]) * (area / abs(flat)) ** 0.5)


def turn_upright(layout: FloatArray, datum: IntArray) -> FloatArray:
    """A layout (#V by 2 [m]) turned so that the chord of the datum, vertex indices, points up."""
    across, up = (layout[datum[-1]] - layout[datum[0]]) / np.linalg.norm(layout[datum[-1]] - layout[datum[0]])
    return layout @ np.array([[up, across], [-across, up]])


def _singular_values(problem: Problem) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    """Of the triangles' deformations from space to the plane, and the triangles' areas."""
    v, t = problem.vertices, problem.triangles
    a, b = v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]]
    length = np.linalg.norm(a, axis=1)
    along = np.einsum("ij,ij->i", a, b) / length
    height = np.linalg.norm(np.cross(a, b), axis=1) / length

    def of(positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        p = (positions[t[:, 1]] - positions[t[:, 0]]) / length[:, None]
        q = (positions[t[:, 2]] - positions[t[:, 0]] - along[:, None] * p) / height[:, None]
        plus = np.hypot(p[:, 0] + q[:, 1], p[:, 1] - q[:, 0])
        minus = np.hypot(p[:, 0] - q[:, 1], p[:, 1] + q[:, 0])
        return 0.5 * np.stack([plus + minus, plus - minus], axis=1), 0.5 * length * height

    return of


def _until_settled(clock: Clock, step: Callable[[], FloatArray], own: Callable[[FloatArray], float]) -> None:
    before = math.inf
    while True:
        positions = step()
        clock.look(positions)
        paused = now()
        value = own(positions)
        clock._begun += now() - paused
        if abs(before - value) <= _OWN_CHANGE * value:
            return
        before = value


def arap(problem: Problem, start: FloatArray, clock: Clock) -> None:
    """Flatten as rigidly as possible (Liu et al. 2008) with libigl."""
    import igl

    data = igl.ARAPData()
    data.max_iter = 1
    pinned = np.zeros(1, dtype=np.int32)
    igl.arap_precomputation(problem.vertices, problem.triangles.astype(np.int64), 2, pinned, data)
    state = [start]

    def step() -> FloatArray:
        state[0] = np.ascontiguousarray(np.asarray(igl.arap_solve(start[:1], data, state[0]))[:, :2])
        return state[0]

    singular = _singular_values(problem)

    def own(positions: FloatArray) -> float:
        values, area = singular(positions)
        return float(area @ ((values - 1.0) ** 2).sum(axis=1))

    _until_settled(clock, step, own)


def slim(problem: Problem, start: FloatArray, clock: Clock) -> None:
    """Scalable locally injective mappings, symmetric Dirichlet energy (Rabinovich et al. 2017), libigl."""
    import igl

    fortran = {"order": "F"}
    data = igl.slim_precompute(
        np.array(problem.vertices, **fortran),
        np.array(problem.triangles, dtype=np.int32, **fortran),
        np.array(start, **fortran),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.zeros(0, dtype=np.int32),
        np.zeros((0, 2), **fortran),
        0.0,
    )
    singular = _singular_values(problem)

    def own(positions: FloatArray) -> float:
        values, area = singular(positions)
        squares = np.maximum(values**2, 1e-300)
        return float(area @ (squares + 1.0 / squares).sum(axis=1))

    _until_settled(clock, lambda: np.ascontiguousarray(np.asarray(igl.slim_solve(data, 1))[:, :2]), own)


def lbfgs(problem: Problem, start: FloatArray, clock: Clock) -> None:
    """SciPy's L-BFGS-B on the very energy, springs and guard; a mirrored cell counts as a very high energy."""
    energy, shape = problem.energy, start.shape
    scale = 1.0 / max(energy.value(start), 1e-300) if problem.mirrored(start) == 0 else 1.0

    def evaluate(x: FloatArray) -> tuple[float, FloatArray]:
        value, slope = energy.value_and_gradient(x.reshape(shape))
        return (scale * value, scale * slope.ravel()) if math.isfinite(value) else (1e6, np.zeros(x.size))

    options = {"maxiter": 100_000, "maxfun": 200_000, "ftol": 1e-12, "gtol": 1e-12, "maxcor": 20}
    minimize(
        evaluate,
        start.ravel(),
        jac=True,
        method="L-BFGS-B",
        options=options,
        callback=lambda x: clock.look(x.reshape(shape)) and None,
    )


def _factor_splu(matrix: sp.csc_matrix) -> Solve:
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return lambda right: factor.solve(right)


def _factor_igl(matrix: sp.csc_matrix) -> Solve:
    import igl

    data: Any = igl.min_quad_with_fixed_data()
    nothing = np.zeros(0, dtype=np.int64)
    igl.min_quad_with_fixed_precompute(matrix, nothing, sp.csc_matrix((0, matrix.shape[0])), True, data)
    none = np.zeros((0, 2))
    return lambda right: np.asarray(igl.min_quad_with_fixed_solve(data, np.ascontiguousarray(-right), none, none))


def _factor_cholespy(matrix: sp.csc_matrix) -> Solve:
    from cholespy import CholeskySolverD, MatrixType

    factor = CholeskySolverD(
        matrix.shape[0],
        matrix.indptr.astype(np.int32),
        matrix.indices.astype(np.int32),
        matrix.data,
        MatrixType.CSC,
    )

    def solve(right: FloatArray) -> FloatArray:
        found = np.zeros_like(right)
        factor.solve(np.ascontiguousarray(right), found)
        return found

    return solve


FACTORS: dict[str, Callable[[sp.csc_matrix], Solve]] = {
    "SuperLU": _factor_splu,
    "Eigen LLT": _factor_igl,
    "CHOLMOD": _factor_cholespy,
}


def fastest_factor(problem: Problem, solves: int = 12) -> str:
    """The factorisation that is done first with one factor and so many solves."""
    matrix = _pinned_laplacian(problem)
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 2))
    seconds: dict[str, float] = {}
    for name, factor in FACTORS.items():
        try:
            begun = now()
            solve = factor(matrix)
            for _ in range(solves):
                found = solve(right)
            seconds[name] = now() - begun
        except ImportError:
            continue
        if np.abs(matrix @ found - right).max() > 1e-6 * np.abs(right).max():
            raise RuntimeError(f"{name} does not solve the system")
    return min(seconds, key=lambda name: seconds[name])


def _pinned_laplacian(problem: Problem) -> sp.csc_matrix:
    return problem.energy.laplacian()[1:, 1:].tocsc()


def majorize_with(factor: str) -> Solver:
    """Majorization (SMACOF, de Leeuw 1977; the local and global steps of projective dynamics) of the springs alone."""

    def majorize(problem: Problem, start: FloatArray, clock: Clock) -> None:
        energy = problem.energy
        solve = FACTORS[factor](_pinned_laplacian(problem))
        positions = start - start[0]
        while True:
            # The pinned vertex stays at the origin, so its column adds nothing.
            positions = np.vstack([np.zeros((1, 2)), solve(energy.toward_rest(positions)[1:])])
            clock.look(positions)

    return majorize


def bff(problem: Problem, program: str) -> tuple[FloatArray, float]:
    """Flatten by boundary first flattening (Sawhney and Crane 2017): a program that is called as its `bff-command-line IN.obj OUT.obj`.

    Seconds are those of the program's process, reading and writing its files included.
    """
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "in.obj", Path(folder) / "out.obj"
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in problem.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (problem.triangles + 1).tolist()]
        given.write_text("\n".join(lines) + "\n")
        begun = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([program, str(given), str(made)], check=True, capture_output=True)
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        rows = [line.split() for line in made.read_text().splitlines()]
    places = np.array([row[1:3] for row in rows if row[:1] == ["vt"]], dtype=float)
    corners = (
        np.array([corner.split("/")[:2] for row in rows if row[:1] == ["f"] for corner in row[1:4]], dtype=int) - 1
    )
    layout = np.zeros((len(problem.vertices), 2))
    layout[corners[:, 0]] = places[corners[:, 1]]
    return as_cloth(problem, layout), ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime


# `bpy` as a module, in a Python of its own: it asks for another NumPy.
_BLENDER = """
import sys, time
import bpy
import numpy as np
given = np.load(sys.argv[1])
mesh = bpy.data.meshes.new("piece")
mesh.from_pydata(given["vertices"].tolist(), [], given["triangles"].tolist())
mesh.uv_layers.new(name="st")
made = bpy.data.objects.new("piece", mesh)
bpy.context.scene.collection.objects.link(made)
bpy.context.view_layer.objects.active = made
made.select_set(True)
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.select_all(action="SELECT")
begun = time.process_time()
bpy.ops.uv.unwrap(method="MINIMUM_STRETCH", iterations=int(sys.argv[3]), margin=0.0)
seconds = time.process_time() - begun
bpy.ops.object.mode_set(mode="OBJECT")
places = np.empty(2 * len(mesh.loops))
mesh.uv_layers["st"].data.foreach_get("uv", places)
corner = np.empty(len(mesh.loops), dtype=int)
mesh.loops.foreach_get("vertex_index", corner)
np.savez(sys.argv[2], places=places.reshape(-1, 2), corner=corner, seconds=seconds)
"""


def blender(problem: Problem, python: str, iterations: int = 50) -> tuple[FloatArray, float]:
    """Flatten by Blender's minimum stretch, its SLIM, in a Python that has `bpy`; seconds are those of the operator alone."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(given, vertices=problem.vertices, triangles=problem.triangles)
        command = [python, "-c", _BLENDER, str(given), str(made), str(iterations)]
        subprocess.run(command, check=True, capture_output=True)
        found = np.load(made)
        layout = np.zeros((len(problem.vertices), 2))
        layout[found["corner"]] = found["places"]
        if np.ptp(layout[found["corner"]] - found["places"]) > 0.0:
            raise RuntimeError("a vertex lies at several places: it was cut into islands")
        return as_cloth(problem, layout), float(found["seconds"])


def xatlas(problem: Problem) -> tuple[int, FloatArray, FloatArray, float]:
    """Flatten by xatlas, which cuts a piece into charts.

    Returns:
        The number of charts, lengths of the triangles' sides on the surface and in their chart, scaled to the surface's area
        (#T by 3 each), and seconds.
    """
    import xatlas as package

    atlas = package.Atlas()
    atlas.add_mesh(problem.vertices.astype(np.float32), problem.triangles.astype(np.uint32))
    begun = now()
    atlas.generate()
    seconds = now() - begun
    origin, triangles, places = atlas[0]
    area = np.abs(signed_cell_areas(triangles.astype(np.int32), places.astype(float))).sum()
    surface = problem.vertices[origin[triangles]]
    whole = 0.5 * np.linalg.norm(np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0]), axis=1).sum()
    flat = places[triangles].astype(float) * (whole / area) ** 0.5
    sides = [np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2) for corner in (surface, flat)]
    return atlas.chart_count, sides[0], sides[1], seconds
