"""The step matrix of a membrane, updated to its tangent stiffness in the present layout."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpflat.core.compile import launch_quietly
from warpflat.kernels.membrane import bound_membrane
from warpflat.model.membrane import corner_sums
from warpflat.model.network import SpringNetwork
from warpflat.model.springs import springs_along_cells

__all__ = ["TangentMatrix"]


class TangentMatrix:
    """The k_ij of a network whose model is the membrane.

    A network is built with the k_ij of a cloth at rest. A cell whose shape in the plane differs much from that on the
    body, such as a sliver that the development has opened, is much softer. With the stiffness at rest its corners would
    creep back for ten thousand steps.
    """

    def __init__(self, network: SpringNetwork) -> None:
        """Prepare updates of this network; nothing is changed before `update` is called."""
        self._network = network
        self._side = springs_along_cells(network.spring_arrays, network.cell_arrays)
        self._weight = wp.zeros(3 * network.cell_count, dtype=wp.float64, device=network.device)

    def update(self, position: wp.array) -> None:
        """Set the k_ij to a bound of the membrane's stiffness at positions (#V vec2d [m]) without mirrored cells."""
        network = self._network
        assert network.cloth is not None
        launch_quietly(
            bound_membrane,
            dim=network.face_count,
            inputs=[position, network.cells, network.cloth, 0],
            outputs=[self._weight],
            device=network.device,
        )
        weight = np.array(self._weight.numpy())
        stiffness = np.bincount(self._side, weight, minlength=network.spring_count).astype(np.float64)
        network.update_stiffness(stiffness)
        network.cloth.held.assign(corner_sums(weight.reshape(-1, 3)).ravel())
