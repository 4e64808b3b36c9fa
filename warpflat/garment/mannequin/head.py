"""A head for what is worn on it: a mannequin ends at the middle of its neck, and a hood would fall."""

from __future__ import annotations

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.garment.mannequin.body_landmarks import LEVELS, model_places, near_level
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.profiles import convex_girth

__all__ = ["head_of"]

# The head of the body model begins below its chin, this high on the mean body, which is 1 m tall.
_CHIN = 0.868


def head_of(mannequin: Mannequin) -> tuple[FloatArray, IntArray] | None:
    """Return the convex hull of a head of a mannequin's girth, over its neck: vertices (#V by 3 [m]) and triangles (#T by 3).

    It is the mean head of the body model (`body_model.BodyModel`). Its crown is as high as the person is tall,
    or its widest place as high as the tape around a scan's head, and its nape is that of the neck. None if no head's girth is known.
    """
    from trimesh.convex import convex_hull

    girth = mannequin.extremity("head")
    if girth is None:
        return None
    mean, strips = model_places().mean, model_places().strips
    scale = girth / convex_girth(mean[near_level("head")[0]])
    head = scale * mean[strips["head"] & (mean[:, 1] > _CHIN)]
    tape = mannequin.measures.get("head")
    lift = mannequin.lengths["stature"] - head[:, 1].max() if tape is None else tape.height - scale * LEVELS["head"][0]
    # The top of the mannequin's neck, and the model's nape at that height.
    neck = mannequin.line("collar")
    nape = neck[neck[:, 2].argmin()]
    behind = mean[np.abs(scale * mean[:, 1] + lift - nape[1]) < 0.01 * scale, 2].min()
    vertices = head + np.array([0.0, lift, nape[2] - scale * behind])
    hull = convex_hull(vertices)
    return np.asarray(hull.vertices), hull.faces.astype(np.int32)
