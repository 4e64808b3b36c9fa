from __future__ import annotations

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

from warpflat.pattern.drafting.tile_nesting import nest_on_tiles

STRIP, SHEET = shapely.box(0, 0, 7.0, 0.2), shapely.box(0, 0, 1.2, 1.2)


@pytest.mark.parametrize("shapes", [[STRIP], [STRIP, STRIP], [STRIP, SHEET]])
def test_shapes_of_many_tiles_find_room(shapes: list[shapely.Polygon]):
    places, size = nest_on_tiles(shapes, step=np.array([0.18, 0.26]), overlap=0.01, gap=0.004)
    assert len(places) == len(shapes)
    laid = []
    for shape, place in zip(shapes, places, strict=True):
        turned = rotate(shape, 90.0 * place.quarters, origin=(0, 0))
        low = turned.bounds[:2]
        laid.append(translate(turned, place.corner[0] - low[0], place.corner[1] - low[1]))
    assert shapely.unary_union(laid).area == pytest.approx(sum(shape.area for shape in shapes))
    assert shapely.box(0, 0, *size).buffer(1e-9).contains(shapely.unary_union(laid))
