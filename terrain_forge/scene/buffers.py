"""A scene's instances, paths and light as plain arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.model import Lighting, Mesh
from terrain_forge.scene.photometry import photometric_law, reflected
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.subject import Subject
from terrain_forge.scene.tints import top_dust
from terrain_forge.sky import SKY_STEPS, daylight
from terrain_forge.writers import vertex_normals

Triple = tuple[float, float, float]
_PATH_STEP = 0.1
_ZENITH = np.array([0.50, 0.45, 0.42])
_HAZE = 20e3


class Light(NamedTuple):
    """What shines, already scaled to the picture's exposure."""

    towards_sun: Triple
    """Unit vector to the Sun's middle."""
    upwards: Triple
    """From the Sun's middle to its upper limb, over its distance."""
    sideways: Triple
    """From the Sun's middle to its limb beside, over its distance."""
    sun: Triple
    """Radiance of a white surface that faces the Sun, linear RGB."""
    sky: Triple
    """Radiance of a white surface under the whole sky, linear RGB."""
    lean: tuple[float, float]
    """How much more of the sky's light gets to ground for each unit of its slope's sine towards
    east and north."""
    bounce: Triple
    """Radiance of a white surface that sees only ground, linear RGB."""
    dome: NDArray[np.float64]
    """The sky's radiance: by the sine of the elevation, (k / (n - 1))², times by the chord to the
    Sun, 2 (k / (n - 1))², linear RGB, shape [2, n, 3]."""
    even: Triple
    """What is added to it all over the sky, linear RGB."""
    through: float
    """What of the Sun's light on level ground gets through the air, directly or as the sky's."""
    haze: float
    """Distance after which 1/e of the contrast is left [m]; infinite without air."""
    airy: bool
    """Whether there is a sky that shines."""
    law: NDArray[np.float64]
    """How surfaces send light back, as `photometric_law` makes it."""


def triple(vector: Any) -> Triple:
    """Three plain numbers: kernels pass them about without counting references."""
    return float(vector[0]), float(vector[1]), float(vector[2])


class Stones(NamedTuple):
    """The rocks as the renderer needs them."""

    centre: Array
    """In the scene's frame [m], shape [rocks, 3]."""
    rotation: Array
    """Shape [rocks, 3, 3]."""
    size: Array
    """Exposed diameter [m], shape [rocks]."""
    scale: Array
    """Size in units of the shape [m], shape [rocks]."""
    tile: NDArray[np.float32]
    """Relief of their faces, as `rock_tile` makes it."""
    rgb: Array
    """Linear albedo, shape [rocks, 3]."""
    first_face: NDArray[np.int64]
    """Where each rock's shape begins in `faces`, shape [rocks]."""
    faces: NDArray[np.int64]
    """Corners of all shapes, rows of `normals`, shape [faces, 3]."""
    normals: Array
    """Unit normals at all shapes' vertices, shape [vertices, 3]."""
    dust: float
    """How much of the ground's colour lies on faces that look up, 0 to 1."""


def prepare_stones(scene: RayScene) -> Stones:
    """The instances."""
    stones = scene.subject.instances
    faces, normals, first = _shapes(stones.meshes)
    return Stones(
        centre=stones.position - scene.origin,
        rotation=stones.rotation,
        size=np.array(stones.grain),
        scale=stones.scale,
        tile=scene.subject.tile,
        rgb=stones.rgb,
        first_face=first[stones.mesh],
        faces=faces,
        normals=normals,
        dust=top_dust(scene.subject.airless),
    )


