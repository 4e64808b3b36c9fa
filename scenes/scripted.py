"""A run as a script: one dome in two cloths, with a look at every hundredth step.

python scenes/scripted.py
"""

from __future__ import annotations

import warpflat
from warpflat.flattening import Progress
from warpflat.shapes import make_shape


def watch(progress: Progress) -> None:
    """Called after every step."""
    if progress.step % 100 == 0:
        print(f"  step {progress.step:5d}: {progress.spring_energy * 1e3:9.4f} mJ, residual {progress.residual:.1e}")


surface = make_shape("dome", resolution=33)
for fabric in ("denim", "interlock"):
    print(fabric)
    pattern = warpflat.flatten(surface, fabric=fabric, datum="centre", callback=watch)
    print(f"  length error {100 * pattern.measures['length_error']:.2f} %, flips {pattern.flipped_faces}")
    pattern.save(f"out/scripted/{fabric}")
