"""The price of a cut without a trial, beside a dense solution of the cut mesh, and beside cuts that are made."""

from __future__ import annotations

import numpy as np
import pytest

import warpflat
from warpflat.flat.cutting.crack import ElasticCrack, LaidCloth
from warpflat.flat.cutting.cut_plan import CutPlan, carry_layout, make_cuts
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.metric import stiffness_matrix
from warpflat.garment.construction.sew_pieces import sew_pieces


def sheet(count: int, height: float, *, saddle: bool = False, fabric: str = "woven") -> Flattening:
    """A square of 40 cm of triangles, with a bulge or as a saddle, laid flat."""
    x, y = np.meshgrid(*2 * [np.linspace(-0.2, 0.2, count)], indexing="ij")
    bulge = height * np.exp(-(x**2 + y**2) / (2 * 0.08**2))
    z = height * (x**2 - y**2) / 0.2**2 if saddle else bulge
    place = np.arange(count**2).reshape(count, count)
    a, b, c, d = place[:-1, :-1].ravel(), place[1:, :-1].ravel(), place[1:, 1:].ravel(), place[:-1, 1:].ravel()
    # Diagonals to and fro, so that both sides are alike.
    to = ((np.arange(len(a)) // (count - 1) + np.arange(len(a))) % 2 == 0)[:, None]
    first = np.where(to, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(to, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    surface = warpflat.make_surface(vertices, np.concatenate([first, second]), name="sheet")
    return warpflat.flatten(surface, fabric=fabric, relax=warpflat.RelaxOptions(energy_left=1e-6, outline_left_mm=1e-3))


def straight(laid: LaidCloth, start: int, end: int) -> np.ndarray:
    way = laid.positions[end] - laid.positions[start]
    off = np.abs((laid.positions - laid.positions[start]) @ [way[1], -way[0]]) / np.linalg.norm(way)
    row = laid.row(start, end, off)
    assert row is not None
    return row


def forces(network: SpringNetwork, positions: np.ndarray) -> np.ndarray:
    """Forces by differences of the energy, #V by 2."""
    step = 1e-7
    found = np.zeros_like(positions)
    for index in np.ndindex(*positions.shape):
        there = [positions.copy(), positions.copy()]
        there[0][index] += step
        there[1][index] -= step
        ahead, back = (
            warpflat.flat.model.strain.worn_cell_strain(network, at, "membrane")[2].numpy().sum() for at in there
        )
        found[index] = (back - ahead) / (2.0 * step)
    return found


@pytest.mark.parametrize("end", ["inside", "border"])
def test_a_crack_is_priced_as_by_a_dense_solution_of_the_cut_mesh(end: str) -> None:
    result = sheet(9, 0.05)
    laid = LaidCloth(result.network, result.positions)
    row = straight(laid, 9 * 4, 9 * 4 + (5 if end == "inside" else 8))
    crack = ElasticCrack(laid, [row])
    parted = crack.part([(0, len(row) - 1)])
    # The same in the mesh whose vertices are doubled: sides parted, of equal length edge by edge.
    cut = make_cuts(result.surface, [CutPlan(name="cut", paths=(row.astype(np.int32),))])
    flat = carry_layout(result.positions, result.faces, cut.surface.faces, len(cut.surface.vertices))
    (seam,) = cut.cuts[0].seams
    network = SpringNetwork.build(cut.surface, result.fabric, flat, grain_angle=result.grain_angle, device="cpu")
    stiffness, force = stiffness_matrix(network, flat).toarray(), forces(network, flat).ravel()
    rows = []
    for k in range(len(seam.left) - 1):
        along = flat[seam.left[k + 1]] - flat[seam.left[k]]
        equal = np.zeros_like(flat)
        for side, sign in ((seam.left, 1.0), (seam.right, -1.0)):
            equal[side[k + 1]] += sign * along
            equal[side[k]] -= sign * along
        rows.append(equal.ravel())
    # Without it both sides lie on each other.
    closed = [*rows]
    for one, other in zip(seam.left, seam.right, strict=True):
        for axis in (0, 1):
            same = np.zeros_like(flat)
            same[one, axis] += 1.0
            same[other, axis] -= 1.0
            closed.append(same.ravel())

    def released(held: list[np.ndarray]) -> float:
        free = np.linalg.svd(np.array(held))
        ways = free.Vh[int((free.S > 1e-9).sum()) :].T
        moved = ways @ np.linalg.lstsq(ways.T @ stiffness @ ways, ways.T @ force, rcond=1e-9)[0]
        return 0.5 * float(force @ moved)

    assert parted.released == pytest.approx(released(rows) - released(closed), rel=1e-3)
    assert parted.released > 0.1 * result.stages[-1].strain_energy_j


def test_a_dart_into_a_bulge_releases_what_a_sewn_one_does_and_opens() -> None:
    result = sheet(25, 0.06)
    laid = LaidCloth(result.network, result.positions)
    for tip in (8, 12):
        row = straight(laid, 25 * 12, 25 * 12 + tip)
        crack = ElasticCrack(laid, [row])
        parted = crack.part([(0, len(crack.at[0]) - 1)])
        cut = warpflat.cut(result, CutPlan(name="dart", paths=(row.astype(np.int32),)))
        (sewn,) = sew_pieces([cut]).pieces.values()
        made = result.stages[-1].strain_energy_j - sewn.stages[-1].strain_energy_j
        assert parted.released == pytest.approx(made, rel=0.15)
        assert parted.openings[0][0] > 0.02
        assert parted.openings[0].min() > -1e-3
        # Opened half as far along, it releases less.
        half = crack.part([(0, len(crack.at[0]) // 2)])
        assert 0.0 < half.released < parted.released
        assert half.openings[0][len(crack.at[0]) // 2 :] == pytest.approx(0.0, abs=1e-9)


def test_a_dart_into_a_saddle_would_lie_over_itself() -> None:
    result = sheet(25, 0.03, saddle=True)
    laid = LaidCloth(result.network, result.positions)
    row = straight(laid, 25 * 12, 25 * 12 + 12)
    parted = ElasticCrack(laid, [row]).part([(0, 9)])
    assert parted.openings[0].min() < -5e-3


def test_cloth_that_a_cut_brings_back_within_its_limits_is_foretold() -> None:
    result = sheet(25, 0.12, fabric="isotropic")
    laid = LaidCloth(result.network, result.positions)
    row = straight(laid, 25 * 12, 25 * 12 + 12)
    crack = ElasticCrack(laid, [row])
    foretold = crack.relieved(crack.part([(0, 9)]))
    cut = warpflat.cut(result, CutPlan(name="dart", paths=(row.astype(np.int32),)))
    (sewn,) = sew_pieces([cut]).pieces.values()
    before, after = (one.fit.outside * float(one.fit.area.sum()) for one in (result, sewn))
    assert before - after > 0.01
    assert foretold == pytest.approx(before - after, rel=0.3)
