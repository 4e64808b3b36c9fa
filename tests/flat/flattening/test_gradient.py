"""Derivatives of relaxed patterns against finite differences of their minima."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from surface_meshes import quads_between

import warpflat
from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.flattening.gradient import _with_vertices, gradient
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.springs import SpringArrays

STEP = 1e-5


def patch(*, triangles: bool) -> warpflat.Surface:
    """A saddle of 81 vertices that is not symmetric, with its middle column as the line "middle"."""
    n = 9
    u, v = np.meshgrid(np.linspace(-0.1, 0.1, n), np.linspace(-0.12, 0.12, n))
    vertices = np.stack([u, v, 3.0 * u * v + 2.0 * u**2 + 1.5 * v**2 + 8.0 * u * v * v], axis=-1).reshape(-1, 3)
    at = np.arange(n * n).reshape(n, n)
    quads = quads_between(at)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if triangles else quads
    return warpflat.make_surface(vertices, faces, lines={"middle": at[:, n // 2], "side": at[:, 0]}, name="patch")


def difference(pattern: Flattening, of: str, network: Callable[[float], SpringNetwork]) -> float:
    """The central difference of a scalar over the minima of changed networks."""
    ends = [gradient(replace(pattern, network=network(step)), of).value for step in (STEP, -STEP)]
    return (ends[0] - ends[1]) / (2.0 * STEP)


def changed(
    springs: SpringArrays, *, length: FloatArray | None = None, stiffness: FloatArray | None = None
) -> SpringArrays:
    return SpringArrays(
        around=springs.around,
        listed_length=springs.listed_length if length is None else springs.listed(length),
        listed_stiffness=springs.listed_stiffness if stiffness is None else springs.listed(stiffness),
        edge_count=springs.edge_count,
        shear_deficit=springs.shear_deficit,
        hourglass=springs.hourglass,
    )


@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
def test_derivatives_are_those_of_finite_differences(fabric: str):
    surface = patch(triangles=False)
    pattern = warpflat.flatten(surface, datum="middle", fabric=fabric)
    found, rng = gradient(pattern, "side"), np.random.default_rng(1)
    springs = found.network.spring_arrays
    longer = springs.rest_length * rng.standard_normal(springs.count)
    stiffer = springs.stiffness * rng.standard_normal(springs.count)
    moved = 0.01 * rng.standard_normal(surface.vertices.shape)

    def with_springs(arrays: SpringArrays) -> SpringNetwork:
        return replace(found.network, spring_arrays=arrays)

    for exact, network in (
        (
            found.rest_lengths @ longer,
            lambda h: with_springs(changed(springs, length=springs.rest_length + h * longer)),
        ),
        (
            found.stiffness @ stiffer,
            lambda h: with_springs(changed(springs, stiffness=springs.stiffness + h * stiffer)),
        ),
        (
            np.sum(found.vertices * moved),
            lambda h: _with_vertices(found.network, surface.vertices + h * moved, found.positions),
        ),
    ):
        assert exact == pytest.approx(difference(pattern, "side", network), rel=1e-5)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
def test_a_moved_surface_flattened_anew_has_the_length_that_the_derivative_foretells(fabric: str, triangles: bool):
    surface, options = patch(triangles=triangles), {"datum": "middle", "fabric": fabric}
    found = gradient(warpflat.flatten(surface, **options), "side")
    moved = 0.01 * np.random.default_rng(3).standard_normal(surface.vertices.shape)
    ends = []
    for step in (STEP, -STEP):
        there = warpflat.make_surface(surface.vertices + step * moved, surface.faces, lines=dict(surface.lines))
        ends.append(gradient(warpflat.flatten(there, **options), "side").value)
    assert np.sum(found.vertices * moved) == pytest.approx((ends[0] - ends[1]) / (2.0 * STEP), rel=1e-5)


def test_a_membrane_and_a_cut_piece_have_derivatives_by_their_vertices():
    surface, rng = patch(triangles=True), np.random.default_rng(2)
    pattern = warpflat.flatten(surface, datum="middle", fabric="woven")
    pattern = warpflat.cut(pattern, warpflat.CutPlan(name="dart", paths=(np.array([36, 37, 38], dtype=np.int32),)))
    found = gradient(pattern, "area")
    moved = 0.01 * rng.standard_normal(surface.vertices.shape)
    each = moved[pattern.vertex_origin]
    base = found.network.surface.vertices
    expected = difference(pattern, "area", lambda h: _with_vertices(found.network, base + h * each, found.positions))
    assert np.sum(found.vertices * moved) == pytest.approx(expected, rel=1e-5)
    with pytest.raises(InputError, match="has no springs"):
        _ = found.rest_lengths


def test_a_scalar_may_be_a_function():
    pattern = warpflat.flatten(patch(triangles=False), datum="middle")
    line = pattern.surface.lines["side"]

    def width(positions: FloatArray) -> tuple[float, FloatArray]:
        slope = np.zeros_like(positions)
        slope[8, 0], slope[0, 0] = 1.0, -1.0
        return float(positions[8, 0] - positions[0, 0]), slope

    found = gradient(pattern, width)
    assert found.value == pytest.approx(pattern.positions[8, 0] - pattern.positions[0, 0], rel=1e-3)
    # All lengths grow alike: so does the width.
    assert found.rest_lengths @ found.network.spring_arrays.rest_length == pytest.approx(found.value, rel=0.02)
    assert gradient(pattern, line.tolist()).value == pytest.approx(gradient(pattern, "side").value)
    with pytest.raises(InputError, match="unknown line 'sidee'"):
        gradient(pattern, "sidee")
