"""Rock shapes as fracture and wear leave them: a blank cut by faces, chipped, worn and roughened.

A blank is star-shaped about its centre: it is known by the distance of its surface along each
direction d, so it cannot cut itself, whatever is drawn. The distance is 1 / g(d), where the gauge g
is the p-norm of what bounds the body: faces (plane or a little hollow or bulging), ledges (the
*smaller* of two planes, which takes away only what lies beyond both) and a sphere. A large p
leaves fresh edges, a small one worn edges. Chipped edges, roughness and gas bubbles then act along
d, and `axes` stretch the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from terrain_forge.base import Array, Record, inner, kernel, mix

_COMPONENT = 1.0 / 32768.0
_PRIMES = (
    np.uint64(0x9E3779B185EBCA87),
    np.uint64(0xC2B2AE3D27D4EB4F),
    np.uint64(0x165667B19E3779F9),
)
_EDGE = 0.07  # within this relative difference of two gauges a point is at an edge
_THINNEST = 0.83  # least part of the blank's distance that bubbles leave
_OCTAVES = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Blank(Record):
    """What bounds a rock, in units of its half axes before `axes` stretches it."""

    axes: Array
    """Wanted extents a ≥ b ≥ c, their mean 1, shape [3]."""
    faces: Array
    """Outward normal, distance from the centre and curvature (hollow faces positive) of the
    fracture faces, shape [faces, 5]."""
    ledges: Array = field(default_factory=lambda: np.empty((0, 2, 3)))
    """Pairs of planes, normal over distance; what lies beyond both of a pair is gone, shape
    [ledges, 2, 3]."""
    sharpness: float = 60.0
    """Exponent p of the gauge: about 8 for a river cobble, 60 for a fresh fracture."""
    roundness: float = 0.0
    """Weight of the unit sphere in the gauge: 1 cuts at the half axes, 0 not at all."""
    chipping: float = 0.0
    """Largest depth of the bites along the edges, as a fraction of the radius."""
    roughness: float = 0.0
    """Amplitude of the roughness, as a fraction of the radius."""
    wavelength: float = 1.0
    """Its largest wavelength [half axes]; each of four octaves has half that of the last."""
    fall: float = 0.5
    """Ratio of its amplitudes an octave apart."""
    steps: float = 0.0
    """How far the roughness is broken into steps, 0 to 1."""
    lumps: float = 0.0
    """Amplitude of the clasts that stand out of the surface, as a fraction of the radius."""
    bubbles: Array = field(default_factory=lambda: np.empty((0, 4)))
    """Centre and radius of spheres that are taken away, shape [bubbles, 4]."""
    key: int = 0
    """Key of the noise, 64 bits."""
    vertices: int = 642
    """Vertices of the finest mesh."""

    def __post_init__(self) -> None:
        self.freeze("axes", np.float64, (3,))
        self.freeze("faces", np.float64, ("faces", 5))
        self.freeze("ledges", np.float64, ("ledges", 2, 3))
        self.freeze("bubbles", np.float64, ("bubbles", 4))


_SURFACE = (
    *("sharpness", "roundness", "chipping", "roughness"),
    *("wavelength", "fall", "steps", "lumps"),
)


def radii(blank: Blank, directions: Array) -> Array:
    """Distance of the surface from the centre along unit `directions` [half axes], shape [n]."""
    surface = np.array([getattr(blank, name) for name in _SURFACE])
    arrays = (blank.faces.copy(), blank.ledges.copy(), blank.bubbles.copy())
    result: Array = _radii(np.array(directions, order="C"), *arrays, surface, np.uint64(blank.key))
    return result


def projections(points: Array, axes: Array) -> Array:
    """Coordinates of points along axes, shapes [n, 3] and [m, 3] to [n, m], free of BLAS."""
    return np.asarray(_project(np.array(points, order="C"), np.array(axes.T, order="C")))


@kernel
def _project(points, axes):  # type: ignore[no-untyped-def]
    result = np.empty((len(points), axes.shape[1]))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(axes.shape[1]):
            result[i, k] = x * axes[0, k] + y * axes[1, k] + z * axes[2, k]
    return result


@kernel
def _radii(directions, faces, ledges, bubbles, surface, key):  # type: ignore[no-untyped-def]
    sharpness, roundness, chipping, roughness, wavelength, fall, steps, lumps = surface
    gauges = np.empty(len(faces) + len(ledges) + 1)
    result = np.empty(len(directions))
    for n in range(len(directions)):
        x, y, z = directions[n, 0], directions[n, 1], directions[n, 2]
        _face_gauges(faces, x, y, z, gauges)
        for k in range(len(ledges)):
            one, other = ledges[k, 0], ledges[k, 1]
            first = one[0] * x + one[1] * y + one[2] * z
            second = other[0] * x + other[1] * y + other[2] * z
            gauges[len(faces) + k] = max(0.0, min(first, second))
        gauges[-1] = roundness
        worn = sharpness * 2.0 ** (1.5 * _noise(key, 1.3 * x, 1.3 * y, 1.3 * z))
        gauge, edge = _blend(gauges, worn)
        radius = 1.0 / gauge
        x, y, z = x * radius, y * radius, z * radius
        relief = roughness * _rough(
            key, x / wavelength, y / wavelength, z / wavelength, fall, steps
        )
        if chipping > 0.0:
            bite = _noise(key + np.uint64(77), 3.1 * x, 3.1 * y, 3.1 * z)
            bite += 0.4 * _noise(key + np.uint64(78), 7.3 * x, 7.3 * y, 7.3 * z)
            relief -= chipping * edge * min(1.0, max(0.0, 2.5 * (bite + 0.1)))
        if lumps > 0.0:
            relief += lumps * _clasts(key, 2.6 * x, 2.6 * y, 2.6 * z)
        x, y, z = directions[n, 0], directions[n, 1], directions[n, 2]
        result[n] = _open_bubbles(bubbles, x, y, z, radius * (1.0 + relief))
    return result


@inner
def _face_gauges(faces, x, y, z, gauges):  # type: ignore[no-untyped-def]
    """Gauge of each face: that of the paraboloid n·p = h + κ/2 |p - (n·p) n|²."""
    for k in range(len(faces)):
        along = faces[k, 0] * x + faces[k, 1] * y + faces[k, 2] * z
        distance, curvature = faces[k, 3], faces[k, 4]
        square = along * along - 2.0 * curvature * distance * (1.0 - along * along)
        gauges[k] = 0.0
        if square >= 0.0 and (along > 0.0 or curvature < 0.0):
            gauges[k] = (along + np.sqrt(square)) / (2.0 * distance)


@inner
def _blend(gauges, sharpness):  # type: ignore[no-untyped-def]
    """The p-norm of the gauges, and how near the two largest are to each other, 0 to 1."""
    largest = second = 0.0
    for k in range(len(gauges)):
        if gauges[k] > largest:
            second, largest = largest, gauges[k]
        elif gauges[k] > second:
            second = gauges[k]
    total = 0.0
    for k in range(len(gauges)):
        if gauges[k] > 0.0:
            total += (gauges[k] / largest) ** sharpness
    edge = max(0.0, 1.0 - (largest - second) / (_EDGE * largest))
    return largest * total ** (1.0 / sharpness), edge


@inner
def _rough(key, x, y, z, fall, steps):  # type: ignore[no-untyped-def]
    """Noise of four octaves, about -1 to 1, the coarser ones partly broken into steps."""
    total, weight, scale = 0.0, 1.0, 1.0
    for octave in range(_OCTAVES):
        value = 1.6 * _noise(mix(key, np.uint64(octave)), scale * x, scale * y, scale * z)
        if octave < 2:
            level = np.floor(3.0 * value)
            part = 3.0 * value - level
            part = min(1.0, max(0.0, (part - 0.38) / 0.24))
            value += steps * ((level + part) / 3.0 - value)
        total += weight * value
        weight, scale = weight * fall, scale * 2.03
    return total


@inner
def _part(hashed, shift):  # type: ignore[no-untyped-def]
    """Sixteen bits of a hash as a number from 0 to 2."""
    return np.float64((hashed >> np.uint64(shift)) & np.uint64(0xFFFF)) * _COMPONENT


@inner
def _corner(key, i, j, k, x, y, z):  # type: ignore[no-untyped-def]
    a, b, c = _PRIMES
    hashed = mix(key, np.uint64(i) * a + np.uint64(j) * b + np.uint64(k) * c)
    u, v, w = _part(hashed, 0) - 1.0, _part(hashed, 16) - 1.0, _part(hashed, 32) - 1.0
    return u * x + v * y + w * z


@inner
def _noise(key, x, y, z):  # type: ignore[no-untyped-def]
    """Gradient noise of a unit lattice, about -0.6 to 0.6."""
    i, j, k = np.int64(np.floor(x)), np.int64(np.floor(y)), np.int64(np.floor(z))
    x, y, z = x - i, y - j, z - k
    u = x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
    v = y * y * y * (y * (y * 6.0 - 15.0) + 10.0)
    w = z * z * z * (z * (z * 6.0 - 15.0) + 10.0)
    value = 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
        weight = (u if a else 1.0 - u) * (v if b else 1.0 - v) * (w if c else 1.0 - w)
        value += weight * _corner(key, i + a, j + b, k + c, x - a, y - b, z - c)
    return value


@inner
def _clasts(key, x, y, z):  # type: ignore[no-untyped-def]
    """Clasts set in a matrix: one in most cells of a unit lattice, 0 to 1 where they stand out."""
    i, j, k = np.int64(np.floor(x)), np.int64(np.floor(y)), np.int64(np.floor(z))
    highest = 0.0
    for a in range(-1, 2):
        for b in range(-1, 2):
            for c in range(-1, 2):
                p, q, r = _PRIMES
                cell = np.uint64(i + a) * p + np.uint64(j + b) * q + np.uint64(k + c) * r
                hashed = mix(key + np.uint64(99), cell)
                size = 0.25 + 0.25 * _part(hashed, 48)
                # The angular clast's own distance: a mean of the cube's and the sphere's.
                dx = abs(i + a + 0.5 * _part(hashed, 0) - x)
                dy = abs(j + b + 0.5 * _part(hashed, 16) - y)
                dz = abs(k + c + 0.5 * _part(hashed, 32) - z)
                away = 0.5 * max(dx, max(dy, dz)) + 0.5 * np.sqrt(dx * dx + dy * dy + dz * dz)
                highest = max(highest, min(1.0, 3.0 * (1.0 - away / size)))
    return highest


@inner
def _open_bubbles(bubbles, x, y, z, radius):  # type: ignore[no-untyped-def]
    """The distance along a direction after the bubbles that the surface cuts have been opened."""
    opened = radius
    for k in range(len(bubbles)):
        along = bubbles[k, 0] * x + bubbles[k, 1] * y + bubbles[k, 2] * z
        square = bubbles[k, 0] ** 2 + bubbles[k, 1] ** 2 + bubbles[k, 2] ** 2
        half = bubbles[k, 3] ** 2 - square + along * along
        if along > 0.0 and half > 0.0:
            half = np.sqrt(half)
            if along + half >= radius:
                opened = min(opened, max(along - half, _THINNEST * radius))
    return opened
