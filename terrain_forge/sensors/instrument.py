"""What all instruments are: who measures when, and what comes of it as files."""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    RecipeError,
    is_ours,
    mix,
    normals,
    parts,
    quaternion_from_rpy,
    refused_name,
    require_measurement,
    stage_key,
)
from terrain_forge.base import matrix_from_quaternion as matrix
from terrain_forge.model import Sensor, World
from terrain_forge.sensors.motion import Motion, State

if TYPE_CHECKING:
    from terrain_forge.sensors.scenery import Scenery

GROUP = "terrain_forge.instruments"
"""Entry points that name modules of other packages with instruments."""
NANOSECONDS = 1_000_000_000
_TRUTH = "state_groundtruth_estimate"
"""What the folder of the true motion is called in a recording."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """Where, when and by whom is measured; the same for all instruments of a recording."""

    world: World
    """The world."""
    motion: Motion
    """How the rover moves."""
    scenery: Scenery
    """What rays meet: the ground, rocks, what lies beyond the site, the rover itself."""
    gravity: float
    """What stands and hangs is pulled by [m/s²]."""
    seed: int
    """Root of the sensors' noise."""
    tracks: bool = True
    """Whether the wheels leave tracks behind the rover."""

    def key(self, sensor: Sensor) -> np.uint64:
        """What the chance of a sensor hangs on; elements add their own addresses (`base.mix`)."""
        return stage_key(self.seed, f"sensor/{sensor.name}")


@dataclass(frozen=True, kw_only=True)
class Stream:
    """A row of files, or a table, that an instrument writes."""

    name: str
    """Its folder, below the instrument's own: `data`, `depth`, …"""
    suffix: str
    """Of its files, with the dot; `.csv` for a table."""
    figures: Mapping[str, Any] = field(default_factory=dict)
    """What a reader must know of it: units, factors, columns."""


class Instrument:
    """Measures for one sensor; any measurement alone is the same as that of the whole recording.

    A kind of sensor that can be recorded has a subclass of `Frames` or `Series` with its `kind`,
    found by the registry. It must have a `folder`, `streams`, `calibration`, and `measure` or
    `samples`.
    """

    kind: ClassVar[str]
    """The kind of sensor that it measures for."""
    folder: ClassVar[str]
    """What its folders are called in a recording; a number is added: `cam` makes `cam0`.

    A `Series` may not take that of our cameras or lidars, which holds files.
    """

    def __init__(self, sensor: Sensor, setting: Setting) -> None:
        self.sensor, self.setting = sensor.seated, setting

    @cached_property
    def times(self) -> NDArray[np.int64]:
        """When it measures, from 0 [ns], shape [measurements], ascending.

        Of an image the middle of its exposure, of a sweep its first firing.
        """
        step = NANOSECONDS / self.sensor.rate_hz
        count = int(self.setting.motion.end * NANOSECONDS / step + 1e-6) + 1
        return np.asarray(np.round(step * np.arange(count)), np.int64)

    @cached_property
    def mount(self) -> tuple[Array, Array]:
        """Place in its link's frame [m] and rotation to it."""
        turn = matrix(quaternion_from_rpy(self.sensor.rpy))
        return self.sensor.position, turn

    @cached_property
    def _origin(self) -> Array:
        """Where its link's frame lies in base_link's [m], if it does not move there."""
        return np.asarray(self.setting.world.rover.origins[self.sensor.link])

    def drawn(self, what: int, *shape: int) -> Array:
        """Standard normal numbers of its own that are drawn once; `what` tells them from others."""
        key = np.uint64(mix(self.setting.key(self.sensor), what))
        return np.asarray(normals(key, math.prod(shape)).reshape(shape))

    def state(self, time: Array) -> State:
        """The state of the sensor's own frame at times [s]."""
        motion, link = self.setting.motion, self.sensor.link
        base, (place, turn) = motion.base.at(time), self.mount
        if (curve := motion.by_link.get(link)) is None:
            return base.at_mount(self._origin + place, turn)
        return on_moving_link(base, curve.at(time)).at_mount(place, turn)

    @cached_property
    def parts(self) -> tuple[Instrument, ...]:
        """The instruments that a recording has folders of: itself, or those that it consists of."""
        return (self,)

    @abstractmethod
    def streams(self) -> tuple[Stream, ...]:
        """What it writes."""
        raise NotImplementedError

    @abstractmethod
    def calibration(self) -> dict[str, Any]:
        """What a reader must know of the sensor, as plain data in SI units."""
        raise NotImplementedError

    def check(self) -> None:
        """Refuse what cannot be measured, before anything is.

        Raises:
            RecipeError: naming the sensor's field.
        """


