"""What the named shapes of routes have in common: a wanted length or size, a place, a direction."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from terrain_forge.base import (
    Array,
    Key,
    Pair,
    Positive,
    RecipeError,
    Spec,
    is_ours,
    portable,
    returning,
)
from terrain_forge.paths.curves import SHARPEST, Curve, trace

Planar = Callable[[Array], Array]

_FARTHEST = 0.5
"""Between two points of a curve of another package's [m]."""
_SAMPLES = 20_000
"""Parameters from which a smooth shape's length is measured: within 1e-7."""


@dataclass(frozen=True, kw_only=True)
class NamedShape(Spec):
    """A route of a known form, anywhere on the site.

    A shape is a subclass with a field `kind` (a Literal with its default); it must have
    `outline`. It is found if its module lies in `terrain_forge.paths.shapes` or is named by an
    entry point of the group `terrain_forge.route_shapes`.
    """

    if TYPE_CHECKING:
        kind: str
        """Name of the shape, as a recipe writes it."""

    length_m: Positive | None = None
    """Length of the route [m]."""
    size_m: Positive | None = None
    """Extent along the shape's own x axis [m]; one of length and size is needed."""
    centre_m: Pair = (0.0, 0.0)
    """Centre, metres east and north of the site's centre."""
    orientation_deg: Annotated[float, Interval(ge=-360, le=360)] = 0.0
    """How far the shape is turned anticlockwise [degrees]; at 0 its x axis points east."""

    closed: ClassVar[bool] = True
    """Whether it ends where it begins."""

    @abstractmethod
    def outline(self, key: Key) -> Curve:
        """The curve around the origin, its x axis pointing east; the key is the shape's place.

        Raises:
            RecipeError: if length or size are too short for it.
        """
        raise NotImplementedError

    def curve(self, key: Key) -> Curve:
        """The curve on the site, its length that of the recipe within 0.1 %.

        Raises:
            RecipeError: if neither or both of length and size are given, or if they are too short
                for the shape's corners or rows.
        """
        if (self.length_m is None) == (self.size_m is None):
            found = "neither" if self.length_m is None else "both"
            raise RecipeError(f"one of length_m and size_m is needed, found {found}", key=key)
        angle = math.radians(self.orientation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        allowed = (
            f"a Curve of at least two points up to {_FARTHEST:g} m apart, its heading along it"
        )
        with returning(self, f"route shape {self.kind!r}: outline", allowed):
            outline = self.outline(key)
            _require_curve(outline)
            if not is_ours(type(self).__module__):
                _require_along(outline)
            turned = portable.product(outline.position, np.array([[cos, sin], [-sin, cos]]))
            return Curve(
                position=turned + np.asarray(self.centre_m),
                heading=outline.heading + angle,
                turns=outline.turns,
            )

    def smooth(
        self, curve: Planar, tangent: Planar, ends: tuple[float, float] = (0.0, 2.0 * np.pi)
    ) -> Curve:
        """A smooth shape of the wanted length or size, from one of any size and its derivative."""
        points = curve(np.linspace(*ends, _SAMPLES + 1))
        unit = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        size = self.size_m or 0.0
        scale = self.length_m / unit if self.length_m else size / np.ptp(points[:, 0])
        return trace(lambda t: scale * curve(t), tangent, ends, samples=_SAMPLES)

    def check_side(
        self, side: float, *, least: float, pieces: int, length: float, key: Key
    ) -> None:
        """Refuse sides of a route that are shorter than the arcs around their corners need [m]."""
        if side <= 0.0 or side < least * (1.0 - 1e-9):
            given = "size_m" if self.size_m else "length_m"
            shortest = length + pieces * (least - side)
            found, needed = (side, least) if self.size_m else (length, shortest)
            raise RecipeError(
                f"{found:g} m leave no room for the shape's corners, more than {needed:.4g} m do",
                key=(*key, given),
            )


def _require_curve(outline: Curve) -> None:
    if not isinstance(outline, Curve):
        raise TypeError(f"found {type(outline).__name__}")
    points = len(outline.position)
    shapes = np.shape(outline.position), np.shape(outline.heading)
    if points < 2 or shapes != ((points, 2), (points,)):
        raise ValueError("found position and heading of shapes {} and {}".format(*shapes))
    if not (np.isfinite(outline.position).all() and np.isfinite(outline.heading).all()):
        raise ValueError("found numbers that are not finite")


def _require_along(outline: Curve) -> None:
    """Refuse points that are far apart, and a heading that is not the direction of travel."""
    steps, heading = np.diff(outline.position, axis=0), outline.heading
    lengths = np.linalg.norm(steps, axis=1)
    if lengths.max() > _FARTHEST:
        at = int(np.argmax(lengths))
        raise ValueError(f"found points {at} and {at + 1} {lengths[at]:.3g} m apart")
    moving = lengths > 1e-9
    along = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.abs(np.diff(heading))
    off = [
        np.abs((along - end + np.pi) % (2.0 * np.pi) - np.pi) for end in (heading[:-1], heading[1:])
    ]
    wrong = moving & (np.max([*off, 0.5 * turn], axis=0) > SHARPEST)
    if wrong.any():
        at = int(np.argmax(wrong))
        raise ValueError(
            f"found heading {heading[at]:.2f} and {heading[at + 1]:.2f} rad at points {at} and "
            f"{at + 1}, of which one lies at {along[at]:.2f} rad from the other"
        )


def pair(x: Planar, y: Planar) -> Planar:
    """Points of two functions of a parameter."""
    return lambda t: np.stack([x(t), y(t)], -1)


def shortening(radius: float, turn: float) -> float:
    """By how much an arc around a corner is shorter than the corner [m]."""
    return radius * (2.0 * math.tan(0.5 * turn) - turn)
