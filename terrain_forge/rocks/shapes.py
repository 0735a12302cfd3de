"""Rock shapes as a sculptor would make them: a blank cut by planes, chipped, worn and roughened.

A blank is star-shaped about its centre. Its surface in the direction d lies at 1 / g(d), where the
gauge g is the p-norm of what bounds the body: planes (n·d / h each), chips (the *smaller* of two
planes, which takes away only what lies beyond both and so leaves a ledge) and a sphere. A large
p leaves fresh edges, a small one worn edges. Noise and pits then act along d, and `axes` stretch
the whole. Such a body cannot cut itself, whatever is drawn.

A family is one function from a random generator to a `Blank`, entered in `Family` and `FAMILIES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from terrain_forge.kernels import kernel
from terrain_forge.records import Record

Array = NDArray[np.float64]

Family = Literal["block", "slab", "cobble", "vesicular"]
"""Names of the shape families."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Blank(Record):
    """What bounds a rock, in units of its half axes before `axes` stretches it."""

    axes: Array
    """Wanted extents a ≥ b ≥ c, their mean 1, shape [3]."""
    planes: Array
    """Outward normal over distance, n / h, of the planes that cut the rock, shape [planes, 3]."""
    chips: Array
    """Pairs of such planes; what lies beyond both of a pair is gone, shape [chips, 2, 3]."""
    sharpness: float
    """Exponent p of the gauge: about 8 for a river cobble, 60 for a fresh fracture."""
    roundness: float
    """Weight of the unit sphere in the gauge: 1 cuts at the half axes, 0 not at all."""
    waves: Array
    """Wave vectors [rad per half axis] and phases [rad] of the roughness, shape [waves, 4]."""
    amplitudes: Array
    """Amplitude of each wave as a fraction of the radius, shape [waves]."""
    pits: Array
    """Unit vector, angular radius [rad] and depth [fraction of the radius], shape [pits, 5]."""

    def __post_init__(self) -> None:
        self.freeze("axes", np.float64, (3,))
        self.freeze("planes", np.float64, ("planes", 3))
        self.freeze("chips", np.float64, ("chips", 2, 3))
        self.freeze("waves", np.float64, ("waves", 4))
        self.freeze("amplitudes", np.float64, (len(self.waves),))
        self.freeze("pits", np.float64, ("pits", 5))


def projections(points: Array, axes: Array) -> Array:
    """Coordinates of points along axes, shapes [n, 3] and [m, 3] to [n, m], free of BLAS."""
    result: Array = _project(np.array(points, order="C"), np.array(axes.T, order="C"))
    return result


@kernel
def _project(points, axes):  # type: ignore[no-untyped-def]
    result = np.empty((len(points), axes.shape[1]))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(axes.shape[1]):
            result[i, k] = x * axes[0, k] + y * axes[1, k] + z * axes[2, k]
    return result


def convex_gauge(blank: Blank, directions: Array) -> Array:
    """Gauge of the convex part of the blank (no chips, no roughness) along unit `directions`.

    Args:
        blank: The rock to be.
        directions: Unit vectors in units of the half axes, shape [n, 3].

    Returns:
        1 / distance of the surface from the centre [1 / half axis], shape [n].
    """
    terms = projections(directions, blank.planes)
    return _norm(np.maximum(terms, 0.0), blank.roundness, blank.sharpness)


def radii(blank: Blank, directions: Array) -> Array:
    """Distance of the surface from the centre along unit `directions` [half axes], shape [n]."""
    planes = projections(directions, blank.planes)
    one, other = (projections(directions, blank.chips[:, side]) for side in (0, 1))
    terms = np.maximum(np.concatenate([planes, np.minimum(one, other)], axis=1), 0.0)
    distance = 1.0 / _norm(terms, blank.roundness, blank.sharpness)
    relief = _roughness(blank, directions * distance[:, None]) - _pits(blank, directions)
    result: Array = distance * (1.0 + relief)
    return result


def _norm(terms: Array, constant: float, sharpness: float) -> Array:
    """The p-norm of terms and constant, scaled by the largest so that no power overflows."""
    largest = np.maximum(terms.max(axis=1), constant)
    total = ((terms / largest[:, None]) ** sharpness).sum(axis=1)
    total += (constant / largest) ** sharpness
    result: Array = largest * total ** (1.0 / sharpness)
    return result


def _roughness(blank: Blank, points: Array) -> Array:
    phases = projections(points, blank.waves[:, :3]) + blank.waves[:, 3]
    result: Array = np.einsum("ik,k->i", np.sin(phases), blank.amplitudes)
    return result


def _pits(blank: Blank, directions: Array) -> Array:
    """Depth of the deepest bowl at each direction."""
    if not len(blank.pits):
        return np.zeros(len(directions))
    cosines = projections(directions, blank.pits[:, :3])
    beyond = (1.0 - cosines) / (1.0 - np.cos(blank.pits[:, 3]))
    bowls = np.maximum(1.0 - beyond, 0.0) * blank.pits[:, 4]
    result: Array = bowls.max(axis=1)
    return result


def block(random: Generator) -> Blank:
    """An angular block: three joint sets, fracture planes across its corners, edges hardly worn."""
    faces = np.concatenate([_joints(random, tilt=0.17), _fractures(random, count=9, nearest=1.0)])
    return Blank(
        axes=_axes(random, flatness=(0.55, 0.12)),
        planes=faces,
        chips=_chips(random, faces[:6], faces[:6], count=2, depth=(0.10, 0.24)),
        sharpness=random.uniform(30.0, 70.0),
        roundness=0.0,
        **_rough(random, amplitude=0.016),
        pits=np.empty((0, 5)),
    )