class Frames(Instrument):
    """An instrument that measures now and then, each measurement files of its own."""

    @abstractmethod
    def measure(self, number: int) -> dict[str, bytes]:
        """The files of a measurement by the names of their streams."""
        raise NotImplementedError

    def tables(self, numbers: Sequence[int]) -> Mapping[str, Mapping[str, Array]]:  # noqa: ARG002
        """Tables beside its files by their names: columns of the measurements of some numbers."""
        return {}

    def require(self, number: int) -> None:
        """Refuse a number that no measurement has.

        Raises:
            DataError: says which there are.
        """
        require_measurement(number, len(self.times), self.sensor.name)


class Series(Instrument):
    """An instrument whose measurements are the rows of one table: samples of the motion."""

    @classmethod
    def require_logged(cls, sensor: Sensor, step: float) -> None:
        """Refuse a sensor that measures more often than a drive is logged, each step [s].

        Raises:
            RecipeError: says how often that is.
        """
        if sensor.rate_hz * step > 1.0 + 1e-9:
            raise RecipeError(
                f"{sensor.name!r}: rate_hz {sensor.rate_hz:g} is more than a drive is logged at, "
                f"{1.0 / step:g} Hz",
                key=("sensors",),
            )

    @abstractmethod
    def samples(self) -> dict[str, Array]:
        """All samples: columns by their names, in the order of `times`, shape [measurements]."""
        raise NotImplementedError


def on_moving_link(base: State, link: State) -> State:
    """The state in the world of a link whose state in the frame of a moving base is known."""
    turned = base.at_mount(np.zeros(3), np.eye(3))
    arm, speed, push = link.position, link.velocity, link.acceleration
    spin, change = base.rate, base.rate_change
    carried = np.cross(spin, arm)
    velocity = speed + carried
    acceleration = (
        push + 2.0 * np.cross(spin, speed) + np.cross(change, arm) + np.cross(spin, carried)
    )
    back = np.swapaxes(link.rotation, -1, -2)

    def into(turn: Array, vectors: Array) -> Array:
        return np.asarray((turn * vectors[:, None, :]).sum(axis=-1))

    own = into(back, spin)
    return State(
        position=turned.position + into(base.rotation, arm),
        rotation=np.einsum("nij,njk->nik", base.rotation, link.rotation),
        velocity=turned.velocity + into(base.rotation, velocity),
        acceleration=turned.acceleration + into(base.rotation, acceleration),
        rate=own + link.rate,
        rate_change=into(back, change) + np.cross(own, link.rate) + link.rate_change,
    )


def instruments_of(setting: Setting) -> tuple[Instrument, ...]:
    """The instruments of the rover's sensors that can be recorded, in the order of its rig.

    A stereo pair is two, whose sensors are `simple` ones: NAME_left and NAME_right.
    """
    kinds = instrument_kinds()
    wholes = [
        kinds[sensor.kind](sensor, setting)
        for sensor in setting.world.rover.sensors
        if sensor.kind in kinds
    ]
    return tuple(part for whole in wholes for part in whole.parts)


@cache
def instrument_kinds() -> dict[str, type[Instrument]]:
    """All installed instruments by the kind of sensor that they measure for."""
    found = parts(Instrument, "terrain_forge.sensors.instruments", GROUP, refused=_refused_folder)
    return {one.kind: one for one in found}


def _refused_folder(instrument: type[Instrument]) -> str:
    of_files = {one.folder for one in Frames.__subclasses__() if is_ours(one.__module__)}
    taken = {_TRUTH, *(of_files if issubclass(instrument, Series) else ())}
    why = refused_name(instrument.folder, taken, "recording")
    return why and f"has a wrong folder: {why}"


def is_folder(name: str, kinds: Iterable[type[Instrument]]) -> bool:
    """Whether a recording's folder of some instruments may be called so, such as `cam0`."""
    return any(re.fullmatch(f"{re.escape(one.folder)}[0-9]+", name) for one in kinds)
