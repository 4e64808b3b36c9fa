"""Rasterisation: the front triangle at each sample of an image, and the colour of each pixel."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def _crossing(p: wp.vec3d, q: wp.vec3d, y: wp.float64):
    """Return x of the edge at height y, always from its first vertex, so that no sample falls between two triangles."""
    return p[0] + (q[0] - p[0]) * ((y - p[1]) / (q[1] - p[1]))


@wp.func
def _centres_within(low: wp.float64, high: wp.float64, count: int):
    """Return the first and the last of `count` samples whose centres lie between two places."""
    half = wp.float64(0.5)
    first = wp.ceil(wp.clamp(low - half, wp.float64(0.0), wp.float64(count)))
    last = wp.floor(wp.clamp(high - half, wp.float64(-1.0), wp.float64(count - 1)))
    return int(first), int(last)


@wp.kernel
def put_nearest(
    points: wp.array(dtype=wp.vec3d),
    triangles: wp.array(dtype=wp.vec3i),
    back: wp.float64,
    per_depth: wp.float64,
    # outputs
    front: wp.array2d(dtype=wp.int64),
):
    """Write to each sample the greatest of 2^32 times the depth in steps, plus the triangle; a thread per triangle."""
    t = wp.tid()
    corner = triangles[t]
    half = wp.float64(0.5)
    a = points[corner[0]]
    b = points[corner[1]]
    c = points[corner[2]]
    top, bottom = _centres_within(wp.min(wp.min(a[1], b[1]), c[1]), wp.max(wp.max(a[1], b[1]), c[1]), front.shape[0])
    low = wp.min(wp.min(a[0], b[0]), c[0])
    high = wp.max(wp.max(a[0], b[0]), c[0])
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == wp.float64(0.0) or not wp.isfinite(area) or wp.ceil(low - half) > high - half:
        return
    rise = b - a
    run = c - a
    slope_x = (rise[2] * run[1] - run[2] * rise[1]) / area
    slope_y = (run[2] * rise[0] - rise[2] * run[0]) / area
    lowest = (wp.min(wp.min(a[2], b[2]), c[2]) - back) * per_depth
    highest = (wp.max(wp.max(a[2], b[2]), c[2]) - back) * per_depth
    for row in range(top, bottom + 1):
        y = wp.float64(row) + half
        left = low
        right = high
        for k in range(3):
            i = corner[k]
            j = corner[(k + 1) % 3]
            p = points[i]
            q = points[j]
            down = q[1] - p[1]
            if area < wp.float64(0.0):
                down = -down
            if down != wp.float64(0.0):
                x = wp.float64(0.0)
                if i < j:
                    x = _crossing(p, q, y)
                else:
                    x = _crossing(q, p, y)
                if down < wp.float64(0.0):
                    left = wp.max(left, x)
                else:
                    right = wp.min(right, x)
        first, last = _centres_within(left, right, front.shape[1])
        at_left = a[2] - back + slope_x * (half - a[0]) + slope_y * (y - a[1])
        for column in range(first, last + 1):
            # Seen edge-on, a plane's depth runs away between its corners.
            depth = wp.clamp((at_left + slope_x * wp.float64(column)) * per_depth, lowest, highest)
            wp.atomic_max(front, row, column, (wp.int64(depth + half) << wp.int64(32)) + wp.int64(t))


@wp.func
def _shaded(
    t: int,
    x: wp.float32,
    y: wp.float32,
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    face: wp.array(dtype=wp.int32),
    colours: wp.array(dtype=wp.vec3f),
    normals: wp.array(dtype=wp.vec3f),
    lit: bool,
    blended: bool,
    light: wp.vec3f,
    back: wp.vec3f,
):
    """Return the colour of triangle t at column x and row y."""
    shown = colours[face[t]]
    if not lit:
        return shown
    normal = wp.vec3f()
    if blended:
        corner = triangles[t]
        a = points[corner[0]]
        rise = points[corner[1]] - a
        run = points[corner[2]] - a
        area = rise[0] * run[1] - rise[1] * run[0]
        along = x - a[0]
        down = y - a[1]
        second = wp.clamp((along * run[1] - down * run[0]) / area, 0.0, 1.0)
        third = wp.clamp((down * rise[0] - along * rise[1]) / area, 0.0, 1.0)
        normal = (
            normals[corner[0]] * wp.max(1.0 - second - third, 0.0)
            + normals[corner[1]] * second
            + normals[corner[2]] * third
        )
    else:
        normal = normals[t]
    towards = wp.dot(wp.normalize(normal), light)
    brightness = 0.55 + 0.50 * wp.clamp(towards, 0.0, 1.0)
    if normal[2] < 0.0:
        shown = 0.25 * shown + 0.75 * back
        brightness = 0.62 + 0.25 * wp.clamp(-towards, 0.0, 1.0)
    return shown * brightness


@wp.func
def _byte(value: wp.float32):
    """Return a value of 0 to 1 as a byte."""
    return wp.uint8(int(wp.clamp(value, 0.0, 1.0) * 255.0 + 0.5))


@wp.kernel
def shade_pixels(
    samples: wp.array2d(dtype=wp.int32),
    side: int,
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    face: wp.array(dtype=wp.int32),
    colours: wp.array(dtype=wp.vec3f),
    normals: wp.array(dtype=wp.vec3f),
    lit: bool,
    blended: bool,
    light: wp.vec3f,
    back: wp.vec3f,
    # outputs
    pixels: wp.array2d(dtype=wp.vec4ub),
):
    """Compute the mean colour of a pixel's `side` by `side` samples, and as opacity the share covered by triangles."""
    row, column = wp.tid()
    first = samples[row * side, column * side]
    others = wp.int32(0)
    for i in range(side):
        for j in range(side):
            if samples[row * side + i, column * side + j] != first:
                others += 1
    total = wp.vec3f()
    covered = wp.float32(0.0)
    if others == 0:
        if first < 0:
            return
        x = (float(column) + 0.5) * float(side)
        y = (float(row) + 0.5) * float(side)
        total = _shaded(first, x, y, points, triangles, face, colours, normals, lit, blended, light, back)
        covered = 1.0
    else:
        share = 1.0 / float(side * side)
        for i in range(side):
            for j in range(side):
                t = samples[row * side + i, column * side + j]
                if t >= 0:
                    x = float(column * side + j) + 0.5
                    y = float(row * side + i) + 0.5
                    total += share * _shaded(
                        t, x, y, points, triangles, face, colours, normals, lit, blended, light, back
                    )
                    covered += share
        total = total / covered
    pixels[row, column] = wp.vec4ub(_byte(total[0]), _byte(total[1]), _byte(total[2]), _byte(covered))
