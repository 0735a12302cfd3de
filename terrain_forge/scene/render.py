"""Pictures of a ray scene: camera, Sun and sky rays in packets, lit as dusty ground is.

Reflectance is the lunar-Lambert law (McEwen 1991, doi:10.1016/0019-1035(91)90228-U) with an
opposition surge; four samples to a pixel, each with a ray to the Sun and one to the sky.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numba import get_num_threads, njit
from numba.extending import intrinsic
from numpy.typing import NDArray

from terrain_forge.scene.camera import Camera
from terrain_forge.scene.embree import COHERENT, INCOHERENT
from terrain_forge.scene.grain import soil
from terrain_forge.scene.packets import (
    ACTIVE,
    FAR,
    LANES,
    PACKET_BYTES,
    TRIANGLE,
    U,
    V,
    hit_normal,
    hit_rock,
    intersect8,
    occluded8,
    packet_memory,
    set_ray,
)
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.surface import (
    BENT_X,
    BENT_Y,
    BENT_Z,
    BLUE,
    COLUMNS,
    FLAT_X,
    FLAT_Y,
    FLAT_Z,
    GREEN,
    LIFT,
    NOBODY,
    OWNER,
    RANGE,
    RED,
    SHADE,
    Land,
    Stones,
    Tracks,
    X,
    Y,
    Z,
    hemisphere,
    see_ground,
    see_rock,
)

Array = NDArray[np.float64]

Triple = tuple[float, float, float]

SAMPLES = 4
_TILE = 4
_OFFSETS = np.array([(0.375, 0.125), (0.625, 0.875), (0.875, 0.375), (0.125, 0.625)])
_ALL = (1 << LANES) - 1
_SKY_REACH = 8.0


class Light(NamedTuple):
    """What shines, already scaled to the picture's exposure."""

    towards_sun: Triple
    """Unit vector."""
    sun: Triple
    """Radiance of a white surface that faces the Sun, linear RGB."""
    sky: Triple
    """Radiance of a white surface under the whole sky, linear RGB."""
    bounce: Triple
    """Radiance of a white surface that sees only ground, linear RGB."""
    horizon: Triple
    """Sky at the horizon, and what distance fades into, linear RGB."""
    zenith: Triple
    """Sky overhead, linear RGB."""
    plain: Triple
    """Ground beyond the world's edge, linear RGB."""
    haze: float
    """Distance after which 1/e of the contrast is left [m]; infinite without air."""
    airy: bool
    """Whether there is a sky that shines."""
    lunar: float
    """Part of the Lommel-Seeliger term, 0 (Lambert) to 1."""


def triple(vector: Array) -> Triple:
    """Three plain numbers: kernels pass them about without counting references."""
    return float(vector[0]), float(vector[1]), float(vector[2])


class _View(NamedTuple):
    position: Triple
    forward: Triple
    right: Triple
    down: Triple
    width: int
    height: int
    pinhole: bool
    step: float


@njit(cache=True)
def _aim(view, column, row):  # type: ignore[no-untyped-def]
    """Origin and unit direction of the ray through a place in the picture."""
    x, y = column - 0.5 * view.width, row - 0.5 * view.height
    a, b, c = (
        x * view.right[0] + y * view.down[0],
        x * view.right[1] + y * view.down[1],
        x * view.right[2] + y * view.down[2],
    )
    o, f = view.position, view.forward
    if not view.pinhole:
        return (o[0] + a, o[1] + b, o[2] + c), (f[0], f[1], f[2])
    a, b, c = a + f[0], b + f[1], c + f[2]
    length = np.sqrt(a * a + b * b + c * c)
    return (o[0], o[1], o[2]), (a / length, b / length, c / length)


@njit(cache=True)
def _place(ray, lane, rock, distance, start, towards, stones, point):  # type: ignore[no-untyped-def]
    """Move a surface point to a lane's hit; returns whether it is beside the pixel's last one.

    A point that is keeps its normal and albedo, which are filtered for the whole pixel anyway.
    """
    beside = point[OWNER] == rock and abs(distance - point[RANGE]) < 0.03 * distance
    point[X] = start[0] + distance * towards[0]
    point[Y] = start[1] + distance * towards[1]
    point[Z] = start[2] + distance * towards[2]
    point[RANGE], point[OWNER] = distance, rock
    point[FLAT_X], point[FLAT_Y], point[FLAT_Z] = hit_normal(ray, lane, rock, stones.rotation)
    return beside


