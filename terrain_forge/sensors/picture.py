"""Pictures that cameras are made of: linear in radiance, exact in place."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array
from terrain_forge.scene import SKIN, Rover, Stage, Wheels, look, prepare_stage, prepare_wheels
from terrain_forge.sensors.instrument import Setting
from terrain_forge.sensors.motion import Motion
from terrain_forge.sensors.scenery import Scenery

_LEAST_SINE = 0.05
"""Sine of the Sun's elevation below which pictures get no darker."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposure:
    """One look of an ideal camera; row 0 is on top.

    All but the radiance is what the pixel's middle ray meets; the radiance is the pixel's mean.
    """

    radiance: NDArray[np.float32]
    """What leaves towards the camera [W/(m² sr)], in linear red, green, blue, or their mean, shape
    [height, width, channels]."""
    depth: NDArray[np.float32]
    """Along the optical axis [m], infinite for the sky, shape [height, width]."""
    distance: NDArray[np.float32]
    """Along the ray [m], infinite for the sky, shape [height, width]."""
    instance: NDArray[np.int32]
    """Row of the world's rocks and those that reach into it, or GROUND, MISSED, OUTSIDE, ROVER of
    `scene`, shape [height, width]."""
    normal: NDArray[np.float32]
    """Unit normal of the smooth surface, without its fine grain, in the world; 0 for the sky,
    shape [height, width, 3]."""
    sunlit: NDArray[np.bool_]
    """Whether it sees the middle of the Sun, shape [height, width]."""


def take_exposure(
    setting: Setting,
    *,
    rays: NDArray[np.float32],
    position: ArrayLike,
    rotation: ArrayLike,
    time: ArrayLike,
    colour: bool = False,
    tracks_behind: float | None = None,
    near: float = SKIN,
) -> Exposure:
    """What a camera would see without optics and electronics.

    A value of 1 of the renderer (`prepare_light`: level ground in the Sun has the value of its own
    albedo) is the radiance of a white Lambert surface there, E sin(h) / π, with the Sun's
    irradiance E and its elevation h, less what dust in the air keeps. Each channel is the mean
    over its band as if all of E were in it. The Sun's disc itself is not in the picture.

    Args:
        setting: Where is measured.
        rays: Unit directions in the optical frame (x right, y down, z ahead) of the pixels'
            middles, of any lens, shape [height, width, 3].
        position: Origin of the optical frame in the world [m], shape [3], or of each row (rolling
            shutter), shape [height, 3].
        rotation: From the optical frame to the world, shape [3, 3] or [height, 3, 3].
        time: When the rover stands as it is seen [s], all of it or for each row, shape [height].
        colour: Linear red, green, blue rather than one channel.
        tracks_behind: Wheels have left tracks so far along the motion [m] (`tracked`); None for
            no tracks.
        near: What of the rover is nearer to the rays' origins is not seen [m].
    """
    height, times = len(rays), np.atleast_1d(np.asarray(time, np.float64))
    if times[0] == times[-1]:  # one pose serves all rows
        times = times[:1]
    scenery, lighting = setting.scenery, setting.world.lighting
    stage = _stage(scenery, 3 if colour else 1)
    placed = scenery.rover_at(float(times[len(times) // 2]))  # held as long as rays are cast
    seen = look(
        scenery.scene,
        stage,
        rays=rays,
        position=np.broadcast_to(np.asarray(position, np.float64), (height, 3)),
        rotation=np.broadcast_to(np.asarray(rotation, np.float64), (height, 3, 3)),
        wheels=_wheels(scenery),
        behind=-np.inf if tracks_behind is None else tracks_behind,
        rover=Rover(placed.beyond(near), scenery.poses_at(times), scenery.rover_parts.rgb),
    )
    white = lighting.irradiance * max(float(lighting.towards_sun[2]), _LEAST_SINE) / np.pi
    white *= stage.through
    return Exposure(
        radiance=np.float32(white) * seen.radiance,
        depth=seen.depth,
        distance=seen.distance,
        instance=seen.instance,
        normal=seen.normal,
        sunlit=seen.sunlit,
    )


def travelled(motion: Motion, time: ArrayLike) -> Array:
    """How far along its path over ground the rover has come at times [m]."""
    base = motion.base
    steps = np.hypot(*np.diff(base.samples[:, :2], axis=0).T)
    marks = base.begin + base.step * np.arange(len(base.samples))
    return np.asarray(
        np.interp(np.asarray(time, np.float64), marks, np.concatenate([[0.0], np.cumsum(steps)]))
    )


def tracked(setting: Setting, time: float) -> float:
    """How far along the motion wheels have left tracks at a time [m]; -inf where they leave none.

    The front wheels are ahead of base_link. They began as far ahead: until they have come as far
    again, nothing has pressed the ground just behind them.
    """
    if not setting.tracks:
        return -np.inf
    done, wheels = float(travelled(setting.motion, time)), setting.world.rover.wheels
    ahead = max((float(wheel.centre[0]) for wheel in wheels), default=0.0)
    return done + min(done, max(ahead, 0.0))


_LOCK = Lock()
_stages = WeakKeyDictionary[Scenery, dict[int, Stage]]()
_tracks = WeakKeyDictionary[Scenery, Wheels]()


def _stage(scenery: Scenery, channels: int) -> Stage:
    """Surfaces and light of a scenery, made ready once."""
    with _LOCK:
        made = _stages.setdefault(scenery, {})
        if channels not in made:
            made[channels] = prepare_stage(scenery.scene, scenery.world.lighting, channels)
        return made[channels]


def _wheels(scenery: Scenery) -> Wheels:
    """The tracks of all of a scenery's motion, made ready once."""
    with _LOCK:
        if scenery not in _tracks:
            plan = scenery.motion.base.samples[:, :2]
            _tracks[scenery] = prepare_wheels(scenery.scene, plan)
        return _tracks[scenery]
