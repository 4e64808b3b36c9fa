"""A measurement card: which measurements a garment needs, how each is taken, and a picture of where."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, IntArray, unit
from warpflat.garment.mannequin.body_landmarks import ARM_PLACES, model_places, near_level, near_place, value_at
from warpflat.garment.mannequin.body_model import finer_body
from warpflat.garment.mannequin.bricks import TRUNK_LEVELS
from warpflat.garment.mannequin.head import head_of
from warpflat.garment.mannequin.layout import ARM_LEVELS, LEG_LEVELS, TRUNK_RINGS
from warpflat.garment.mannequin.measurements import TAKEN_ALONG
from warpflat.garment.mannequin.picture import LINE
from warpflat.pattern import GREY, SKIN, Facets, View, draw_row, drawn_page

if TYPE_CHECKING:
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["needed_measurements", "write_measurement_card"]

#: By measurement how it is taken, in the order in which one measures.
_HOW: Mapping[str, str] = {
    "stature": "standing height without shoes, from the floor to the crown",
    "head": "around the forehead and the back of the head, where it is widest",
    "neck": "around the base of the neck, where a necklace lies",
    "shoulder": "from the base of the neck to the shoulder's end, one side",
    "bust": "around the fullest part of the chest, level all around",
    "underbust": "around the ribs, right below the bust",
    "bust_points": "from one bust point to the other",
    "chest_width": "in front, from armhole crease to armhole crease",
    "back_width": "behind, from armhole crease to armhole crease",
    "armscye_depth": "behind, from the nape straight down to the level of the armpits",
    "nape_to_waist": "behind, from the nape down the middle of the back to the waist",
    "waist": "around the narrowest part; tie a string there for the other measurements",
    "abdomen": "around the belly, half-way from waist to hip",
    "hip": "around the widest part of the seat, level all around",
    "upper_arm": "around the biceps, where the upper arm is widest",
    "elbow": "around the bent elbow",
    "wrist": "around the wrist bone",
    "hand": "around the knuckles, with the thumb laid in",
    "arm_length": "from the shoulder's end over the elbow to the wrist bone, the arm a little bent",
    "inside_leg": "from the crotch straight down to the floor",
    "thigh_girth": "around one thigh, right below the crotch",
    "knee_girth": "around one knee",
    "calf_girth": "around one calf, where it is widest",
    "ankle_girth": "around one ankle, above the bone",
    "foot": "around the ball, where it is broadest",
}
_BEHIND = ("back_width", "armscye_depth", "nape_to_waist")
_PAGE = (8.27, 11.69)  # [in], A4
_HEIGHT, _TOP = 5.0, 10.75  # of the figures, and where they begin [in]
_INTO_LIMB = 0.012  # hands and feet reach so far into arms and legs, of the stature


def needed_measurements(bands: Collection[tuple[str, str]], *, hood: bool = False) -> list[str]:
    """Return the measurements on which a garment depends, in the order in which one measures.

    Args:
        bands: upper and lower level of its parts, as ("shoulder", "hip").
        hood: whether it has one.
    """
    found = {"stature"}
    for upper, lower in bands:
        if upper in TRUNK_LEVELS:
            covered = TRUNK_LEVELS[TRUNK_LEVELS.index(upper) : TRUNK_LEVELS.index(lower) + 1]
            found |= set(covered) & set(TRUNK_RINGS)
            found |= {"hip"} if set(covered) & {"thigh", "knee", "ankle"} else set()
            if upper == "shoulder":
                found |= {"head", "neck", "shoulder", "bust_points", "chest_width", "back_width"}
                found |= {"armscye_depth", "nape_to_waist"}
        elif upper in ARM_LEVELS:
            covered = ARM_LEVELS[: ARM_LEVELS.index(lower) + 1]
            found |= {"upper_arm", "arm_length"} | ({"elbow"} if "elbow" in covered else set())
            found |= {"wrist", "hand"} if "forearm" in covered else set()
        elif upper in LEG_LEVELS:
            covered = LEG_LEVELS[: LEG_LEVELS.index(lower) + 1]
            found |= {"hip", "inside_leg", "thigh_girth"}
            for level in ("knee", "calf", "ankle"):
                found |= {f"{level}_girth"} if f"leg_{level}" in covered else set()
            found |= {"foot"} if "leg_ankle" in covered else set()
    found |= {"head"} if hood else set()
    return [name for name in _HOW if name in found]


def write_measurement_card(
    path: str | os.PathLike[str],
    mannequin: Mannequin,
    bands: Collection[tuple[str, str]],
    *,
    title: str,
    hood: bool = False,
    values: Mapping[str, float] | None = None,
    guessed: Collection[str] = (),
) -> None:
    """Draw a page of A4: the body from the front and from behind with the tapes on it, and a row for each measurement.

    Args:
        path: the file, ``*.png``.
        mannequin: whose picture it is.
        bands, hood: of the garment, as :func:`needed_measurements` takes them.
        title: of the page.
        values: what is known [m]; a row without one has a line to write on.
        guessed: of the values those that nobody gave.

    Raises:
        InputError: the file cannot be written.
    """
    needed = needed_measurements(bands, hood=hood)
    with drawn_page(path, *_PAGE) as pen:
        pen.write(0.5, 11.3, title, 15, fontweight="bold")
        pen.write(0.5, 11.03, "Measure over underwear, the tape snug and level, standing upright.", 9.5, color=GREY)
        number = {name: k for k, name in enumerate(needed, start=1)}
        vertices, faces, tapes = _with_ends(mannequin)
        views = View.around(vertices, Facets.of(faces, np.empty((0, 2), dtype=np.int32)), (("", 0.0), (" ", 180.0)))
        wide, tall, _ = views[""].size
        scale, shades = _HEIGHT / tall, np.tile(SKIN, (len(faces), 1))
        gap = 0.5 * _PAGE[0] - wide * scale
        bodies = draw_row(
            pen, views, [shades] * 2, left=0.5 * gap, bottom=_TOP - _HEIGHT, inches_per_metre=scale, gap=gap
        )
        # Stature is measured beside the body, to its left.
        aside = float(views[""].low[0] + wide) + 0.03
        tapes["stature"] = np.array([(aside, share * mannequin.lengths["stature"], 0.0) for share in (0.0, 0.5, 1.0)])
        layout, at = mannequin.layout, mannequin.vertices
        for name in (name for name in needed if name not in tapes):
            if name in ("nape_to_waist", "armscye_depth"):
                back, neck = layout.lines["centre back"], float(at[layout.lines["neck"], 1].max())
                underarm = layout.lines["underarm left"][0]
                low = at[layout.lines["waist"], 1].mean() if name == "nape_to_waist" else at[underarm, 1]
                tapes[name] = at[back[(at[back, 1] <= neck) & (at[back, 1] >= low - 1e-6)]]
            elif name == "bust_points":
                ring = layout.rings[layout.level_row["bust"]]
                tapes[name] = at[ring[np.arange(-layout.to_princess, layout.to_princess + 1) % len(ring)]]
            else:
                tapes[name] = at[layout.lines[TAKEN_ALONG[name]]]
        for drawn, is_behind in zip(bodies, (False, True), strict=True):
            view, names = drawn.view, [name for name in needed if (name in _BEHIND) is is_behind]
            lines = {name: drawn.to_page(tapes[name] @ view.directions.T) for name in names}
            for line in lines.values():
                pen.line(line, width=1.6, colour=LINE, halo=True)
            for name, line in lines.items():
                # A number lies on its tape: in the middle of a girth, half-way along a length, but where another one lies there.
                places = {"bust_points": 0, "arm_length": 2 * len(line) // 3}
                closed = np.allclose(line[0], line[-1])
                x, y = (line.min(axis=0) + line.max(axis=0)) / 2 if closed else line[places.get(name, len(line) // 2)]
                pen.badge(float(x), float(y), str(number[name]), LINE)
        row = min(0.27, 5.1 / max(len(number), 1))
        y = _TOP - _HEIGHT - 0.35
        for name, k in number.items():
            pen.write(0.62, y, str(k), 9.5, fontweight="bold", color=LINE, ha="right")
            pen.write(0.74, y, name.replace("_", " "), 9.5, fontweight="bold")
            words = textwrap.shorten(_HOW[name], 86, placeholder=" …")
            pen.write(1.95, y, words, 8.2, color=GREY)
            if values is not None and name in values:
                guess = " (guess)" if name in guessed else ""
                pen.write(_PAGE[0] - 0.45, y, f"{100 * values[name]:.1f} cm{guess}", 9.5, ha="right")
            else:
                pen.line(np.array([(_PAGE[0] - 1.35, y - 0.08), (_PAGE[0] - 0.75, y - 0.08)]), width=0.7, colour=GREY)
                pen.write(_PAGE[0] - 0.45, y, "cm", 9.5, ha="right")
            y -= row
        if guessed and values:
            words = "A guess follows from the others by the size table: measure it yourself where you can."
            pen.write(0.5, 0.28, words, 8.5, color=GREY, fontstyle="italic")


def _with_ends(mannequin: Mannequin) -> tuple[FloatArray, IntArray, dict[str, FloatArray]]:
    """Return a body with head, hands and feet, which it lacks and is measured around.

    The head is that on which a hood is worn, hands and feet are those of the mean body model, as large as the person is tall.

    Returns:
        Vertices (#V by 3 [m]), faces (#F by 4), and by measurement the tape across where the end is widest (3 by 3 [m]).
    """
    from scipy.spatial.transform import Rotation

    head, tall = head_of(mannequin), mannequin.lengths["stature"]
    assert head is not None, "every size table has a head"
    places, triangles, sideways = model_places(), finer_body()[1].astype(np.int32), np.array([1.0, 0.0, 0.0])
    ends: list[tuple[str, FloatArray, IntArray, NDArray[np.int64], FloatArray]]
    ends = [("head", *head, np.arange(len(head[0])), sideways)]
    for side in ("right", "left"):
        elbow, wrist = (value_at(near_place(ARM_PLACES[name], side), places.mean) for name in ("elbow", "wrist"))
        along = mannequin.line(f"wrist {side}").mean(axis=0) - mannequin.line(f"elbow {side}").mean(axis=0)
        turn = Rotation.align_vectors([along], [wrist - elbow])[0].as_matrix()
        hand = tall * (places.mean - wrist) @ turn.T + mannequin.line(f"wrist {side}").mean(axis=0)
        rows = places.strips[f"arm {side}"] & (places.along > ARM_PLACES["wrist"] - _INTO_LIMB)
        measured, across = near_place(ARM_PLACES["hand"], side)[0], unit(np.cross(along, [0.0, 0.0, 1.0]))
        ends.append(("hand", hand, triangles[rows[triangles].all(axis=1)], measured, across))
        ankle, joint = value_at(near_level("ankle", side), places.mean), mannequin.line(f"ankle {side}").mean(axis=0)
        foot = (places.mean - ankle) * [tall, joint[1] / ankle[1], tall] + joint
        rows = places.strips[f"leg {side}"] & (places.mean[:, 1] < ankle[1] + _INTO_LIMB)
        ends.append(("foot", foot, triangles[rows[triangles].all(axis=1)], near_level("foot", side)[0], sideways))
    vertices, faces, tapes = [mannequin.vertices], [mannequin.layout.body_faces], dict[str, FloatArray]()
    for name, points, corners, measured, across in ends:
        place = points[measured] @ across
        low, high = points[measured[np.argmin(place)]], points[measured[np.argmax(place)]]
        tapes[name] = np.array([low, 0.5 * (low + high), high])
        faces.append(np.column_stack([corners + sum(map(len, vertices)), np.full(len(corners), -1)]))
        vertices.append(points)
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32), tapes
