"""A run as a script: one dome in two cloths, with the energy whenever it is looked at, and how each comes to rest.

python scenes/scripted.py
"""

from __future__ import annotations

import warpflat
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.surface.shapes import make_shape


class Watch:
    """A callback that prints a line for each look at the energy."""

    def __init__(self) -> None:
        """Nothing has been seen yet."""
        self.seen = -1.0

    def __call__(self, progress: Progress) -> None:
        """Called after every step; between two looks, steps apart, the energy is that of the last one."""
        if progress.model_energy_j != self.seen:
            print(
                f"  {progress.stage:8} {progress.work_units:5.1f} units of work model energy {1e3 * progress.model_energy_j:9.4f} mJ"
            )
            self.seen = progress.model_energy_j


surface = make_shape("dome", resolution=65)
for fabric in ("denim", "interlock"):
    print(fabric)
    pattern = warpflat.flatten(surface, fabric=fabric, datum="centre", callback=Watch())
    last = pattern.stages[-1]
    print(
        f"  at rest  {last.work_units:5.1f} units of work model energy {1e3 * last.model_energy_j:9.4f} mJ, residual {last.residual:.1e}"
    )
    print(f"  length error {100 * pattern.measures['length_error']:.2f} %, flips {pattern.flipped_faces}")
    warpflat.save_piece(pattern, f"out/scripted/{fabric}")
