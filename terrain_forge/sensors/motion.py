"""How a rover moves, as one smooth curve that all its sensors measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, DataError, Record, shaped
from terrain_forge.model import Trajectory
from terrain_forge.sensors.kinematics import mounted, turning

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_DEGREE, _REACH = 5, 4


@dataclass(frozen=True, kw_only=True, eq=False)
class State(Record):
    """How a frame stands and moves at some times; derivatives are those of one curve."""

    position: Array = field(metadata=shaped("times", 3))
    """Origin in the world frame [m], shape [times, 3]."""
    rotation: Array = field(metadata=shaped("times", 3, 3))
    """Rotation to the world frame, shape [times, 3, 3]."""
    velocity: Array = field(metadata=shaped("times", 3))
    """Of the origin in the world frame [m/s], shape [times, 3]."""
    acceleration: Array = field(metadata=shaped("times", 3))
    """Of the origin in the world frame [m/s²], shape [times, 3]."""
    rate: Array = field(metadata=shaped("times", 3))
    """Angular rate in the frame itself [rad/s], shape [times, 3]."""
    rate_change: Array = field(metadata=shaped("times", 3))
    """Its derivative [rad/s²], shape [times, 3]."""

    def at_mount(self, position: Array, rotation: Array) -> State:
        """The state of a frame that is fixed to this one.

        Args:
            position: Its origin in this frame [m], shape [3].
            rotation: From it to this frame, shape [3, 3].
        """
        state = self.position, self.rotation, self.velocity, self.acceleration
        found = mounted(*state, self.rate, self.rate_change, np.array(position), np.array(rotation))
        return State(**dict(zip(_FIELDS, found, strict=True)))


_FIELDS = ("position", "rotation", "velocity", "acceleration", "rate", "rate_change")


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve(Record):
    """The motion of a frame: a quintic B-spline of place and roll, pitch, yaw (C⁴).

    Its controls are samples corrected by a quarter of their second difference, which cancels the
    spline's own smoothing to the fourth order and, unlike interpolation, does not ring where the
    samples have a corner (quasi-interpolation: de Boor & Fix
    1973, Journal of Approximation Theory 8, 19).
    """

    begin: float
    """Time of the first sample [s]."""
    step: float
    """Time between samples [s]."""
    samples: Array = field(metadata=shaped("samples", 6))
    """East, north, up [m], roll, pitch, yaw [rad], continuous, shape [samples, 6]."""

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.begin + self.step * (len(self.samples) - 1)

    @cached_property
    def _splines(self) -> tuple[BSpline, BSpline, BSpline]:
        from scipy.interpolate import BSpline

        ahead = np.arange(1, 5)[:, None]
        first, last = self.samples[:1], self.samples[-1:]
        before = first - ahead[::-1] * (self.samples[1:2] - first)
        after = last + ahead * (last - self.samples[-2:-1])
        values = np.concatenate([before, self.samples, after])
        controls = values[1:-1] - 0.25 * (values[2:] - 2.0 * values[1:-1] + values[:-2])
        half = (_DEGREE + 1) // 2
        knots = self.begin + self.step * (np.arange(len(controls) + _DEGREE + 1) - 3 - half)
        whole = BSpline(knots, controls, _DEGREE, extrapolate=False)
        return whole, whole.derivative(1), whole.derivative(2)

    def at(self, time: ArrayLike) -> State:
        """The state at times [s].

        Raises:
            DataError: for a time before the begin or after the end.
        """
        times = np.atleast_1d(np.asarray(time, dtype=np.float64))
        slack = 1e-6 * self.step
        if times.size and not (
            self.begin - slack <= times.min() and times.max() <= self.end + slack
        ):
            raise DataError(
                f"time {times.min():.6f} to {times.max():.6f} s, the motion lasts from "
                f"{self.begin:.6f} to {self.end:.6f} s"
            )
        value, first, second = (spline(times) for spline in self._splines)
        rotation, rate, change = turning(value[:, 3:], first[:, 3:], second[:, 3:])
        return State(
            position=value[:, :3],
            rotation=rotation,
            velocity=first[:, :3],
            acceleration=second[:, :3],
            rate=rate,
            rate_change=change,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion(Record):
    """How a rover moves in a recording: `base_link`, and links that move against it."""

    path: str
    """Name of the path."""
    source: str
    """`path`, the ideal motion, or `drive`, that of the simulated suspension."""
    base: Curve
    """`base_link` in the world frame."""
    links: tuple[tuple[str, Curve], ...] = ()
    """Other links that move, by their names, in base_link's frame (wheels, rockers, a mast)."""
    wheels: Array | None = field(default=None, metadata=shaped("looks", "wheels"))
    """Angles of the wheels about their axles [rad], forwards positive, at the samples of `base`, in
    the order of the rover's wheels; None where nothing was simulated."""
    ended: str = ""
    """Why it ends before the path does; empty where it does not."""

    @property
    def end(self) -> float:
        """How long it lasts [s], from 0."""
        return self.base.end

    @cached_property
    def by_link(self) -> Mapping[str, Curve]:
        """The curves of moving links by their names."""
        return dict(self.links)


def motion_of_path(trajectory: Trajectory, *, still: float = 0.0, ramp: float = 2.0) -> Motion:
    """The ideal motion along a path: it stands still, starts and stops without a jolt.

    Args:
        trajectory: The path.
        still: How long it stands before it starts, and after it stopped [s].
        ramp: How long it takes to start and to stop [s]: the path's time then passes by a
            polynomial whose first three derivatives vanish at both ends, which limits the jerk; 0
            to begin and end at the path's own speed, for `still` of 0.

    Raises:
        DataError: if the path lasts shorter than a ramp.
    """
    length = float(trajectory.time[-1] - trajectory.time[0])
    if still > 0.0 or ramp > 0.0:
        ramp = max(ramp, 0.1)
        if length < ramp:
            raise DataError(
                f"path {trajectory.name!r} lasts {length:.3g} s, starting and stopping takes "
                f"{ramp:g} s"
            )
    step = float(np.median(np.diff(trajectory.time)))
    if still:  # the curve is at rest where its nearest samples are, four to each side
        still += _REACH * step
    count = int(np.ceil((length + 2.0 * still + ramp) / step - 1e-9)) + 1
    times: Array = np.asarray(step * np.arange(count), np.float64)
    passed = _eased(times - still, length, ramp) if ramp else np.minimum(times, length)
    columns = np.hstack([trajectory.position, trajectory.rpy])
    own = trajectory.time - trajectory.time[0]
    samples = np.stack([np.interp(passed, own, column) for column in columns.T], axis=1)
    base = Curve(begin=0.0, step=step, samples=samples)
    return Motion(path=trajectory.name, source="path", base=base)


def _eased(time: Array, length: float, ramp: float) -> Array:
    """The path's time after some time: its speed rises from 0 to 1, and falls again at the end."""

    def risen(t: Array) -> Array:  # integral of the smoothstep of the third order, from 0
        u = np.clip(t / ramp, 0.0, 1.0)
        inside = u**5 * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)))
        return ramp * inside + np.maximum(t - ramp, 0.0)

    return np.asarray(risen(time) - risen(time - length))
