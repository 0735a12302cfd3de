"""Where the rover's links are in base_link's frame at a time of its motion."""

from __future__ import annotations

import math

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion
from terrain_forge.model import Rover
from terrain_forge.sensors.motion import Motion


class RoverLinks:
    """The places of a rover's links during a motion.

    Wheels turn as the motion says, or else roll without slip; other links that do not move by the
    motion are as at rest.
    """

    def __init__(self, rover: Rover, motion: Motion) -> None:
        self.rover, self.motion = rover, motion
        sides = {link.name: link.axis[1] for link in rover.links}
        self._sides = np.array([1.0 if sides[w.link] > 0.0 else -1.0 for w in rover.wheels])
        self._angles = rolled(rover, motion) if motion.wheels is None else motion.wheels
        self._wheels = {wheel.link: number for number, wheel in enumerate(rover.wheels)}

    def at(self, time: float) -> dict[str, tuple[Array, Array]]:
        """Each link's origin in base_link's frame [m] and rotation to it, by its name."""
        base = self.motion.base
        look = min(max((time - base.begin) / base.step, 0.0), len(self._angles) - 1.0)
        first = min(int(look), max(len(self._angles) - 2, 0))
        before, after = self._angles[first], self._angles[min(first + 1, len(self._angles) - 1)]
        angles = self._sides * (before + (look - first) * (after - before))
        places: dict[str, tuple[Array, Array]] = {}
        for link in self.rover.links:
            if (curve := self.motion.by_link.get(link.name)) is not None:
                state = curve.at(time)
                places[link.name] = state.position[0], state.rotation[0]
                continue
            origin, turn = places.get(link.parent, (np.zeros(3), np.eye(3)))
            place = origin + (turn * link.origin).sum(axis=-1) if link.parent else origin
            if (wheel := self._wheels.get(link.name)) is not None:
                half = 0.5 * float(angles[wheel])
                spin = np.array([math.cos(half), *(math.sin(half) * link.axis)])
                turn = np.einsum("ij,jk->ik", turn, matrix_from_quaternion(spin))
            places[link.name] = place, turn
        return places


def rolled(rover: Rover, motion: Motion) -> Array:
    """Angles of wheels that roll without slip [rad], forwards positive, shape [looks, wheels]."""
    base = motion.base
    time = base.begin + base.step * np.arange(len(base.samples))
    state = base.at(np.minimum(time, base.end))
    speed = (state.rotation[:, :, 0] * state.velocity).sum(axis=1)  # along base_link's x axis
    centres = rover.wheel_centres.reshape(-1, 3)
    hubs = speed[:, None] + (
        state.rate[:, 1:2] * centres[:, 2] - state.rate[:, 2:3] * centres[:, 1]
    )
    rates = hubs / rover.wheel_radii
    steps = 0.5 * base.step * (rates[:-1] + rates[1:])
    return np.concatenate([np.zeros((1, len(centres))), np.cumsum(steps, axis=0)])