@njit(cache=True)
def _shade(ray, word, lane, view, towards, land, tracks, stones, point):  # type: ignore[no-untyped-def]
    facing = -(
        point[FLAT_X] * towards[0] + point[FLAT_Y] * towards[1] + point[FLAT_Z] * towards[2]
    )
    step = view.step * (point[RANGE] if view.pinhole else 1.0)
    footprint = step / np.sqrt(max(facing, 0.04))
    rock = np.int64(point[OWNER])
    if rock < 0:
        see_ground(point, land, tracks, footprint)
    else:
        u, v = np.float64(ray[U, lane]), np.float64(ray[V, lane])
        see_rock(point, land, stones, rock, np.int64(word[TRIANGLE, lane]), u, v, footprint)


@njit(cache=True)
def _leave(ray, word, lane, point, direction, reach):  # type: ignore[no-untyped-def]
    """Aim a lane from just above a surface point; returns whether the way is not into the surface."""
    rise = (
        direction[0] * point[FLAT_X] + direction[1] * point[FLAT_Y] + direction[2] * point[FLAT_Z]
    )
    lift = 5e-4 + 2e-4 * point[RANGE]
    start = (
        point[X] + lift * point[FLAT_X],
        point[Y] + lift * point[FLAT_Y],
        point[Z] + lift * point[FLAT_Z] + point[LIFT],
    )
    set_ray(ray, word, lane, start, direction, 0.0, reach)
    if rise <= 0.0:
        word[ACTIVE, lane] = 0
    return rise > 0.0


@njit(cache=True)
def _reflect(point, towards, light):  # type: ignore[no-untyped-def]
    """Lunar-Lambert reflectance of a point over its albedo, times the cosine of incidence."""
    sun = light.towards_sun
    mu0 = point[BENT_X] * sun[0] + point[BENT_Y] * sun[1] + point[BENT_Z] * sun[2]
    if mu0 <= 0.0:
        return 0.0
    mu = -(point[BENT_X] * towards[0] + point[BENT_Y] * towards[1] + point[BENT_Z] * towards[2])
    mu = max(mu, 0.1)
    phase = -(sun[0] * towards[0] + sun[1] * towards[1] + sun[2] * towards[2])
    half = np.sqrt(max(0.0, 1.0 - phase) / (1.0 + phase + 1e-6))
    surge = 1.0 + 0.5 / (1.0 + half / 0.08)
    return surge * (light.lunar * 2.0 * mu0 / (mu0 + mu) + (1.0 - light.lunar) * mu0)


@njit(cache=True)
def _add(pixel, point, lit, open_sky, towards, light, far):  # type: ignore[no-untyped-def]
    """Add a sample's light, faded by the air, to its pixel."""
    direct = (1.0 - 0.7 * point[SHADE]) * _reflect(point, towards, light) if lit else 0.0
    clear = np.exp(-point[RANGE] / light.haze) if far else 1.0
    for channel in range(3):
        ambient = light.sky[channel] if open_sky else light.bounce[channel]
        shone = point[RED + channel] * (direct * light.sun[channel] + ambient)
        pixel[channel] += shone * clear + light.horizon[channel] * (1.0 - clear)


@njit(cache=True)
def _add_sky(pixel, start, towards, step, land, light):  # type: ignore[no-untyped-def]
    """Add what a ray sees that leaves the world: sky, or the plain beyond the edge."""
    if towards[2] >= 0.0:
        blend = 1.0 - (1.0 - towards[2]) ** 4
        for channel in range(3):
            low, high = light.horizon[channel], light.zenith[channel]
            pixel[channel] += low + blend * (high - low)
        return
    distance = max(start[2] - land.edge, 0.5) / -towards[2]
    east = start[0] + distance * towards[0] + land.shift[0]
    north = start[1] + distance * towards[1] + land.shift[1]
    footprint = distance * step / np.sqrt(max(-towards[2], 0.002))
    tint = 1.0 + 0.35 * soil(land.key, east, north, 80.0, footprint)[0]
    clear = np.exp(-distance / light.haze)
    for channel in range(3):
        shone = light.plain[channel] * tint
        pixel[channel] += shone * clear + light.horizon[channel] * (1.0 - clear)