def slab(random: Generator) -> Blank:
    """A flat piece of layered rock: two bedding planes, steep sides, ledges of broken layers."""
    bedding = _unit(np.array([[0, 0, 1], [0, 0, -1]]) + random.normal(0, 0.05, (2, 3)))
    count = int(random.integers(6, 9))
    azimuth = 2 * np.pi * (np.arange(count) + random.uniform(-0.35, 0.35, count)) / count
    dip = random.normal(0.0, 0.12, count)
    sides = _unit(np.stack([np.cos(azimuth), np.sin(azimuth), dip], axis=1))
    sides = sides / random.uniform(0.86, 1.1, (count, 1))
    ledges = _chips(random, bedding, sides, count=3, depth=(0.1, 0.3))
    return Blank(
        axes=_axes(random, flatness=(0.30, 0.05)),
        planes=np.concatenate([bedding, sides, _fractures(random, count=4, nearest=1.1)]),
        chips=ledges,
        sharpness=random.uniform(35.0, 70.0),
        roundness=0.0,
        **_rough(random, amplitude=0.013),
        pits=np.empty((0, 5)),
    )


def cobble(random: Generator) -> Blank:
    """A rounded cobble: an ellipsoid with a few old faces, worn smooth."""
    return Blank(
        axes=_axes(random, flatness=(0.58, 0.10)),
        planes=_fractures(random, count=12, nearest=0.72),
        chips=np.empty((0, 2, 3)),
        sharpness=random.uniform(12.0, 22.0),
        roundness=0.95,
        **_rough(random, amplitude=0.02, fall=0.4),
        pits=np.empty((0, 5)),
    )


def vesicular(random: Generator) -> Blank:
    """Vesicular basalt: a subangular block whose surface cuts through old gas bubbles."""
    faces = np.concatenate([_joints(random, tilt=0.35), _fractures(random, count=10, nearest=0.9)])
    count = int(random.integers(30, 50))
    pits = np.column_stack(
        [
            _unit(random.normal(size=(count, 3))),
            np.exp(random.uniform(np.log(0.09), np.log(0.26), count)),
            np.zeros(count),
        ]
    )
    pits[:, 4] = pits[:, 3] * random.uniform(0.35, 0.6, count)
    return Blank(
        axes=_axes(random, flatness=(0.60, 0.10)),
        planes=faces,
        chips=np.empty((0, 2, 3)),
        sharpness=random.uniform(16.0, 30.0),
        roundness=0.8,
        **_rough(random, amplitude=0.012),
        pits=pits,
    )


FAMILIES: dict[Family, Callable[[Generator], Blank]] = {
    "block": block,
    "slab": slab,
    "cobble": cobble,
    "vesicular": vesicular,
}
"""The shape families by the name that a recipe uses."""


def _axes(random: Generator, *, flatness: tuple[float, float]) -> Array:
    """Extents a ≥ b ≥ c of mean 1: b/a ~ N(0.8, 0.1), c/a ~ N(flatness), clipped.

    Fragments of impact experiments have a : b : c near 2 : √2 : 1 (Fujiwara, Kamimoto & Tsukamoto
    1978, doi:10.1038/272602a0).
    """
    breadth = float(np.clip(random.normal(0.8, 0.1), 0.5, 1.0))
    height = float(np.clip(random.normal(*flatness), 0.2, breadth))
    axes = np.array([1.0, breadth, height])
    result: Array = axes / axes.mean()
    return result


def _unit(vectors: Array) -> Array:
    result: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result


def _joints(random: Generator, *, tilt: float) -> Array:
    """Both sides of three joint sets that are square to each other but for `tilt` (rms, rad)."""
    square = np.concatenate([np.eye(3), -np.eye(3)])
    return _unit(square + random.normal(0, tilt, (6, 3))) / random.uniform(0.85, 1.1, (6, 1))


def _fractures(random: Generator, *, count: int, nearest: float) -> Array:
    """Planes of any direction that cut corners and edges, `nearest` or a little farther out."""
    normals = _unit(random.normal(size=(count, 3)))
    return normals / random.uniform(nearest, nearest + 0.35, (count, 1))


def _chips(
    random: Generator, ones: Array, others: Array, *, count: int, depth: tuple[float, float]
) -> Array:
    """Ledges where one of `ones` meets one of `others`, both pushed in by a share of `depth`."""
    cosines = projections(_unit(ones), _unit(others))
    first, second = np.nonzero(np.abs(cosines) < 0.5)
    chosen = random.permutation(len(first))[:count]
    pairs = np.stack([ones[first[chosen]], others[second[chosen]]], axis=1)
    return pairs / (1.0 - random.uniform(*depth, (len(pairs), 2, 1)))


def _rough(random: Generator, *, amplitude: float, fall: float = 0.65) -> dict[str, Any]:
    """Coherent roughness of rms `amplitude`: waves of random direction in three octaves.

    Wavelengths from 1.7 half axes down to 0.2; `fall` is the ratio of amplitudes an octave apart.
    """
    octave = np.repeat(np.arange(3), 8)
    number = 2 * np.pi * 0.6 * 2.0 ** (octave + random.uniform(0, 1, len(octave)))
    vectors = _unit(random.normal(size=(len(octave), 3))) * number[:, None]
    waves = np.column_stack([vectors, random.uniform(0, 2 * np.pi, len(octave))])
    weights = fall**octave
    weights *= amplitude / np.sqrt(0.5 * (weights**2).sum())
    return {"waves": waves, "amplitudes": weights}
