"""Darts at bent elbows, without which a woven sleeve does not go around them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpflat.core import FloatArray
from warpflat.garment.mannequin.darts import FormDart
from warpflat.garment.mannequin.layout import Layout

__all__ = ["ELBOW", "elbow_darts"]

#: An arm whose elbow bends by more [degrees] shapes its sleeve; those of the tables bend by 5 to 7.
_BENT = 12.0
#: The line of the elbow's dart.
ELBOW = "elbow left"
#: Where on the girth of the elbow its dart ends, from the underarm over the front: before the point of the elbow, at 0.75.
_ELBOW_TIP = 0.77


def elbow_darts(layout: Layout, bricks: Mapping[str, Sequence[str]], vertices: FloatArray) -> tuple[FormDart, ...]:
    """Return the darts of sleeves that go past the elbow of an arm that is bent, from the back of the underarm seam.

    Args:
        layout: the grid.
        bricks: by piece, both sides of the body.
        vertices: the body's, #V by 3 [m].
    """
    rows, bends = [layout.arm_row[level] for level in ("biceps", "elbow", "wrist")], list[float]()
    for arm in layout.arms.values():
        upper, lower = np.diff(vertices[arm[rows]].mean(axis=1), axis=0)
        cosine = upper @ lower / (np.linalg.norm(upper) * np.linalg.norm(lower))
        # The angle between upper arm and forearm; 0 is straight.
        bends.append(float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))
    # Both sleeves are cut alike.
    if max(bends) <= _BENT:
        return ()
    around = {"biceps-elbow/arm-left-back", "elbow-forearm/arm-left-back"}
    sleeves = [piece for piece, chosen in bricks.items() if around <= set(chosen)]
    return tuple(FormDart(name="elbow dart", piece=s, line=ELBOW, part=(1.0, _ELBOW_TIP)) for s in sleeves)
