"""Names of seams, as sewers tell them apart: by the pieces that they join."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpflat.core import FloatArray, find_unused_name
from warpflat.garment.mannequin.layout import RING_LEVELS

__all__ = ["name_seams"]

#: What lies towards an axis of the mannequin's space, and against it: up, to the body's left, to its front.
_POSITIONS = {1: ("upper", "lower"), 0: ("left", "right"), 2: ("front", "back")}


def name_seams(
    lines: Sequence[str], pieces: Sequence[tuple[str, str]], points: Sequence[FloatArray] | None = None
) -> tuple[str, ...]:
    """Return a name for each seam: that of its line, and before it what tells it from others along lines of that name.

    That is what the names of its two pieces have in common: "bodice side left" joins front_bodice and back_bodice. Else
    it is what they have and the others have not: "front armhole left" joins front and sleeve_left. Else, of two, it is
    where the seam lies: "upper side left". A number is the last resort.

    Args:
        lines: name of the feature line of each seam.
        pieces: names of its two pieces.
        points: of each seam in space, #P by 3 [m]; None leaves positions out.
    """
    # A yoke's seam across the body is called after it, not after the level.
    lines = [
        "yoke" if line in RING_LEVELS and any("yoke" in name.split("_") for name in both) else line
        for line, both in zip(lines, pieces, strict=True)
    ]
    names = list(lines)
    for line in dict.fromkeys(lines):
        group = [number for number, name in enumerate(lines) if name == line]
        known = line.split(" ")
        pairs = [
            [[word for word in name.replace("_", " ").split(" ") if word not in known] for name in pieces[number]]
            for number in group
        ]
        both = [list(dict.fromkeys([*first, *second])) for first, second in pairs]
        common = set.intersection(*map(set, both))
        choices = [
            [" ".join(word for word in first if word in second) for first, second in pairs],
            [" ".join(word for word in row if word not in common) for row in both],
        ]
        if points is not None and len(group) == 2:
            # Two seams are told apart by where each lies against the other.
            first_middle, second_middle = (np.mean(points[number], axis=0) for number in group)
            apart = first_middle - second_middle
            axis = max(_POSITIONS, key=lambda axis: abs(apart[axis]))
            towards, against = _POSITIONS[axis]
            choices.append([towards, against] if apart[axis] > 0 else [against, towards])
        chosen = next((choice for choice in choices if all(choice) and len(set(choice)) == len(group)), None)
        if chosen is not None and len(group) > 1:
            for number, word in zip(group, chosen, strict=True):
                names[number] = f"{word} {line}"
    taken: list[str] = []
    for name in names:
        taken.append(find_unused_name(name, taken))
    return tuple(taken)
