"""A scene as plain arrays for the renderer's kernels: ground, tracks, instances and light."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel, linear_from_srgb, stage_key
from terrain_forge.model import Lighting, Mesh
from terrain_forge.scene.light import Light
from terrain_forge.scene.render import triple
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.subject import Subject
from terrain_forge.scene.surface import Land, Stones, Tracks
from terrain_forge.writers import vertex_normals

_PATH_STEP = 0.1
_NOTHING, _NOWHERE = np.empty((0, 3), np.int64), np.empty((0, 3))
_NOWHERE.setflags(write=False)  # as the arrays of records are: one kernel serves both
_ZENITH = np.array([0.50, 0.45, 0.42])


def prepare_land(scene: RayScene, lighting: Lighting) -> Land:
    """The ground under some light."""
    subject, sun = scene.subject, lighting.towards_sun
    ground, apron = subject.ground, subject.apron
    east, north, middle = triple(scene.origin)
    lean = 1.0 / max(float(sun[2]), 0.3)
    z = ground.elevation
    border = np.concatenate([z[0], z[-1], z[:, 0], z[:, -1]]).mean(dtype=np.float64)
    return Land(
        elevation=(z - middle).astype(np.float32),
        rgb=subject.ground_rgb,
        linear=linear_from_srgb(np.arange(256) / 255.0),
        corner=(ground.origin[0] - east, ground.origin[1] - north),
        shift=(east, north),
        spacing=ground.spacing,
        edge=float(border) - middle,
        key=stage_key(subject.seed, "grain"),
        grain=subject.node_grain,
        usual=subject.usual_grain,
        shadow=(float(sun[0]) * lean, float(sun[1]) * lean),
        apron_faces=_NOTHING if apron is None else apron.mesh.faces.astype(np.int64),
        apron_normals=_NOWHERE if apron is None else apron.normals,
        apron_rgb=_NOWHERE if apron is None else apron.rgb,
    )


def prepare_stones(scene: RayScene) -> Stones:
    """The instances."""
    stones = scene.subject.instances
    faces, normals, first = _shapes(stones.meshes)
    airy = max(scene.subject.lighting.sky_rgb) > 0.0
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
        dust=0.55 if airy else 0.25,
    )


def prepare_tracks(scene: RayScene) -> Tracks:
    """The wheel tracks."""
    subject = scene.subject
    ground, half_gauge, width = subject.ground, subject.half_gauge, subject.wheel_width
    paths = [resampled(track - scene.origin[:2]) for track in subject.tracks]
    points = np.concatenate(paths) if paths else np.empty((0, 5))
    nearest = np.full(ground.shape, -1, dtype=np.int32)
    corner = np.array(ground.origin) - scene.origin[:2]
    _stamp(points, corner, ground.spacing, half_gauge + width + ground.spacing, nearest)
    return Tracks(nearest=nearest, points=points, half_gauge=half_gauge, width=width)


def prepare_light(subject: Subject, lighting: Lighting, *, facing: float) -> Light:
    """Sun and sky, exposed so that level sunlit ground shows in its own colour.

    `facing` is the cosine of the angle that level ground is seen under.
    """
    sky = np.asarray(lighting.sky_rgb, dtype=np.float64)
    radius = 0.5 * subject.sun_diameter
    sine, cosine = np.sin(lighting.sun_azimuth), np.cos(lighting.sun_azimuth)
    low, high = np.cos(lighting.sun_elevation), np.sin(lighting.sun_elevation)
    airy = bool(sky.max() > 0.0)
    up = max(float(lighting.towards_sun[2]), 0.05)
    lunar = 0.35 if airy else 0.75
    level, grazing = (lunar * 2.0 * up / (up + mu) + (1.0 - lunar) * up for mu in (facing, 0.1))
    # Dust scatters about a third of a clear day's sunlight into the sky (Mars).
    from_sky = 0.3 * (0.5 + 0.5 * sky / sky.mean()) if airy else np.zeros(3)
    sun = (1.0 - from_sky) / level
    albedo = linear_from_srgb(subject.ground_rgb[::16, ::16].mean(axis=(0, 1)) / 255.0)
    return Light(
        towards_sun=triple(lighting.towards_sun),
        upwards=triple(radius * np.array([-high * sine, -high * cosine, low])),
        sideways=triple(radius * np.array([cosine, -sine, 0.0])),
        sun=triple(sun),
        sky=triple(from_sky),
        bounce=triple(0.35 * albedo),
        horizon=triple(0.85 * sky),
        zenith=triple(sky * _ZENITH),
        plain=triple(albedo * (sun * grazing + from_sky)),
        haze=450.0 if airy else np.inf,
        airy=airy,
        lunar=lunar,
    )


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


@kernel
def _stamp(points, corner, spacing, reach, nearest):  # type: ignore[no-untyped-def]
    """Note at each node within `reach` of a path which of its points is nearest."""
    rows, columns = nearest.shape
    best = np.full((rows, columns), np.inf)
    for n in range(len(points)):
        west = max(0, int(np.ceil((points[n, 0] - reach - corner[0]) / spacing)))
        east = min(columns - 1, int(np.floor((points[n, 0] + reach - corner[0]) / spacing)))
        south = max(0, int(np.ceil((points[n, 1] - reach - corner[1]) / spacing)))
        north = min(rows - 1, int(np.floor((points[n, 1] + reach - corner[1]) / spacing)))
        for j in range(south, north + 1):
            for i in range(west, east + 1):
                away = (corner[0] + i * spacing - points[n, 0]) ** 2
                away += (corner[1] + j * spacing - points[n, 1]) ** 2
                if away < best[j, i]:
                    best[j, i] = away
                    nearest[j, i] = n
