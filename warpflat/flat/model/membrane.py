"""The fabric as a membrane that is measured as worn (`warpflat.kernels.membrane`), and the matrix of its steps."""

from __future__ import annotations

from typing import Literal

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.text import format_count
from warpflat.flat.fabric.fabric import Curve, Fabric
from warpflat.flat.model.springs import fourfold_direction
from warpflat.flat.surface.mesh import Surface
from warpflat.kernels.membrane_cell import Cloth

__all__ = ["MODELS", "Model", "ModelChoice", "check_model", "choose_model", "corner_sums", "make_cloth", "step_matrix"]


Model = Literal["springs", "membrane"]
ModelChoice = Literal["auto", "springs", "membrane"]
MODELS: tuple[ModelChoice, ...] = ("auto", "springs", "membrane")

# What locked threads add to the shear stiffness, over that. With 10, a shirt, trousers and a bodice of denim, a weave and a knit are
# sheared to .9 to 1.3 times the limit at 95 % of their area, and their threads bear the rest. 5 and 20 differ little.
_LOCKING = 10.0
# Edges of quads count as threads where they run within this angle of the grain [degrees], on average, and are spread about that by less
# than what leaves so much of their mean of exp(4i a): 17 degrees.
_ALIGNED, _LEAST_COMMON = 7.5, 0.5


def check_model(model: str) -> None:
    """Raise InputError, with the nearest name, for an unknown model."""
    if model not in MODELS:
        raise InputError(f"model {model!r} is unknown: {nearest(str(model), MODELS)}")


def choose_model(
    choice: ModelChoice, surface: Surface, fabric: Fabric, positions: FloatArray, *, grain_angle: float = 0.0
) -> Model:
    """Return the model of a piece: springs on quads along the grain, where they are exact, and the membrane on all other meshes.

    Args:
        choice: "auto", or the model that is asked for.
        surface, fabric: the piece and its cloth; an isotropic one has no grain.
        positions: #V by 2, a layout, in which quads and grain are compared [m].
        grain_angle: of the warp against +y, degrees.

    Raises:
        InputError: an unknown model, or springs for a mesh on which they are another cloth.
    """
    check_model(choice)
    if choice == "membrane":
        return choice
    triangles = int(np.count_nonzero(~surface.is_quad))
    what = f"has {format_count(triangles, 'triangle')}"
    if not triangles:
        mean = 1.0 + 0.0j if fabric.is_isotropic else fourfold_direction(surface.faces, positions, grain_angle)
        off = abs(np.rad2deg(np.angle(mean))) / 4.0
        if off <= _ALIGNED and abs(mean) >= _LEAST_COMMON:
            return "springs"
        what = "has quads that turn away from the grain"
        if off > _ALIGNED:
            what = f"has its quads {off:.0f} degrees off the grain"
    if choice == "auto":
        return "membrane"
    raise InputError(
        f'piece {surface.name!r} {what}: model = "springs" needs quads along warp and weft; leave model out to measure it cell by cell'
    )


def plane_stress(fabric: Fabric) -> tuple[float, float, float]:
    """Return c_warp, c_weft, c_cross [N/m] of an orthotropic sheet: c_warp = K_warp / (1 - nu_12 nu_21)."""
    nu = fabric.poisson_ratio
    share = 1.0 / (1.0 - nu * nu * fabric.stiffness_weft / fabric.stiffness_warp)
    return fabric.stiffness_warp * share, fabric.stiffness_weft * share, nu * fabric.stiffness_weft * share


