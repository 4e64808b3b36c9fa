"""Single kernels of `warpflat.kernels` driven by hand, and a force of one's own beside the springs.

python scenes/kernels.py

First the energy and the forces of a dome's springs, each by one launch. Then a kernel that is written here: a force that pulls the
cloth towards a line. `warpflat.relaxation` takes the paper's steps under both until they balance.
"""

from __future__ import annotations

import numpy as np
import warp as wp
from warpflat.kernels.springs import compute_spring_energy

import warpflat

wp.set_module_options({"enable_backward": False})


@wp.kernel
def pull_to_line(place: wp.array(dtype=wp.vec2d), stiffness: wp.float64, force: wp.array(dtype=wp.vec2d)):
    """Set a force of one's own on each vertex [N]: a spring of a stiffness [N/m] to the line x = 0."""
    i = wp.tid()
    force[i] = wp.vec2d(-stiffness * place[i][0], wp.float64(0.0))


def main() -> None:
    """Print the energies of the springs, before, after, and under a force of one's own."""
    surface = warpflat.make_shape("dome", resolution=17)
    development = warpflat.develop(surface, surface.lines["centre"])
    network = warpflat.SpringNetwork.build(surface, warpflat.find_fabric("woven"), development.positions, device="cpu")
    count = network.vertex_count
    position = wp.array(development.positions, dtype=wp.vec2d, device="cpu")
    force = wp.empty_like(position)
    energy = wp.zeros(count, dtype=wp.float64, device="cpu")

    def describe() -> str:
        inputs = [position, network.springs, 0]
        wp.launch(compute_spring_energy, dim=count, inputs=inputs, outputs=[energy], device="cpu")
        across = position.numpy()[:, 0]
        return f"springs {1e3 * energy.numpy().sum():9.4f} mJ, {100.0 * (across.max() - across.min()):.2f} cm wide"

    print(f"development: {describe()}")
    for own in (0.0, 0.5):  # [N/m]

        def pull(layout: np.ndarray, stiffness: float = own) -> np.ndarray:
            position.assign(layout)
            inputs = [position, wp.float64(stiffness)]
            wp.launch(pull_to_line, dim=count, inputs=inputs, outputs=[force], device="cpu")
            return force.numpy()

        relaxed = warpflat.relaxation(surface, fabric="woven", datum="centre", force=pull, energy_every=50)
        *_, state = relaxed
        position.assign(state.positions)
        print(
            f"own force of {own:.2f} N/m: {describe()}, after {state.step} steps {'at rest' if state.converged else 'NOT at rest'}"
        )


if __name__ == "__main__":
    main()
