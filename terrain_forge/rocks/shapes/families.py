"""The families of rock shapes: each one function from a random generator to a `Blank`.

A family is entered in `Family` and in `FAMILIES`, where the recipe finds it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.random import Generator

from terrain_forge.base import Array, portable
from terrain_forge.rocks.shapes.shapes import Blank, projections, radii

Family = Literal["block", "slab", "cobble", "vesicular", "ventifact", "breccia"]
"""Names of the shape families."""

_FINE = 962  # vertices where the surface has much to show


def block(random: Generator) -> Blank:
    """An angular block: a few large fracture faces at odd angles, small ones across corners.

    Two rough joints are nearly parallel; the other faces have any angle to them. Faces are a little
    hollow or bulging, as fractures are; some corners have come off in hollow (conchoidal) scars,
    and the edges are chipped.
    """
    faces = np.concatenate([_joints(random), _large_faces(random, count=5), _corners(random, 9)])
    scars = _corners(random, 3)
    scars[:, 4] = random.uniform(0.25, 0.7, len(scars))
    scars[:, 3] -= 0.05
    return Blank(
        axes=_axes(random, flatness=(0.55, 0.12)),
        faces=np.concatenate([faces, scars]),
        ledges=_ledges(random, faces[:7], count=2),
        sharpness=random.uniform(60.0, 120.0),
        roundness=0.74,
        chipping=random.uniform(0.02, 0.05),
        roughness=0.022,
        wavelength=0.9,
        fall=0.6,
        steps=0.7,
        key=int(random.integers(0, 2**63)),
    )


def slab(random: Generator) -> Blank:
    """A flat piece of layered rock: bedding planes, steep broken sides, layers set back."""
    bedding = np.zeros((2, 5))
    bedding[:, :3] = _unit(np.array([[0, 0, 1], [0, 0, -1]]) + random.normal(0, 0.04, (2, 3)))
    bedding[:, 3] = 1.0
    sides = _sides(random, count=int(random.integers(5, 8)))
    layers = [
        _layer(random, sides, height, inset)
        for height, inset in (
            (random.uniform(0.55, 0.75), random.uniform(0.1, 0.3)),
            (random.uniform(0.05, 0.35), random.uniform(0.03, 0.12)),
            (random.uniform(-0.75, -0.4), random.uniform(0.05, 0.2)),
        )
    ]
    return Blank(
        axes=_axes(random, flatness=(0.30, 0.06)),
        faces=np.concatenate([bedding, sides, _corners(random, 3)]),
        ledges=np.concatenate(layers),
        sharpness=random.uniform(60.0, 120.0),
        chipping=random.uniform(0.03, 0.06),
        roughness=0.02,
        wavelength=0.8,
        fall=0.6,
        steps=0.8,
        key=int(random.integers(0, 2**63)),
    )


def cobble(random: Generator) -> Blank:
    """A rounded cobble: a block whose edges are long worn away, with what is left of its faces."""
    faces = np.concatenate([_large_faces(random, count=7), _corners(random, 6)])
    faces[:, 3] = random.uniform(0.80, 1.08, len(faces))
    faces[:, 4] = random.normal(-0.25, 0.15, len(faces))
    return Blank(
        axes=_axes(random, flatness=(0.58, 0.10)),
        faces=faces,
        sharpness=random.uniform(11.0, 18.0),
        roundness=0.95,
        roughness=0.022,
        wavelength=1.1,
        fall=0.42,
        key=int(random.integers(0, 2**63)),
    )


def vesicular(random: Generator) -> Blank:
    """Vesicular basalt: a subangular block whose surface cuts through gas bubbles of many sizes.

    Bubble radii follow an exponential, as do vesicles before they merge (Blower et al. 2000,
    HP Laboratories HPL-BRIMS-2000-31); those too small for the mesh are left out.
    """
    faces = np.concatenate([_joints(random), _large_faces(random, count=4), _corners(random, 8)])
    body = Blank(
        axes=_axes(random, flatness=(0.60, 0.10)),
        faces=faces,
        sharpness=random.uniform(22.0, 40.0),
        roundness=0.75,
        chipping=0.03,
        roughness=0.02,
        wavelength=0.8,
        key=int(random.integers(0, 2**63)),
        vertices=_FINE,
    )
    count = int(random.integers(90, 125))
    towards = _unit(random.normal(size=(count, 3)))
    radius = np.minimum(0.10 + random.exponential(0.04, count), 0.23)
    depth = radii(body, towards) + radius * random.uniform(-0.1, 0.55, count)
    return body.replace(bubbles=np.column_stack([towards * depth[:, None], radius]))


def ventifact(random: Generator) -> Blank:
    """A ventifact: smooth faces that the wind's sand has cut, which meet in keels (dreikanter)."""
    count = int(random.integers(3, 5))
    azimuth = 2 * np.pi * (np.arange(count) + random.uniform(-0.25, 0.25, count)) / count
    azimuth += random.uniform(0, 2 * np.pi)
    rise = portable.tan(np.radians(random.uniform(30.0, 55.0, count)))
    normals = _unit(np.column_stack([np.cos(azimuth), np.sin(azimuth), rise]))
    cut = np.column_stack(
        [normals, random.uniform(0.5, 0.68, count), random.uniform(-0.15, 0.3, count)]
    )
    base = np.array([[0.0, 0.0, -1.0, random.uniform(0.45, 0.6), -0.1]])
    below = _large_faces(random, count=5)
    below[:, 2] = -np.abs(below[:, 2])
    return Blank(
        axes=_axes(random, flatness=(0.50, 0.08)),
        faces=np.concatenate([cut, base, below]),
        sharpness=random.uniform(28.0, 50.0),
        roundness=0.8,
        roughness=0.012,
        wavelength=0.7,
        fall=0.5,
        key=int(random.integers(0, 2**63)),
    )