def make_cloth(
    fabric: Fabric,
    axes: tuple[FloatArray, FloatArray],
    device: wp.Device,
    *,
    curves: bool = True,
    linear: bool = False,
    held: FloatArray | None = None,
) -> Cloth:
    """Return the fabric as the membrane's kernels take it.

    Args:
        fabric: the cloth.
        axes: unit vectors of warp and weft in the plane.
        device: for its arrays.
        curves: use its J-shaped curves; otherwise its secant stiffnesses only.
        linear: plane stress alone, paper eq. (3), also under compression: no curves, no wrinkling, no locking.
        held: 3 #C, stiffness in the step's matrix at each cell's corners [N/m]; needed for forces only.
    """
    cloth = Cloth()
    cloth.warp, cloth.weft = wp.vec2d(*axes[0]), wp.vec2d(*axes[1])
    cloth.isotropic = int(fabric.is_isotropic)
    cloth.c_warp, cloth.c_weft, cloth.c_cross = plane_stress(fabric)
    cloth.shear = fabric.shear_stiffness
    cloth.k_warp, cloth.k_weft = fabric.stiffness_warp, fabric.stiffness_weft
    cloth.onset = float(np.sin(np.radians(fabric.shear_limit)))
    cloth.lock = 0.0 if linear or fabric.is_isotropic else _LOCKING * fabric.shear_stiffness
    cloth.compression = 1.0 if linear else fabric.compression_factor
    for direction in ("warp", "weft"):
        points: Curve = getattr(fabric, f"curve_{direction}") if curves and not linear else ()
        points = points or ((1.0, getattr(fabric, f"stiffness_{direction}")),)
        strain, tension = np.array([(0.0, 0.0), *points]).T
        setattr(cloth, f"strain_{direction}", wp.array(strain, dtype=wp.float64, device=device))
        setattr(cloth, f"tension_{direction}", wp.array(tension, dtype=wp.float64, device=device))
    cloth.held = wp.array(np.zeros(0) if held is None else held, dtype=wp.float64, device=device)
    return cloth


def step_matrix(
    fabric: Fabric,
    axes: tuple[FloatArray, FloatArray],
    corner: IntArray,
    edges: FloatArray,
    area: FloatArray,
    positions: FloatArray,
    stretch: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return k_ij [N/m] that bound the membrane's stiffness at small strain on any mesh.

    The energy of a small displacement u is at most that of a scalar Laplacian with the conductivities
    max(c_warp + c_cross, 2 G) along the warp and max(c_weft + c_cross, 2 G) along the weft; its weights are cotangents
    in that metric, and negative ones may be left out of a bound. On rectangles along the grain they are the structural
    springs'.

    Args:
        fabric: stiffnesses [N/m].
        axes: unit vectors of warp and weft in the plane.
        corner, edges, area: the cells, as `warpflat.flat.surface.cells.CellArrays` has them.
        positions: #V by 2, a layout that says how each cell lies in the plane [m].
        stretch: #C by 2, intended length worn over length flat along warp and weft.

    Returns:
        #C by 3, weights of the cell's edges 0-1, 1-2, 2-0, and #C by 3, their sums at its corners.
    """
    det = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    # Each cell keeps its shape on the body and has the rotation that it has in the layout.
    p = positions[corner]
    D = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=-1)
    safe = np.where(det > 0.0, det, 1.0)
    inverse = (
        np.stack(
            [
                np.stack([edges[:, 1, 1], -edges[:, 0, 1]], axis=-1),
                np.stack([-edges[:, 1, 0], edges[:, 0, 0]], axis=-1),
            ],
            axis=-2,
        )
        / safe[:, None, None]
    )
    turn = D @ inverse
    angle = np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1])
    # Rows of `inverse` are the gradients of the barycentric weights of corners 1 and 2 in the cell's own frame [1/m]; the cell turned
    # by `angle` is the cloth.
    c, s = np.cos(angle), np.sin(angle)
    gradients = np.stack([-(inverse[:, 0] + inverse[:, 1]), inverse[:, 0], inverse[:, 1]], axis=1)
    turned = np.stack(
        [
            c[:, None] * gradients[..., 0] - s[:, None] * gradients[..., 1],
            s[:, None] * gradients[..., 0] + c[:, None] * gradients[..., 1],
        ],
        axis=-1,
    )
    along = np.stack([turned @ axes[0], turned @ axes[1]], axis=-1) * stretch[:, None, :]
    c_warp, c_weft, c_cross = plane_stress(fabric)
    shear = 2.0 * fabric.shear_stiffness
    conductivity = np.array([max(c_warp + c_cross, shear), max(c_weft + c_cross, shear)])
    flat = np.where(det > 0.0, area / (stretch[:, 0] * stretch[:, 1]), 0.0)
    weights = np.stack(
        [np.maximum(-flat * ((along[:, i] * along[:, j]) @ conductivity), 0.0) for i, j in ((0, 1), (1, 2), (2, 0))],
        axis=1,
    )
    return weights, corner_sums(weights)


def corner_sums(weights: FloatArray) -> FloatArray:
    """Return the sums at the cells' corners of the weights along their edges 0-1, 1-2, 2-0, #C by 3."""
    return np.stack(
        [weights[:, 2] + weights[:, 0], weights[:, 0] + weights[:, 1], weights[:, 1] + weights[:, 2]], axis=1
    )
