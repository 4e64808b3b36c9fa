"""A scan's body as it stands: the model laid on the scan, and its pose undone.

The fitted model, subdivided once, moves along its normals onto the scan; where the scan shows nothing, the move of its neighbours is
carried on smoothly. So each scan becomes one closed mesh whose vertices are the same places on every body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core import BoolArray, FloatArray
from warpflat.flat import mesh_edges, vertex_normals
from warpflat.garment.mannequin.body_landmarks import LEVELS, crotch_vertex, meeting, model_places, near_level, value_at
from warpflat.garment.mannequin.body_model import BodyModel, Person, finer_body, rotation, rotation_vector
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.fit_body import FittedBody, fit_body
from warpflat.garment.mannequin.sampled import neighbour_mean, smooth

__all__ = ["StandingBody", "lay_on_scan", "stand_body"]

# Moves onto the scan: how stiff the move is, and how far a place may lie [m].
_STAGES = ((0.5, 0.03), (0.1, 0.025), (0.02, 0.02), (0.004, 0.02), (0.004, 0.02))
# The last move, which is not smooth, is no longer than this [m].
_LAST = 0.002
# A triangle of the scan so near to the body [m] is of the body.
_ON = 0.008
# How much the model counts where the scan shows nothing.
_HOME = 0.02
# Where arms join the trunk a place may lie so much less far, as a share.
_WEB = 0.7
# Head, hands and feet have few vertices, which follow the scan's lips, fingers and toes not so closely: so much stiffer.
_DETAIL = 30.0
# Where arms are raised from plumb by more than this, or a joint is bent by more, no tape is laid, and nothing is sewn [rad].
_RAISED, _FAR_BENT = np.radians(70.0), np.radians(40.0)
# Then a standing body's joints are bent by no more than this [rad].
_BENT = np.radians(8.0)
# Elbows that are bent by more than this are straightened to it [rad]: a sleeve is cut for an arm that hangs.
_ELBOW = np.radians(10.0)
# Legs within this slope of the plumb line stand together [m per m]. Legs moved together stay so far off the midplane [m]. Below the
# first of these heights on the mean body they do not join; above the second one, the hip's, nothing moves.
_TOGETHER, _BETWEEN, _CROTCH, _HIP = 0.01, 0.001, 0.462, 0.505
# Height of the hip joints as a share of the stature (Drillis and Contini 1966).
_HIP_JOINT = 0.530
# A fit is no good beyond a mean distance [m]; if less than a share of the scan lies beside it [m]; or if the scan shows less than a
# share of a limb, or of a band [m] of the trunk with more than a few vertices.
_FAR, _BESIDE, _FLOOR, _SHARED, _SEEN, _BAND, _FEW = 0.012, 0.08, 0.05, 0.7, 0.5, 0.02, 12
_PARTS = {
    "neck01": "its head: the head is missing",
    "spine03": "the chest", "pelvis": "the pelvis", "clavicle": "two shoulders", "upperarm01": "two upper arms",
    "upperleg01": "two thighs", "lowerleg01": "two calves",
}  # fmt: skip
# A place is a guess where the body model lies farther off the scan [m] in the mean, or the scan shows less than a share of it.
_OFF, _SHOWN = 0.015, 0.75
# Surfaces face the same way where their normals' product is larger than this.
_ALIKE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingBody:
    """A scan's body on the scan, and as its mannequin stands, its lowest point at y = 0.

    Attributes:
        posed: #V by 3 [m], vertices of the finer body model on the scan.
        vertices: #V by 3 [m], as the mannequin stands; `posed` itself where the scan stands so.
        seen: #V, whether the scan shows the body there.
        armpits: by side, the vertex at which an arm joins the trunk.
        crotch: the lowest vertex between the legs in the midplane.
        shown: by triangle of the scan, the body's that it shows; -1 for hair, clothes and a floor.
        fit: of the model.
        unsure: why the scan is no such body; None if it is.
        doubtful: whether it is none, or hides the crotch, as one that is taken for facing backward does.
        together: #V by 3 [m], `vertices` with the hip's flesh moved with the legs, as a tape with the legs together asks; None where they
            stand so.
        undone: whether arms or joints were bent so far that their pose is undone.
        raised: how far the more raised arm is from hanging plumb [rad].
        notes: on the pose, one sentence each.
        turned: whether the scan faces -Z.
    """

    posed: FloatArray
    vertices: FloatArray
    seen: BoolArray
    armpits: Mapping[str, int]
    crotch: int
    shown: NDArray[np.int64]
    fit: FittedBody
    unsure: str | None
    doubtful: bool = False
    together: FloatArray | None = None
    undone: bool = False
    raised: float = 0.0
    notes: tuple[str, ...] = ()
    turned: bool = False

    @property
    def moved(self) -> bool:
        """Whether the mannequin stands otherwise than the scan."""
        return self.vertices is not self.posed

    def shows(self, rows: NDArray[np.int64]) -> bool:
        """Return whether the scan shows the most of some vertices."""
        return bool(self.seen[rows].mean() > 0.5)

    def unsure_near(self, rows: NDArray[np.int64]) -> str | None:
        """Return why a place amid some vertices is a guess: the scan shows too few of them, or the model lies far off; None if neither."""
        if self.seen[rows].mean() < _SHOWN:
            return "the scan does not show the body there"
        distance = self.fit.distance[rows[rows < len(self.fit.distance)]]
        mean = float(np.mean(np.minimum(distance, 2.0 * _OFF))) if len(distance) else 0.0
        return f"the body model lies {1000.0 * mean:.0f} mm off the scan there" if mean > _OFF else None

    def carried(self, name: str, height: float) -> float:
        """Return the height [m] at which a landmark at a height of the scan lies on the mannequin."""
        if name in LEVELS:
            rows = np.concatenate([near_level(name, side)[0] for side in ("left", "right")])
        else:
            rows = np.flatnonzero(model_places().strips["trunk"])
            rows = rows[np.argsort(np.abs(self.posed[rows, 1] - height))[:60]]
        return height + float(np.mean(self.vertices[rows, 1] - self.posed[rows, 1]))

    def stood(self, points: FloatArray) -> FloatArray:
        """Return points on or near the scan (#P by 3 [m]) as they lie on the mannequin."""
        face, weight, _ = Mesh(self.posed, finer_body()[1]).closest(points)
        return points + np.einsum("pk,pka->pa", weight, (self.vertices - self.posed)[finer_body()[1][face]])


@lru_cache(maxsize=1)
def _bending() -> csr_array:
    """Return the matrix of the squared second differences over the finer body's edges."""
    from scipy.sparse import diags_array

    matrix, triangles = finer_body()
    even = diags_array(np.ones(matrix.shape[0])) - neighbour_mean(mesh_edges(triangles), matrix.shape[0])
    stiff = np.where(matrix @ BodyModel.load().detail > 0.5, _DETAIL, 1.0)
    return (even.T @ diags_array(stiff) @ even).tocsr()


def lay_on_scan(start: FloatArray, mesh: Mesh) -> tuple[FloatArray, BoolArray]:
    """Return the finer body's vertices moved from `start` onto a scan (#V by 3 [m]), and which of them the scan shows.

    Args:
        start: #V by 3 [m].
        mesh: the scan.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import cg

    finer, triangles = finer_body()
    bending, points, seen = _bending(), start, np.zeros(len(start), dtype=bool)
    model = BodyModel.load()
    arms, near = (finer @ model.share_of(*names) for names in (("upperarm01",), ("spine03", "clavicle")))
    # Scanners and cloth span webs between arms and trunk.
    nearer = 1.0 - _WEB * np.minimum(1.0, 4.0 * arms * near)
    for stiffness, far_at_most in _STAGES:
        reach = far_at_most * nearer
        normals = vertex_normals(points, triangles)
        found, share, place = mesh.closest(points)
        away = place - points
        far = np.linalg.norm(away, axis=1)
        along = np.einsum("va,va->v", away, normals)
        alike = np.einsum("va,va->v", normals, mesh.normals_at(found, share)) > _ALIKE
        # Beside the border of a hole the nearest place does not lie along the normal.
        seen = alike & (far < reach) & (np.abs(along) > 0.8 * far - 0.002)
        # What the scan does not show goes back to the model.
        along = np.where(seen, along, np.einsum("va,va->v", start - points, normals))
        weight = np.where(seen, 1.0 / (1.0 + (far / reach) ** 2) ** 2, _HOME)
        # Diagonal preconditioning suffices. A move that is known to a tenth of a millimetre costs half as much, and hangs on rounding.
        system = (diags_array(weight) + stiffness * bending).tocsr()
        inverse = diags_array(1.0 / system.diagonal())
        points = points + cg(system, weight * along, rtol=1e-9, M=inverse)[0][:, None] * normals
    # Tapes are laid on the scan itself.
    found, _, place = mesh.closest(points)
    near = seen & (np.linalg.norm(place - points, axis=1) < _LAST)
    points[near] = place[near]
    return points, seen


def stand_body(
    vertices: FloatArray,
    triangles: NDArray[np.int64],
    *,
    faces_ahead: bool = False,
    as_scanned: bool = False,
    sits: bool = False,
    landmarks: Mapping[str, float] | None = None,
) -> StandingBody:
    """Fit the model to an upright scan, lay it on the scan, and undo its pose where no tape is laid in it.

    Args:
        vertices: #V by 3 [m].
        triangles: #T by 3, their normals outward.
        faces_ahead: whether the scan faces +Z for sure; else one that is no body so is tried facing -Z.
        as_scanned: whether the mannequin keeps the scan's pose.
        sits: whether the scan does.
        landmarks: known heights [m], which the fit follows.
    """
    found = _stand(fit_body(vertices, triangles, landmarks, sits=sits), vertices, triangles, as_scanned)
    if found.doubtful and not faces_ahead and not sits:
        vertices = vertices * [-1.0, 1.0, -1.0]
        fit = fit_body(vertices, triangles, landmarks)
        if fit.cost < found.fit.cost:
            turned = _stand(fit, vertices, triangles, as_scanned)
            if turned.unsure is None:
                return replace(turned, turned=True)
    return found


def _arms_hanging(model: BodyModel, person: Person) -> tuple[Person, float]:
    """Return the person with elbows that are bent hanging nearly straight, and by how much the more bent one was bent [rad]."""
    rest, bend, most = model.shaped(person.shape), person.bend.copy(), 0.0
    joints = rest[model.count :]
    for side in "LR":
        shoulder, elbow = (model.joints.index(f"{name}.{side}") for name in ("upperarm01", "lowerarm01"))
        # Hands hang from the elbow, too.
        forearm = (model.weights[:, elbow] > 0.9) & ~model.detail
        upper = joints[elbow] - joints[shoulder]
        lower = bend[elbow] @ (rest[: model.count][forearm].mean(axis=0) - joints[elbow])
        about = np.cross(lower, upper)
        size = float(np.linalg.norm(about))
        angle = float(np.arctan2(size, lower @ upper))
        most = max(most, angle)
        bend[elbow] = rotation(max(angle - _ELBOW, 0.0) / max(size, 1e-12) * about[None])[0] @ bend[elbow]
    return replace(person, bend=bend), most


def _stand(fit: FittedBody, vertices: FloatArray, triangles: NDArray[np.int64], as_scanned: bool) -> StandingBody:
    model, (finer, faces), places = BodyModel.load(), finer_body(), model_places()
    mesh = Mesh(vertices, triangles)
    posed, seen = lay_on_scan(finer @ model.vertices(fit.person), mesh)
    # A triangle of the scan shows the body's nearest one, if it lies on it and faces the same way.
    on = Mesh(posed, faces)
    middles = vertices[triangles].mean(axis=1)
    shown, share, place = on.closest(middles)
    beside = (np.linalg.norm(place - middles, axis=1) < _ON) & (
        np.einsum("ta,ta->t", on.normals_at(shown, share), mesh.normals) > _ALIKE
    )
    shown = np.where(beside, shown, -1)
    relaxed, _ = _arms_hanging(model, fit.person.standing(_BENT))
    hanging, elbows = _arms_hanging(model, fit.person)
    standing = model.rebend(fit.person, relaxed, finer, posed)
    unsure, doubtful = _unsure(fit, mesh, model.vertices(fit.person), standing, finer @ model.weights, seen)
    armpits = {side: meeting(standing, places.mean, sign) for side, sign in (("left", 1.0), ("right", -1.0))}
    notes = []
    # Sleeves hang, and a tape is laid, with arms lowered and no joint bent far.
    joints = model.joints_of(fit.person)
    ends = [(model.joints.index(f"upperarm01.{side}"), model.joints.index(f"lowerarm01.{side}")) for side in "LR"]
    upper = [joints[elbow] - joints[shoulder] for shoulder, elbow in ends]
    raised = max(float(np.arccos(np.clip(-way[1] / np.linalg.norm(way), -1.0, 1.0))) for way in upper)
    bends = np.linalg.norm(rotation_vector(fit.person.bend), axis=1)
    bent = [
        name
        for name, bend in zip(model.joints, bends, strict=True)
        if bend > _FAR_BENT and not name.startswith("upperarm")
    ]
    other, stands, together = fit.person, posed, None
    if as_scanned:
        notes.append("the mannequin keeps the scan's pose")
    elif raised > _RAISED or bent:
        other, stands = relaxed, standing - [float(fit.person.place[0]), standing[seen, 1].min(), 0.0]
        why = (
            f"its arms are raised by {np.degrees(raised):.0f} degrees"
            if raised > _RAISED
            else f"bent: {', '.join(bent)}"
        )
        notes.append(f"the mannequin is that of the body standing, arms lowered and joints straight ({why})")
    elif elbows > _ELBOW:
        other, stands = hanging, model.rebend(fit.person, hanging, finer, posed)
        notes.append(f"its elbows, bent by {np.degrees(elbows):.0f} degrees, hang nearly straight")
    # A tape around both legs of a scan measures how far apart the feet stand.
    apart = _legs_apart(stands)
    if apart >= _TOGETHER and not as_scanned:
        joint, size = (
            model.joints_of(other)[[model.joints.index(f"upperleg01.{side}") for side in "LR"], 0],
            np.ptp(stands[:, 1]),
        )
        half = 0.5 * abs(joint[0] - joint[1])
        hip = float(value_at(near_level("hip"), stands[:, 1]))
        before, stands, together = stands, stands.copy(), stands.copy()
        bins = np.linspace(0.0, _CROTCH, 46)
        for side, sign in (("left", 1.0), ("right", -1.0)):
            x, y = sign * before[:, 0], before[:, 1]
            # Level moves only, so that every height stays, and never farther than there is room.
            which = np.digitize(places.mean[:, 1], bins)
            bands = [places.strips[f"leg {side}"] & (which == band) for band in range(1, len(bins))]
            heights = np.array([y[band].mean() for band in bands])
            room = np.array([x[band].min() for band in bands]) - _BETWEEN
            inwards = smooth(np.minimum(apart * (hip - heights), room), 1.0)
            inwards = np.minimum(inwards, room)
            # From the crotch up flesh follows less and less, and in proportion to its distance from the midplane.
            rows = (places.mean[:, 1] < 0.56) & (sign * places.mean[:, 0] > 0.0) & ~places.strips[f"arm {side}"]
            rise = np.clip((places.mean[:, 1] - _CROTCH) / (_HIP - _CROTCH), 0.0, 1.0)
            follows = np.where(rise > 0.0, np.clip(x / half, 0.0, 1.0), 1.0)
            stands[rows, 0] -= sign * (np.interp(y, heights, inwards) * (1.0 - rise) * follows)[rows]
            plumb = np.where(rise > 0.0, apart * np.maximum(_HIP_JOINT * size - y, 0.0), np.interp(y, heights, inwards))
            together[rows, 0] -= sign * (plumb * follows)[rows]
        notes.append(
            f"the legs stand {2.0 * np.degrees(np.arctan(apart)):.0f} degrees apart; below the crotch they are moved together until "
            "they hang plumb or touch"
        )
    return StandingBody(
        posed=posed,
        vertices=stands,
        seen=seen,
        armpits=armpits,
        crotch=crotch_vertex(posed),
        shown=shown,
        fit=fit,
        unsure=unsure,
        doubtful=doubtful,
        together=together,
        undone=other is relaxed,
        raised=raised,
        notes=tuple(notes),
    )


def _legs_apart(vertices: FloatArray) -> float:
    """Return how far the legs' middles run apart per metre down the leg."""
    places, y, apart = model_places(), [], []
    for height in np.linspace(0.09, _CROTCH, 20):
        near = np.abs(places.mean[:, 1] - height) < 0.012
        x = [vertices[places.strips[f"leg {side}"] & near, 0] for side in ("left", "right")]
        y.append(vertices[(places.strips["leg left"] | places.strips["leg right"]) & near, 1].mean())
        apart.append(0.25 * (x[0].min() + x[0].max() - x[1].min() - x[1].max()))
    return max(0.0, -float(np.polyfit(y, apart, 1)[0]))


def _unsure(
    fit: FittedBody, scan: Mesh, model: FloatArray, standing: FloatArray, weights: FloatArray, seen: BoolArray
) -> tuple[str | None, bool]:
    """Return why a fit is no good, and whether it is none or the crotch is hidden.

    It is no good if it lies far from the scan, or one of the two has parts that the other has not.
    """
    if fit.far > _FAR:
        return f"the body model lies {1000.0 * fit.far:.0f} mm off the scan in the mean", True
    near = (
        np.linalg.norm(Mesh(model, BodyModel.load().triangles).closest(scan.vertices)[2] - scan.vertices, axis=1)
        < _BESIDE
    )
    # A floor is no part of the body, either.
    area = scan.area * (scan.vertices[scan.triangles, 1].max(axis=1) > scan.vertices[:, 1].min() + _FLOOR)
    shared = float(area @ near[scan.triangles].mean(axis=1) / area.sum())
    if shared < _SHARED:
        return f"{100.0 * (1.0 - shared):.0f} % of the scan is no part of a standing body", True
    names = (*BodyModel.load().joints, "pelvis")
    part = np.argmax(weights, axis=1)
    triangles = finer_body()[1]
    size = np.bincount(triangles.ravel(), np.repeat(Mesh(standing, triangles).area, 3), len(standing))
    plain = model_places().plain
    for number, name in enumerate(names):
        which = (part == number) & (plain | (name == "neck01"))
        shown = _PARTS.get(name.split(".")[0])
        if shown and float(size[which] @ seen[which]) < _SEEN * float(size[which].sum()):
            return f"the scan does not show {shown}", True
    trunk = np.isin(part, [names.index("spine03"), names.index("pelvis")])
    bands = np.floor(standing[trunk, 1] / _BAND).astype(int)
    # A band and its neighbours, or a hole of a hand's breadth at the shoulders would do.
    count, shown_in = (np.convolve(np.bincount(bands, each), np.ones(3), "same") for each in (None, seen[trunk]))
    share = np.where(count < _FEW, 1.0, shown_in / np.maximum(count, 1))
    hidden = bool(share.min() < _SEEN)
    # Few scanners see between the legs.
    share[: bands[model_places().mean[trunk, 1] > _HIP].min()] = 1.0
    if share.min() < _SEEN:
        return f"the scan does not show the trunk at {_BAND * float(np.argmin(share)):.2f} m", True
    return None, hidden
