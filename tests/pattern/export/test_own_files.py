"""What the package writes it reads: pattern.json whole, DXF and SVG with all that they hold."""

from __future__ import annotations

from polygons import drafted, polygon

from warpflat.pattern.drafting.piece_parts import Dart
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json

#: A block with a dart in its lower edge.
DARTED = [(0.0, 0.0), (0.13, 0.0), (0.15, 0.12), (0.17, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)]
NAMES = ("hem left", "d.left", "d.right", "hem right", "side right", "neck", "side left")
KINDS = ("hem", "dart", "dart", "hem", "seam", "seam", "seam")
WIDTHS = (0.03, None, None, 0.03, 0.015, 0.0, 0.015)


def darted(**more):
    """The block, drafted; `more` is of its dart."""
    dart = Dart(name="d", left="d.left", right="d.right", **more)
    return drafted(polygon("front", DARTED, names=NAMES, kinds=KINDS, widths=WIDTHS, darts=[dart]))


def test_a_dart_of_pattern_json_is_still_cut_away():
    read = pattern_from_json(pattern_json(darted(cut=True)))
    assert read.pieces[""][0].piece.darts[0].cut
