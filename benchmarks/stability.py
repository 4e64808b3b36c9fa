"""The paper's stability claim (its Fig. 4): steps and seconds to 0.1 % of the minimum for time steps from 1e-6 s to 1e4 s.

    python benchmarks/stability.py [--shape dome] [--resolution 33] [--shear 200] [--picture docs/stability.png]

Four integrators run on one network, on the CPU: the approximate implicit step with kinetic damping (what `warpflat` does)
and without it (the paper's), explicit Euler (with the same damping: without, it swings for ever), and implicit Euler
with the springs' whole matrix, solved by conjugate gradients. The last two are NumPy and SciPy and know no guard, so take
a case in which it does not act (the table says).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.flattening.develop import develop
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation, relax_by_steps
from warpflat.flat.surface.shapes import make_shape

FloatArray = NDArray[np.float64]

TIME_STEPS = [10.0**k for k in (-6, -5, -4, -3, -2, 0, 2, 4)]
TOLERANCE = 1e-3
DIVERGED = 10.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """One network, its first layout, and the least energy [J], by a relaxation to a far smaller residual."""

    network: SpringNetwork
    start: FloatArray
    least: float
    guard: float

    @classmethod
    def make(cls, shape: str, resolution: int, shear: float) -> Case:
        fabric = Fabric(
            name="cloth", stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=shear, areal_density=0.15
        )
        surface = make_shape(shape, resolution=resolution)
        start = develop(surface, surface.lines["centre"]).positions
        network = SpringNetwork.build(surface, fabric, start, device="cpu")
        options = RelaxOptions(residual_tolerance=1e-6, energy_tolerance=1e-10)
        energies = relax_by_steps(Relaxation(network, options, start=start)).energies
        return cls(network=network, start=start, least=energies.potential, guard=energies.guard)


# Each integrator yields potential and total energy [J] after every step.
Energies = Iterator[tuple[float, float]]


def approximate_implicit(case: Case, time_step: float, *, damped: bool) -> Energies:
    """`warpflat.flat.solver.steps`, step by step."""
    state = Relaxation(case.network, RelaxOptions(time_step=time_step, kinetic_damping=damped), start=case.start)
    while True:
        state.step()
        potential, mass = state.energies().potential, case.network.mass.numpy()
        yield potential, potential + 0.5 * float(mass @ (state.velocity.numpy() ** 2).sum(axis=1))


@dataclass(kw_only=True)
class SpringSystem:
    """The springs in NumPy: energy, forces, and the matrix of the implicit step."""

    case: Case

    def __post_init__(self) -> None:
        from scipy.sparse import csr_matrix

        s = self.case.network.spring_arrays
        self.k, self.rest, self.ends = s.stiffness, s.rest_length, s.ends
        self.mass = self.case.network.mass.numpy()[:, None]
        count, springs = len(self.case.start), len(s.ends)
        rows, ones = np.arange(springs), np.ones(springs)
        self.difference = csr_matrix((ones, (rows, s.ends[:, 1])), shape=(springs, count)) - csr_matrix(
            (ones, (rows, s.ends[:, 0])), shape=(springs, count)
        )

    def evaluate(self, position: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        """Energy [J], forces #V by 2 [N], directions #S by 2 and lengths #S [m]."""
        d = self.difference @ position
        length = np.sqrt(np.einsum("ij,ij->i", d, d))
        along = d / np.maximum(length, 1e-300)[:, None]
        stretch = length - self.rest
        energy = 0.5 * float(self.k @ stretch**2)
        return energy, -(self.difference.T @ ((self.k * stretch)[:, None] * along)), along, length

    def kinetic(self, velocity: FloatArray) -> float:
        return 0.5 * float((self.mass * velocity**2).sum())


