"""Lines that may be cut: they lead to where the cloth bulges, and those that are worth the same are told apart by place."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import seam_solids as solids

import warpflat
from warpflat.garment.seams import energy
from warpflat.garment.seams.anatomy import find_anatomy
from warpflat.garment.seams.find import cloth_of
from warpflat.garment.seams.lines import Offer, _tailored, first_of_equals, offers


def test_what_is_worth_the_same_keeps_its_place_and_rounding_changes_nothing() -> None:
    values = np.array([3.0, 5.01, 5.03, 0.2, 4.0])
    for seed in range(5):
        noise = 1.0 + 1e-4 * np.random.default_rng(seed).standard_normal(len(values))
        assert first_of_equals(values * noise).tolist() == [1, 2, 4, 0, 3]


@pytest.mark.parametrize("at", [0.07, 0.1])
def test_darts_lead_to_the_bulges_of_a_seat_from_its_borders_but_not_from_the_hem(
    at: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = solids.skirt(20, 56)
    vertices = plain.vertices.copy()
    for x in (at, -at):
        off = vertices - [x, 0.42, -0.12]
        vertices += 0.06 * np.exp(-(off**2).sum(axis=1) / 0.06**2)[:, None] * [0.0, 0.0, -1.0]
    seen = list[Offer]()

    def watched(*given: object, **options: object) -> list[Offer]:
        made = offers(*given, **options)  # type: ignore[arg-type]
        seen.extend(made)
        return made

    monkeypatch.setattr(energy, "offers", watched)
    skirt = warpflat.make_surface(vertices, plain.faces, name="skirt")
    no = ("yoke", "princess", "panel", "centre back")
    warpflat.find_seams(skirt, warpflat.SeamOptions(no=no, limit=0.001), fabric="woven")
    darts = [one for one in seen if one.line.name == "dart"]
    assert darts
    # The best leads to the bulge on one side, and stands for both.
    end, start = darts[0].line.end, darts[0].line.start
    assert end is not None
    assert start is not None
    assert abs(end[0]) == pytest.approx(at, abs=0.03)
    assert end[1] == pytest.approx(0.42, abs=0.03)
    assert all(one.line.start is not None and one.line.start[1] > 0.02 for one in darts)
    assert darts[0].length > 1.5 * np.linalg.norm(end - start)


@pytest.mark.parametrize(("name", "height"), [("yoke left", 0.3), ("yoke-tab", 0.45)])
def test_a_yoke_goes_on_from_a_seam_that_is_one_and_not_from_one_whose_name_begins_so(name: str, height: float) -> None:
    cloth = cloth_of(solids.skirt(17))
    cloth = cloth.with_labels(sleeve=np.full(len(cloth.faces), -1))
    edges = cloth.half_edges.edges
    level = edges[np.abs(cloth.vertices[edges, 1] - 0.3).max(axis=1) < 1e-6]
    cloth = cloth.with_seam(name, level.astype(np.int64))
    anatomy = find_anatomy(cloth)
    mesh = next(iter(cloth.without_seam(name).pieces()))
    piece: Any = SimpleNamespace(mesh=mesh, surface=mesh.as_surface())
    places = [int(np.abs(mesh.vertices[:, 1] - 0.45).argmin())]
    lines = {line.name: line for line in _tailored(cloth, piece, places, anatomy, warpflat.SeamOptions())}
    assert lines["yoke"].point[1] == pytest.approx(height)