def breccia(random: Generator) -> Blank:
    """Impact breccia: a crumbling subrounded block from whose matrix harder clasts stand out."""
    faces = np.concatenate([_large_faces(random, count=6), _corners(random, 7)])
    return Blank(
        axes=_axes(random, flatness=(0.60, 0.10)),
        faces=faces,
        sharpness=random.uniform(14.0, 26.0),
        roundness=0.9,
        chipping=0.05,
        roughness=0.05,
        wavelength=0.9,
        fall=0.6,
        steps=0.3,
        lumps=0.09,
        key=int(random.integers(0, 2**63)),
        vertices=_FINE,
    )


_ALL = (block, slab, cobble, vesicular, ventifact, breccia)
FAMILIES: dict[str, Callable[[Generator], Blank]] = {family.__name__: family for family in _ALL}
"""The shape families by the name that a recipe uses."""
COARSE_FACES = {
    "block": 210, "slab": 316, "cobble": 316, "vesicular": 1920, "ventifact": 106, "breccia": 1380
}  # fmt: skip
"""About how many triangles a shape of each family keeps for an error of its outline of 0.03."""


def _axes(random: Generator, *, flatness: tuple[float, float]) -> Array:
    """Extents a ≥ b ≥ c of mean 1: b/a ~ N(0.75, 0.11), c/a ~ N(flatness), clipped.

    Fragments of impact experiments and blocks on asteroids have a : b : c near 2 : √2 : 1
    (Michikami et al. 2022, doi:10.1016/j.icarus.2022.115007); rocks on Mars are no more elongated.
    """
    breadth = float(np.clip(random.normal(0.75, 0.11), 0.5, 1.0))
    height = float(np.clip(random.normal(*flatness), 0.2, breadth))
    axes = np.array([1.0, breadth, height])
    return np.asarray(axes / axes.mean())


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _joints(random: Generator) -> Array:
    """Two faces of one joint set, parallel but for a few degrees."""
    normal = _unit(random.normal(size=3))
    normals = _unit(np.stack([normal, -normal]) + random.normal(0, 0.08, (2, 3)))
    return np.column_stack([normals, random.uniform(0.72, 0.95, 2), random.normal(0, 0.08, 2)])


def _large_faces(random: Generator, *, count: int) -> Array:
    """Faces that bound the body: directions that keep off each other, at unlike distances."""
    chosen = [_unit(random.normal(size=3))]
    while len(chosen) < count:  # each is the best of twelve at keeping off the others
        tries = _unit(random.normal(size=(12, 3)))
        nearest = projections(tries, np.array(chosen)).max(axis=1)
        chosen.append(tries[nearest.argmin()])
    curvature = random.normal(0.0, 0.12, count)
    return np.column_stack([chosen, random.uniform(0.68, 0.98, count), curvature])


def _corners(random: Generator, count: int) -> Array:
    """Small faces that have cut corners and edges off."""
    normals = _unit(random.normal(size=(count, 3)))
    return np.column_stack(
        [normals, random.uniform(0.98, 1.2, count), random.normal(0.1, 0.15, count)]
    )


def _ledges(random: Generator, faces: Array, *, count: int) -> Array:
    """Steps where two faces meet, both set back by a share of their distance."""
    planes = faces[:, :3] / faces[:, 3:4]
    first, second = np.nonzero(np.abs(projections(faces[:, :3], faces[:, :3])) < 0.6)
    chosen = random.permutation(len(first))[:count]
    pairs = np.stack([planes[first[chosen]], planes[second[chosen]]], axis=1)
    return pairs / (1.0 - random.uniform(0.08, 0.22, (len(pairs), 2, 1)))


def _sides(random: Generator, *, count: int) -> Array:
    """Steep faces all around, at odd angles."""
    azimuth = 2 * np.pi * (np.arange(count) + random.uniform(-0.4, 0.4, count)) / count
    azimuth += random.uniform(0, 2 * np.pi)
    dip = random.normal(0.0, 0.2, count)
    normals = _unit(np.column_stack([np.cos(azimuth), np.sin(azimuth), dip]))
    return np.column_stack(
        [normals, random.uniform(0.75, 1.05, count), random.normal(0, 0.1, count)]
    )


def _layer(random: Generator, sides: Array, height: float, inset: float) -> Array:
    """Ledges that set a layer, above `height` (or below a negative one), back all around."""
    bed = _unit(np.array([0.0, 0.0, np.sign(height)]) + random.normal(0, 0.03, 3)) / abs(height)
    normals = _unit(sides[:, :3] + random.normal(0, 0.15, (len(sides), 3)))
    backs = sides[:, 3] * (1.0 - inset * random.uniform(0.0, 2.0, len(sides)))
    others = normals / np.maximum(backs, 0.4)[:, None]
    return np.stack([np.broadcast_to(bed, others.shape), others], axis=1)
