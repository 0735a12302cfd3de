"""Named shapes of routes, each of a wanted length or size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from terrain_forge.base import NotNegative, Pair, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class NamedShape(Spec):
    """What the named shapes have in common."""

    length_m: Positive | None = None
    """Length of the route [m]."""
    size_m: Positive | None = None
    """Extent along the shape's own x axis [m]; one of length and size is needed."""
    centre_m: Pair = (0.0, 0.0)
    """Centre, metres east and north of the site's centre."""
    orientation_deg: Annotated[float, Interval(ge=-360, le=360)] = 0.0
    """How far the shape is turned anticlockwise [degrees]; at 0 its x axis points east."""


@dataclass(frozen=True, kw_only=True)
class Loop(NamedShape):
    """A circle or an ellipse, anticlockwise from its eastern end."""

    kind: Literal["loop"] = "loop"
    aspect: Annotated[float, Interval(ge=0.1, le=1)] = 1.0
    """Its y axis over its x axis."""


@dataclass(frozen=True, kw_only=True)
class Triangle(NamedShape):
    """An equilateral triangle around its centre, anticlockwise along its southern side first."""

    kind: Literal["triangle"] = "triangle"
    corner_radius_m: NotNegative = 0.0
    """Radius of the arcs around its corners [m]; at 0 the rover turns on the spot there."""


@dataclass(frozen=True, kw_only=True)
class Lawnmower(NamedShape):
    """Parallel rows, driven to and fro from the south-western end."""

    kind: Literal["lawnmower"] = "lawnmower"
    rows: Annotated[int, Interval(ge=2, le=1000)] = 5
    """Number of rows."""
    row_spacing_m: Positive = 2.0
    """Distance of neighbouring rows [m]."""
    corner_radius_m: NotNegative | None = None
    """Radius of the arcs from row to row [m]; half the rows' distance by default, at 0 the rover
    turns on the spot."""


@dataclass(frozen=True, kw_only=True)
class Spiral(NamedShape):
    """An Archimedean spiral, anticlockwise from near its centre outwards."""

    kind: Literal["spiral"] = "spiral"
    turns: Annotated[float, Interval(ge=1, le=1000)] = 3.0
    """Number of turns; the first begins half an arm's distance from the centre."""


@dataclass(frozen=True, kw_only=True)
class FigureEight(NamedShape):
    """A lying eight (Gerono's lemniscate), from its crossing towards the north-east first."""

    kind: Literal["figure_eight"] = "figure_eight"
