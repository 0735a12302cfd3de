"""The rock library: random shapes at rest, with levels of detail, hulls and mass properties."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, MinLen
from numpy.random import Generator, Philox
from numpy.typing import NDArray

from terrain_forge.mesh import Mesh
from terrain_forge.rocks import outline
from terrain_forge.rocks.carving import Sphere, carve
from terrain_forge.rocks.collision import collision_parts
from terrain_forge.rocks.shapes import FAMILIES, Blank, Family, projections
from terrain_forge.rocks.solid import mass_properties
from terrain_forge.seeds import mix, stage_key
from terrain_forge.site import BroughtMesh
from terrain_forge.specs import Spec
from terrain_forge.world import RockLibrary, RockPrototype

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LibrarySpec(Spec):
    """Which rock shapes a world draws from."""

    shapes: Annotated[int, Interval(ge=1, le=1000)] = 24
    """Number of different shapes; more of them change none of the first ones."""
    seed: Annotated[int, Interval(ge=0, le=2**63 - 1)] = 0
    """Seed of the library alone, so that several worlds can share one."""
    families: Annotated[tuple[Family, ...], MinLen(1)] = ("block", "slab", "block", "cobble")
    """Families that the shapes take in turn; one named twice gives twice as many. `block`: angular
    and freshly broken; `slab`: flat, of layered rock; `cobble`: worn round; `vesicular`: basalt
    with gas bubbles."""
    hull_vertices: Annotated[int, Interval(ge=16, le=64)] = 64
    """Largest number of vertices of a shape's convex collision parts; GPU engines like 32."""
    hull_excess: Annotated[float, Interval(ge=0.01, le=1)] = 0.15
    """Part by which one collision hull's volume may exceed the shape's; a shape beyond it is cut
    into several convex parts, which takes seconds for each. Shapes of ours stay below 0.07."""


def make_library(spec: LibrarySpec, *, brought: tuple[BroughtMesh, ...] = ()) -> RockLibrary:
    """Make the library; equal specs give equal bytes, and shape n does not depend on how many.

    Args:
        spec: What is wanted.
        brought: The user's own shapes, which follow those that are made.

    Raises:
        ArithmeticError: if the surface of a shape degenerates (no drawn shape is known to).
    """
    del brought  # not used yet
    key = stage_key(spec.seed, "rock-library")
    sphere = Sphere()
    prototypes = []
    for n in range(spec.shapes):
        family = spec.families[n % len(spec.families)]
        blank = FAMILIES[family](Generator(Philox(key=int(mix(key, n)))))
        prototypes.append(_prototype(family, blank, sphere, spec))
    return RockLibrary(
        prototypes=tuple(prototypes),
        seed=spec.seed,
        texture=np.full((64, 64), 255),
    )


def _prototype(family: str, blank: Blank, sphere: Sphere, spec: LibrarySpec) -> RockPrototype:
    meshes = lay_down(carve(blank, sphere), blank.axes)
    shape = meshes[0]
    solid = mass_properties(shape)
    hulls = collision_parts(shape, vertices=spec.hull_vertices, excess=spec.hull_excess)
    reach, rise = outline.bounds(shape)
    return RockPrototype(
        family=family,
        meshes=meshes,
        hulls=hulls,
        volume=solid.volume,
        inertia=solid.inertia,
        hull_excess=sum(mass_properties(hull).volume for hull in hulls) / solid.volume - 1.0,
        hull_distance=0.0,
        uvs=tuple(mesh.vertices[mesh.faces][:, :, :2].copy() for mesh in meshes),
        outline_errors=(0.0,) * len(meshes),
        reach=reach,
        rise=rise,
    )


def lay_down(meshes: tuple[Mesh, ...], axes: Array) -> tuple[Mesh, ...]:
    """Turn a rock onto its most stable side and give it its extents.

    The first mesh decides: z is up when it lies on the facet of its hull over which its centre of
    mass is lowest (which always projects into that facet), x is its longer horizontal principal
    axis. Stretching along these axes to the extents `axes` [m] leaves that facet level and the
    centre of mass above it. Coarser meshes are grown to the volume of the first, all about its
    centre of mass, which becomes the origin.
    """
    solid = mass_properties(meshes[0])
    rotation = resting_axes(meshes[0].vertices - solid.centre, solid.inertia)
    turned = [projections(mesh.vertices - solid.centre, rotation) for mesh in meshes]
    stretch = axes / np.ptp(turned[0], axis=0)
    laid = [
        mesh.replace(vertices=vertices * stretch)
        for mesh, vertices in zip(meshes, turned, strict=True)
    ]
    volumes = [mass_properties(mesh).volume for mesh in laid]
    return tuple(
        mesh.replace(vertices=mesh.vertices * np.cbrt(volumes[0] / volume))
        for mesh, volume in zip(laid, volumes, strict=True)
    )


def resting_axes(vertices: Array, inertia: Array) -> Array:
    """Axes of a rock that lies on its most stable side: x long and level, z up.

    Args:
        vertices: Corners relative to the centre of mass, shape [vertices, 3].
        inertia: Inertia tensor about the centre of mass, shape [3, 3].

    Returns:
        The axes as rows, a rotation matrix, shape [3, 3].
    """
    from scipy.spatial import ConvexHull

    equations = ConvexHull(vertices).equations
    up = -equations[np.argmin(-equations[:, 3]), :3]
    level = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    level /= np.linalg.norm(level)
    across = np.cross(up, level)
    i_level, i_across, product = (
        float(np.einsum("i,ij,j->", one, inertia, other))
        for one, other in ((level, level), (across, across), (level, across))
    )
    # The long axis is the one of the smaller moment of inertia.
    angle = 0.5 * np.arctan2(-2.0 * product, i_across - i_level)
    x = np.cos(angle) * level + np.sin(angle) * across
    return np.stack([x, np.cross(up, x), up])