def prepare_light(subject: Subject, lighting: Lighting, *, facing: float) -> Light:
    """Sun and sky, exposed so that level sunlit ground shows in its own colour.

    `facing` is the cosine of the angle that level ground is seen under, with the Sun from the side.
    """
    radius = 0.5 * subject.sun_diameter
    sine, cosine = np.sin(lighting.sun_azimuth), np.cos(lighting.sun_azimuth)
    low, high = np.cos(lighting.sun_elevation), np.sin(lighting.sun_elevation)
    air = lighting.dust is not None or max(lighting.sky_rgb) > 0.0
    up = max(float(lighting.towards_sun[2]), 0.05)
    law = photometric_law(subject.photometry)
    level = reflected(law, up, facing, up * facing)
    albedo = linear_from_srgb(subject.ground_rgb[::16, ::16].mean(axis=(0, 1)) / 255.0)
    from_sky, lean, dome, even, through = _sky(lighting, albedo)
    sun = (1.0 - from_sky) / level
    return Light(
        towards_sun=triple(lighting.towards_sun),
        upwards=triple(radius * np.array([-high * sine, -high * cosine, low])),
        sideways=triple(radius * np.array([cosine, -sine, 0.0])),
        sun=triple(sun),
        sky=triple(from_sky),
        lean=(lean * float(sine), lean * float(cosine)),
        bounce=triple(0.35 * albedo),
        dome=dome,
        even=triple(even),
        through=through,
        haze=_haze(lighting),
        airy=air,
        law=law,
    )


def _sky(lighting: Lighting, albedo: Array) -> tuple[Array, float, Array, Array, float]:
    """The sky's part of the light on level ground, its lean, two tables, what is added, gets in.

    The aureole is the Sun's part: it shines from there, and what hides the Sun hides most of it.
    """
    colour = np.asarray(lighting.sky_rgb, dtype=np.float64)
    if lighting.dust is not None:
        day = daylight(lighting.dust, float(lighting.towards_sun[2]), albedo)
        whole = day.direct + day.diffuse
        through = float(whole.mean())
        dome = np.stack([day.across / through, day.around])
        lean = float(day.lean.mean())
        return (day.diffuse - day.aureole) / whole, lean, dome, day.rest / through, through
    if not colour.max() > 0.0:
        return np.zeros(3), 0.0, np.zeros((2, 2, 3)), np.zeros(3), 1.0
    # A body with a sky but without figures of its dust: a third of the light, darker overhead.
    down = 1.0 - (np.arange(SKY_STEPS) / (SKY_STEPS - 1.0)) ** 2
    overhead = colour * (_ZENITH - 0.85)
    across = 0.85 * colour + (1.0 - down**4)[:, None] * overhead
    share = 0.3 * (0.5 + 0.5 * colour / colour.mean())
    return share, 0.0, np.stack([across, np.ones_like(across)]), np.zeros(3), 1.0


def _haze(lighting: Lighting) -> float:
    """Distance after which 1/e of the contrast is left [m]."""
    if lighting.dust is not None:
        return lighting.dust.height / lighting.dust.tau
    return _HAZE if max(lighting.sky_rgb) > 0.0 else np.inf


def _shapes(meshes: Sequence[Mesh]) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """All shapes' faces, all vertices' normals, and where the faces of each shape begin."""
    if not meshes:
        return np.empty((0, 3), np.int64), np.empty((0, 3)), np.empty(0, np.int64)
    corners = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    first = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])[:-1]
    faces = [mesh.faces.astype(np.int64) + c for mesh, c in zip(meshes, corners, strict=False)]
    normals = np.concatenate([vertex_normals(mesh.vertices, mesh.faces) for mesh in meshes])
    return np.concatenate(faces), normals, first


def resampled(plan: Array) -> Array:
    """A path at equal steps: place, cosine and sine of its heading, distance, shape [points, 5]."""
    steps = np.hypot(*np.diff(plan, axis=0).T)
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    moving = np.concatenate([[True], steps > 0.0])
    plan, distance = plan[moving], distance[moving]
    if len(plan) < 2:
        return np.empty((0, 5))
    along = np.linspace(0.0, distance[-1], max(2, int(np.ceil(distance[-1] / _PATH_STEP))))
    place = np.stack([np.interp(along, distance, plan[:, axis]) for axis in range(2)], -1)
    heading = np.gradient(place, along, axis=0)
    heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-300)
    return np.column_stack([place, heading, along])