def explicit_euler(case: Case, time_step: float) -> Energies:
    """v += h F / m, x += h v: the semi-implicit order, which is the more stable one; with kinetic damping."""
    system = SpringSystem(case=case)
    position, velocity = case.start.copy(), np.zeros_like(case.start)
    force = system.evaluate(position)[1]
    while True:
        if float((force * velocity).sum()) < 0.0:
            velocity[:] = 0.0
        velocity += time_step * force / system.mass
        position += time_step * velocity
        energy, force, _, _ = system.evaluate(position)
        yield energy, energy + system.kinetic(velocity)


def implicit_euler(case: Case, time_step: float) -> Energies:
    """(M + h^2 H) dv = h F - h^2 H v by conjugate gradients (Baraff and Witkin 1998).

    H is the springs' second derivative without the part of a compressed spring that is negative across it, so that the
    matrix is positive definite; its diagonal preconditions.
    """
    from scipy.sparse.linalg import LinearOperator, cg

    system = SpringSystem(case=case)
    position, velocity = case.start.copy(), np.zeros_like(case.start)
    shape = velocity.shape
    _, force, along, length = system.evaluate(position)
    squares = abs(system.difference).T
    while True:
        across = system.k * np.maximum(1.0 - system.rest / np.maximum(length, 1e-300), 0.0)
        pull = system.k - across

        def hessian(
            v: FloatArray, across: FloatArray = across, pull: FloatArray = pull, along: FloatArray = along
        ) -> FloatArray:
            d: FloatArray = system.difference @ v
            return system.difference.T @ (
                across[:, None] * d + (pull * np.einsum("ij,ij->i", along, d))[:, None] * along
            )

        diagonal = system.mass + time_step**2 * (squares @ (across[:, None] + pull[:, None] * along**2))
        size = position.size
        matrix = LinearOperator(
            (size, size),
            matvec=lambda v: (system.mass * v.reshape(shape) + time_step**2 * hessian(v.reshape(shape))).ravel(),
        )
        jacobi = LinearOperator((size, size), matvec=lambda v, d=diagonal: v / d.ravel())
        right = time_step * force - time_step**2 * hessian(velocity)
        change, _ = cg(matrix, right.ravel(), rtol=1e-4, maxiter=400, M=jacobi)
        velocity = velocity + change.reshape(shape)
        position = position + time_step * velocity
        energy, force, along, length = system.evaluate(position)
        yield energy, energy + system.kinetic(velocity)


INTEGRATORS: dict[str, Callable[[Case, float], Energies]] = {
    "approximate implicit, damped": lambda case, h: approximate_implicit(case, h, damped=True),
    "approximate implicit, plain": lambda case, h: approximate_implicit(case, h, damped=False),
    "explicit Euler, damped": explicit_euler,
    "implicit Euler, CG": implicit_euler,
}


@dataclass(frozen=True, kw_only=True)
class Run:
    """How a run went: `steps` and `seconds` until the energy was within 0.1 % of the least one and stayed there.

    `verdict` is "" where it got there, else "diverged", or how far above the minimum it still was.
    """

    steps: int
    seconds: float
    verdict: str
    highest: float
    potential: list[float]

    def __str__(self) -> str:
        return self.verdict or f"{self.steps:,} ({self.seconds:.2g} s)"


def measure(energies: Energies, case: Case, *, max_steps: int, max_seconds: float) -> Run:
    """Step until the energy has stayed within the tolerance for half as long again as it took to get there."""
    begun = time.perf_counter()
    first = SpringSystem(case=case).evaluate(case.start)[0]
    potential, reached, seconds, highest = [first], 0, 0.0, first
    for step, (now, total) in enumerate(energies, start=1):
        potential.append(now)
        highest = max(highest, total)
        elapsed = time.perf_counter() - begun
        if not np.isfinite(total) or total > DIVERGED * first:
            return Run(steps=step, seconds=elapsed, verdict="diverged", highest=np.inf, potential=potential)
        if abs(now / case.least - 1.0) > TOLERANCE:
            reached = 0
        elif reached == 0:
            reached, seconds = step, elapsed
        if reached and step >= 1.5 * reached + 20:
            break
        if step >= max_steps or elapsed > max_seconds:
            reached = reached if step >= 1.1 * reached else 0
            break
    verdict = "" if reached else f"{100 * (potential[-1] / case.least - 1):+.1f} % at {len(potential) - 1:,}"
    return Run(steps=reached, seconds=seconds, verdict=verdict, highest=highest / first, potential=potential)