@njit(cache=True)
def _see_packet(scene, query, view, land, tracks, stones, sun, ray, point, x, y):  # type: ignore[no-untyped-def]
    """Shade what a packet of pixels sees and ask for the Sun.

    Returns bit masks of the lanes that see a surface, that are in sunlight, and whose surface was
    seen by their pixel's last sample already.
    """
    word, address = ray.view(np.uint32), ray.ctypes.data
    for lane in range(LANES):
        start, towards = _aim(view, x + lane % _TILE, y + lane // _TILE)
        set_ray(ray, word, lane, start, towards, 0.0, np.inf)
    intersect8(address + 4 * ACTIVE * LANES, scene, address, query)
    seen, lit, known = 0, 0, 0
    for lane in range(LANES):
        start, towards = _aim(view, x + lane % _TILE, y + lane // _TILE)
        word[ACTIVE, lane] = 0
        rock = hit_rock(word, lane)
        if rock == -2:
            continue
        seen |= 1 << lane
        distance = np.float64(ray[FAR, lane])
        beside = _place(ray, lane, rock, distance, start, towards, stones, point[lane])
        known |= beside << lane
        if not beside:
            _shade(ray, word, lane, view, towards, land, tracks, stones, point[lane])
        lit |= _leave(ray, word, lane, point[lane], sun, np.inf) << lane
    if lit:
        occluded8(address + 4 * ACTIVE * LANES, scene, address, query)
        for lane in range(LANES):
            lit &= ~((ray[FAR, lane] < 0.0) << lane)
    return seen, lit, known


@njit(cache=True)
def _see_sky(scene, query, land, ray, point, left, top, sample, seen):  # type: ignore[no-untyped-def]
    """Bit mask of the lanes from whose surface a random ray gets to the sky."""
    word, address = ray.view(np.uint32), ray.ctypes.data
    free = 0
    for lane in range(LANES):
        word[ACTIVE, lane] = 0
        if (seen >> lane) & 1:
            column, row = left + lane % _TILE, top + lane // _TILE
            up = hemisphere(point[lane], land.key, column, row, sample)
            if up[2] > 0.0:
                free |= _leave(ray, word, lane, point[lane], up, _SKY_REACH) << lane
    if free:
        occluded8(address + 4 * ACTIVE * LANES, scene, address, query)
        for lane in range(LANES):
            free &= ~((ray[FAR, lane] < 0.0) << lane)
    return free


@njit(cache=True)
def _sample(scene, queries, view, land, tracks, stones, light, ray, point, left, top, sample, image):  # type: ignore[no-untyped-def]
    """Add one sample to each pixel of a packet; returns whether all were as the last one was."""
    x, y = left + _OFFSETS[sample, 0], top + _OFFSETS[sample, 1]
    seen, lit, known = _see_packet(
        scene, queries[0], view, land, tracks, stones, light.towards_sun, ray, point, x, y
    )
    free = 0
    if seen and light.airy:
        free = _see_sky(scene, queries[1], land, ray, point, left, top, sample, seen)
    for lane in range(LANES):
        pixel = image[top + lane // _TILE, left + lane % _TILE]
        start, towards = _aim(view, x + lane % _TILE, y + lane // _TILE)
        if (seen >> lane) & 1:
            sunny, open_sky = (lit >> lane) & 1, (free >> lane) & 1
            _add(pixel, point[lane], sunny, open_sky, towards, light, view.pinhole)
        else:
            _add_sky(pixel, start, towards, view.step, land, light)
    return (seen == 0) or (lit == _ALL and known == _ALL)


@njit(cache=True)
def _expose_packet(scene, queries, view, land, tracks, stones, light, ray, point, left, top, image):  # type: ignore[no-untyped-def]
    """Expose 4 × 2 pixels: two samples where nothing changes and the Sun shines, else four."""
    point[:, OWNER] = NOBODY
    taken, calm = 0, False
    while taken < SAMPLES and not (taken == SAMPLES // 2 and calm):
        calm = _sample(
            scene, queries, view, land, tracks, stones, light, ray, point, left, top, taken, image
        )
        taken += 1
    image[top : top + _TILE // 2, left : left + _TILE] /= taken


@intrinsic
def _lend(_context, array):  # type: ignore[no-untyped-def]
    """The array without its owner: counting references would cost more than the shading does."""

    def build(context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        view = context.make_array(array)(context, builder, arguments[0])
        view.meminfo = view.meminfo.type(None)
        return view._getvalue()

    return array(array), build


@njit(cache=True)
def _lend_all(land, tracks, stones):  # type: ignore[no-untyped-def]
    return (
        Land(
            _lend(land.elevation),
            _lend(land.rgb),
            _lend(land.linear),
            land.corner,
            land.shift,
            land.spacing,
            land.edge,
            land.key,
            land.clast_share,
            land.shadow,
        ),
        Tracks(_lend(tracks.nearest), _lend(tracks.points), tracks.half_gauge, tracks.width),
        Stones(
            _lend(stones.centre),
            _lend(stones.rotation),
            _lend(stones.size),
            _lend(stones.rgb),
            _lend(stones.first_face),
            _lend(stones.faces),
            _lend(stones.normals),
            stones.dust,
        ),
    )


@njit(cache=True, nogil=True)
def _expose_band(scene, queries, view, land, tracks, stones, light, band, ray, point, image):  # type: ignore[no-untyped-def]
    land, tracks, stones = _lend_all(land, tracks, stones)
    ray, point = _lend(ray), _lend(point)
    pixels = _lend(image)
    for half in range(2 * (image.shape[1] // _TILE)):
        left, top = half // 2 * _TILE, band * _TILE + half % 2 * (_TILE // 2)
        _expose_packet(
            scene, queries, view, land, tracks, stones, light, ray, point, left, top, pixels
        )


def expose(
    scene: RayScene, camera: Camera, *, land: Land, tracks: Tracks, stones: Stones, light: Light
) -> NDArray[np.float32]:
    """The picture in linear RGB, shape [height, width, 3], not yet developed."""
    width, height = (-(-side // _TILE) * _TILE for side in (camera.width, camera.height))
    view = _View(
        position=triple(camera.position - scene.origin),
        forward=triple(camera.forward),
        right=triple(camera.right),
        down=triple(camera.down),
        width=camera.width,
        height=camera.height,
        pinhole=camera.pinhole,
        step=float(np.linalg.norm(camera.right)),
    )
    image = np.zeros((height, width, 3), dtype=np.float32)
    queries = COHERENT, INCOHERENT

    def expose_band(band: int) -> None:
        ray, point = packet_memory(1)[0], np.zeros((LANES, COLUMNS))
        _expose_band(
            scene.handle, queries, view, land, tracks, stones, light, band, ray, point, image
        )

    # Bands write rows of their own, so that the threads' order does not matter.
    with ThreadPoolExecutor(get_num_threads()) as threads:
        list(threads.map(expose_band, range(height // _TILE)))
    return image[: camera.height, : camera.width]


def develop(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """sRGB bytes of a linear picture; what is brighter than half white is compressed, not clipped."""
    steps = 4096
    exposure = np.linspace(0.0, 4.0, steps)
    shoulder = np.where(exposure < 0.5, exposure, 1.0 - 0.5 * np.exp(1.0 - 2.0 * exposure))
    encoded = np.where(
        shoulder <= 0.0031308, 12.92 * shoulder, 1.055 * shoulder ** (1.0 / 2.4) - 0.055
    )
    table = (255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.float32)
    index = np.minimum(image * ((steps - 1) / 4.0), steps - 1).astype(np.int32)
    return (table[index] + _dither(*image.shape[:2])[:, :, None]).astype(np.uint8)


def _dither(rows: int, columns: int) -> NDArray[np.float32]:
    """Interleaved gradient noise, 0 to 1 (Jimenez 2014), which hides the steps of a smooth sky."""
    ramp = 0.06711056 * np.arange(columns)[None, :] + 0.00583715 * np.arange(rows)[:, None]
    noise = 52.9829189 * (ramp - np.floor(ramp))
    return (noise - np.floor(noise)).astype(np.float32) * np.float32(0.999)
