"""How near a garment that is fitted to another body is to the one that is made for it.

    python benchmarks/refit.py [--form tshirt ...] [--pairs "EU 36,EU 42" ...]

A form of warpflat is built on two bodies; the first is carried to the second one by `warpflat fit`'s way, by the body model that is fitted
to both, and compared with the second. Columns: by how much the edges of its pieces grow from the one body to the other (median, most),
by how much the carried ones miss that (median, 90 %, most) [mm], the difference of its area [%], and of its ease at bust, waist and hip
from what it was [mm].

With --patterns the flat pieces are compared, from the known pattern of the first body: median over their edges of what flattening the
carried garment anew misses, of what the known edges miss that grow as those of the carried garment do, and of what the graded pattern
misses [mm]; and how far the grain of flattening and of the graded pattern lies from that of the second body's pattern, at most [degrees].
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np

import warpflat
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.construction.carry import carry
from warpflat.garment.construction.graded import graded_layout
from warpflat.garment.construction.level_ease import level_ease, widened
from warpflat.garment.mannequin.common_body import CommonBody
from warpflat.garment.mannequin.mannequin import Mannequin

FORMS = ("basic_block", "tshirt", "a_line_skirt", "trousers")
PAIRS = ("EU 36,EU 42", "EU 42,EU 36", "EU 38,JIS 9AR", "men 46,men 54")


def compare(form: str, first: str, second: str) -> str:
    """Return the line of a form that is carried from one size to another."""
    bodies = [Mannequin.from_size(size) for size in (first, second)]
    made = [body.form(form) for body in bodies]
    faces = np.concatenate([piece.grid_vertices[piece.surface.faces] for piece in made[0].pieces.values()])
    used, number = np.unique(faces, return_inverse=True)
    garment = warpflat.make_surface(made[0].vertices[used], number.reshape(-1, 4), name="garment", weld=False)
    triangles = triangulate(garment.faces)[0].astype(np.int64)
    one, other = (CommonBody.of_mannequin(body, name=size) for body, size in zip(bodies, (first, second), strict=True))
    wearer = other.in_pose_of(one)
    places = carry(garment, one.vertices, wearer.vertices, CommonBody.skin_triangles())
    before = level_ease(one, [(garment.vertices, triangles)])
    kept = {level: girths[0] - girths[1] for level, girths in before.items()}
    for _ in range(2):
        places = widened(wearer, [(places, triangles)], kept)[0]
    ease = level_ease(wearer, [(places, triangles)])
    carried = np.zeros_like(made[0].vertices)
    carried[used] = places
    grown, missed = [], []
    for piece in made[0].pieces.values():
        for row in piece.edges.values():
            ids = piece.grid_vertices[row]
            was, now, wanted = (polyline_length(v[ids]) for v in (made[0].vertices, carried, made[1].vertices))
            grown.append(1e3 * abs(wanted - was))
            missed.append(1e3 * abs(now - wanted))
    areas = []
    for points in (places, made[1].vertices[used]):
        a, b, c = points[triangles].transpose(1, 0, 2)
        areas.append(float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()))
    off = " ".join(
        f"{1e3 * (ease[level][0] - ease[level][1] - kept[level]):+4.0f}" if level in ease and level in kept else "   -"
        for level in ("bust", "waist", "hip")
    )
    return (
        f"{form:14}{first + ' > ' + second:18}{np.median(grown):7.1f}{max(grown):7.1f}  {np.median(missed):7.1f}"
        f"{np.percentile(missed, 90):7.1f}{max(missed):7.1f}  {100 * (areas[0] / areas[1] - 1):+6.2f}  {off}"
    )


def compare_patterns(form: str, first: str, second: str) -> str:
    """Return the line of a form's pattern that is graded from one size to another."""
    bodies = [Mannequin.from_size(size) for size in (first, second)]
    made = [body.form(form) for body in bodies]
    patterns = [warpflat.flatten_form(body, each) for body, each in zip(bodies, made, strict=True)]
    faces = np.concatenate([piece.grid_vertices[piece.surface.faces] for piece in made[0].pieces.values()])
    used, number = np.unique(faces, return_inverse=True)
    garment = warpflat.make_surface(made[0].vertices[used], number.reshape(-1, 4), name="garment", weld=False)
    one, other = (CommonBody.of_mannequin(body, name=size) for body, size in zip(bodies, (first, second), strict=True))
    carried = np.zeros_like(made[0].vertices)
    carried[used] = carry(garment, one.vertices, other.in_pose_of(one).vertices, CommonBody.skin_triangles())
    missed, turned = np.zeros((0, 3)), np.zeros((0, 2))
    for name, piece in made[0].pieces.items():
        known, wanted = (pattern.pieces[name].positions for pattern in patterns)
        worn, now = made[0].vertices[piece.grid_vertices], carried[piece.grid_vertices]
        graded = graded_layout(piece.surface, now, known)
        anew = warpflat.flatten(replace(piece.surface, vertices=now)).positions
        for row in piece.edges.values():
            flat = [polyline_length(layout[row]) for layout in (known, wanted, anew, graded)]
            grown = flat[0] * polyline_length(now[row]) / polyline_length(worn[row])
            missed = np.vstack([missed, [1e3 * abs(each - flat[1]) for each in (flat[2], grown, flat[3])]])
        turns = [(layout - layout.mean(axis=0)).T @ (wanted - wanted.mean(axis=0)) for layout in (anew, graded)]
        angles = [np.degrees(np.arctan2(t[0, 1] - t[1, 0], t[0, 0] + t[1, 1])) for t in turns]
        turned = np.vstack([turned, np.abs(angles)])
    medians = " ".join(f"{value:7.2f}" for value in np.median(missed, axis=0))
    return f"{form:14}{first + ' > ' + second:18}{medians}  " + " ".join(f"{v:6.2f}" for v in turned.max(axis=0))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--form", nargs="+", default=FORMS)
    parser.add_argument("--pairs", nargs="+", default=PAIRS)
    parser.add_argument("--patterns", action="store_true", help="compare the flat pieces")
    given = parser.parse_args()
    if given.patterns:
        print(f"{'form':14}{'bodies':18}{'anew':>7}{'grown':>8}{'graded':>8}{'grain anew':>12}{'graded':>8}")
        for form in given.form:
            for pair in given.pairs:
                print(compare_patterns(form, *pair.split(",")), flush=True)
        return 0
    print(f"{'form':14}{'bodies':18}{'edges grow':>14}  {'missed by: median 90 % most':>21}  area %  ease off")
    for form in given.form:
        for pair in given.pairs:
            print(compare(form, *pair.split(",")), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
