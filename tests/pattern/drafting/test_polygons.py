"""Areas that are cut off pieces."""

from __future__ import annotations

import numpy as np
import shapely

from warpflat.pattern.drafting.polygons import parallelogram


def test_a_parallelogram_reaches_along_one_way_and_in_depth_along_another() -> None:
    along, side = np.array([0.6, 0.8]), np.array([0.0, 1.0])
    found = parallelogram(np.array([1.0, 2.0]), along, (-1.0, 3.0), side, (0.0, 2.0))
    corners = [(0.4, 1.2), (2.8, 4.4), (2.8, 6.4), (0.4, 3.2)]
    assert found.symmetric_difference(shapely.Polygon(corners)).area < 1e-12
