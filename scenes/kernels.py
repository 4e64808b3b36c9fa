"""Single kernels of `warpflat.kernels` driven by hand, and a force of one's own beside the springs.

python scenes/kernels.py

First the energy and the forces of a dome's springs, each by one launch. Then a kernel that is written here: it adds a force that
pulls the cloth towards a line, with the package's own device functions for the springs, and takes implicit steps until it is at rest.
"""

from __future__ import annotations

import warp as wp
from warpflat.kernels.springs import Springs, compute_spring_energy, spring_force

import warpflat
from warpflat.flattening.develop import develop
from warpflat.model.network import SpringNetwork

wp.set_module_options({"enable_backward": False})


@wp.func
def pull_to_line(place: wp.vec2d, stiffness: wp.float64):
    """Return a force of one's own [N]: a spring to the line x = 0."""
    return wp.vec2d(-stiffness * place[0], wp.float64(0.0))


@wp.kernel
def step_with_own_force(
    position: wp.array(dtype=wp.vec2d),
    mass: wp.array(dtype=wp.float64),
    springs: Springs,
    own_stiffness: wp.float64,
    time_step: wp.float64,
    # outputs
    moved: wp.array(dtype=wp.vec2d),
    force: wp.array(dtype=wp.vec2d),
):
    """Step each vertex from rest by F h^2 / (m + h^2 K), the first term of the paper's eq. (9)."""
    i = wp.tid()
    here = position[i]
    total = pull_to_line(here, own_stiffness)
    stiffness = own_stiffness
    for s in range(springs.offset[i], springs.offset[i + 1]):
        total += spring_force(position[springs.neighbor[s]] - here, springs.rest_length[s], springs.stiffness[s])
        # Twice, so that neighbours that move towards each other do not pass.
        stiffness += wp.float64(2.0) * springs.stiffness[s]
    force[i] = total
    moved[i] = here + total * (time_step * time_step / (mass[i] + time_step * time_step * stiffness))


def main() -> None:
    """Print the energies of the springs, before, after, and under a force of one's own."""
    surface = warpflat.make_shape("dome", resolution=17)
    development = develop(surface, surface.lines["centre"])
    network = SpringNetwork.build(surface, warpflat.find_fabric("woven"), development.positions, device="cpu")
    count = network.vertex_count
    position = wp.array(development.positions, dtype=wp.vec2d, device="cpu")
    moved, force = wp.empty_like(position), wp.empty_like(position)
    energy = wp.zeros(count, dtype=wp.float64, device="cpu")

    def describe() -> str:
        inputs = [position, network.springs, 0]
        wp.launch(compute_spring_energy, dim=count, inputs=inputs, outputs=[energy], device="cpu")
        across = position.numpy()[:, 0]
        return f"springs {1e3 * energy.numpy().sum():9.4f} mJ, {100.0 * (across.max() - across.min()):.2f} cm wide"

    print(f"development: {describe()}")
    for own in (0.0, 0.5):  # [N/m]
        position.assign(development.positions)
        for _ in range(4000):
            inputs = [position, network.mass, network.springs, wp.float64(own), wp.float64(1.0)]
            wp.launch(step_with_own_force, dim=count, inputs=inputs, outputs=[moved, force], device="cpu")
            position, moved = moved, position
        print(f"own force of {own:.2f} N/m: {describe()}, residual {abs(force.numpy()).max():.1e} N")


if __name__ == "__main__":
    main()