def draw(runs: dict[tuple[str, float], Run], case: Case, title: str, path: Path) -> None:
    """Energy over steps for several h, one panel per integrator, as the paper's Fig. 4."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    shown = {1e-5: ("#c6a15b", 1.6), 1e-4: ("#d1495b", 1.6), 1e-3: ("#00798c", 4.0), 1e4: ("#111111", 1.2)}
    for axis, name in zip(axes, INTEGRATORS, strict=True):
        for h, (colour, width) in shown.items():
            run = runs[name, h]
            energy = 1e3 * np.minimum(np.array(run.potential), 4 * run.potential[0])
            axis.plot(np.arange(len(energy)), energy, color=colour, linewidth=width, label=f"h = {h:g} s")
        lost = [h for h in TIME_STEPS if runs[name, h].verdict == "diverged"]
        if lost:
            axis.text(0.97, 0.9, f"diverges from h = {min(lost):g} s on", transform=axis.transAxes, ha="right")
        axis.axhline(1e3 * case.least, color="0.5", linewidth=0.8, linestyle=":", label="minimum")
        axis.set_title(name, fontsize=10, loc="left")
        axis.set_xscale("symlog", linthresh=1.0)
        axis.set_yscale("log")
        axis.set_xlim(0, 3000)
        axis.set_ylim(0.8e3 * case.least, 2e3 * runs[next(iter(INTEGRATORS)), 1e4].potential[0])
        axis.grid(color="0.92", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)
    for axis in axes[2:]:
        axis.set_xlabel("steps")
    for axis in axes[::2]:
        axis.set_ylabel("energy of the springs [mJ]")
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print the table, and draw it if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shape", default="dome")
    parser.add_argument("--resolution", type=int, default=33)
    parser.add_argument("--shear", type=float, default=200.0, help="G [N/m], with K = 1000 N/m")
    parser.add_argument("--max-steps", type=int, default=20_000)
    parser.add_argument("--max-seconds", type=float, default=6.0, help="per run")
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    case = Case.make(arguments.shape, arguments.resolution, arguments.shear)
    title = (
        f"{arguments.shape}, {arguments.resolution} x {arguments.resolution} vertices, K = 1000 N/m, "
        f"G = {arguments.shear:g} N/m, 0.15 kg/m2"
    )
    first = SpringSystem(case=case).evaluate(case.start)[0]
    print(f"{title}: {1e3 * first:.4g} mJ at the start, {1e3 * case.least:.5g} mJ at the minimum", end=" ")
    print(f"(of which the guard {1e3 * case.guard:.3g} mJ)\n\nsteps (seconds) to 0.1 % of the minimum\n")
    print("| h [s] | " + " | ".join(INTEGRATORS) + " |")
    print("|---|" + "---|" * len(INTEGRATORS))
    runs: dict[tuple[str, float], Run] = {}
    for h in TIME_STEPS:
        for name, integrate in INTEGRATORS.items():
            with np.errstate(all="ignore"):
                runs[name, h] = measure(
                    integrate(case, h), case, max_steps=arguments.max_steps, max_seconds=arguments.max_seconds
                )
        print(f"| {h:g} | " + " | ".join(str(runs[name, h]) for name in INTEGRATORS) + " |", flush=True)
    for name in list(INTEGRATORS)[:2]:
        highest = max(runs[name, h].highest for h in TIME_STEPS)
        print(f"\n{name}: total energy at most {highest:.3f} times that of the start", end="")
    print()
    if arguments.picture is not None:
        draw(runs, case, title, arguments.picture)


if __name__ == "__main__":
    main()
