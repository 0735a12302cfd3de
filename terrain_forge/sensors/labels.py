"""What the ground is made of, for labels: craters, bedforms of the wind, wheel tracks."""

from __future__ import annotations

from threading import Lock
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel
from terrain_forge.model import World, merge
from terrain_forge.scene import subject_of
from terrain_forge.sensors.instrument import Setting
from terrain_forge.terrain import Ripples
from terrain_forge.truth import craters_of

CLASSES = ("ground", "crater", "rock", "ripple", "track", "rover", "sky", "beyond")
"""Classes of pixels by their numbers; `beyond` is the ground beyond the site."""
GROUND, CRATER, ROCK, RIPPLE, TRACK, ROVER, SKY, BEYOND = range(len(CLASSES))

_STEP, _CELL = 0.05, 0.25
"""Between points of a path, and side of the cells that find them [m]."""


class Tracks(NamedTuple):
    """Points of the driven path, sorted into the cells that wheels beside them reach."""

    points: Array
    """Place, direction, distance along [m], shape [points, 5]."""
    first: NDArray[np.int64]
    """Where each cell's points begin in `near`, row by row, shape [cells + 1]."""
    near: NDArray[np.int64]
    """Points of the cells."""
    corner: tuple[float, float]
    """South-west corner of the cells [m]."""
    columns: int
    """Cells of a row."""
    half_gauge: float
    """Sideways distance of the wheels from the path [m]."""
    half_width: float
    """Half of a wheel's width [m]."""


class Labels:
    """The classes of a world's places, and the ids of its rocks."""

    def __init__(self, world: World, path: str) -> None:
        rocks = merge(world.field, world.neighbours)
        self.ids: NDArray[np.int32] = rocks.id
        """Ids by the rows that rays tell, shape [rocks]."""
        self.kinds = _kinds(world)
        """Class of the ground at its nodes, shape [rows, columns]."""
        self._ground = world.ground
        self.path = _driven(world, path)
        """Points of the path at equal steps: place, direction, distance, shape [points, 5]."""
        subject = subject_of(world)
        self._tracks = _sorted_into_cells(self.path, subject.half_gauge, 0.5 * subject.wheel_width)

    def distance_at(self, places: Array) -> Array:
        """How far along the path successive places of a rover on it are [m], shape [places].

        Never less than before, nor farther than what lies within a metre of the place before.
        """
        found: Array = _followed(self.path, np.ascontiguousarray(places, np.float64))
        return found

    def of(self, points: Array, seen: NDArray[np.int32], behind: float) -> NDArray[np.uint8]:
        """Classes of what rays met.

        Args:
            points: Where [m], shape [rays, 3]; not read where nothing was met.
            seen: What: row of a rock, or -1 ground, -2 nothing, -3 beyond, -4 rover, shape [rays].
            behind: How far along the path the rover has left tracks [m].
        """
        ground = self._ground
        frame = ground.origin, ground.spacing
        classes = np.empty(len(seen), dtype=np.uint8)
        _classify(points, seen, self.kinds, *frame, self._tracks, behind, classes)
        return classes


_KEPT: WeakKeyDictionary[Setting, Labels] = WeakKeyDictionary()
_LOCK = Lock()


def labels_of(setting: Setting) -> Labels:
    """The labels of a setting's world, made once."""
    with _LOCK:
        if setting not in _KEPT:
            _KEPT[setting] = Labels(setting.world, setting.motion.path)
        return _KEPT[setting]


def _kinds(world: World) -> NDArray[np.uint8]:
    """Class of each node: bedforms where their layer moves it, craters within their rims."""
    site, ground = world.site, world.ground
    kinds = np.zeros(ground.shape, dtype=np.uint8)
    heights = ground.elevation.astype(np.float64)
    for layer in site.recipe.terrain.layers:
        if isinstance(layer, Ripples):
            moved = layer.masked_relief(site=site, window=world.window, elevation=heights)
            kinds[np.abs(moved) > 0.0] = RIPPLE
    for _, craters in craters_of(world):
        places = np.ascontiguousarray((craters.xy - ground.origin) / ground.spacing)
        _stamp(places, 0.5 * craters.diameter / ground.spacing, np.uint8(CRATER), kinds)
    return kinds


def _driven(world: World, path: str) -> Array:
    """The path of that name at equal steps."""
    for trajectory in world.trajectories:
        if trajectory.name == path:
            plan = trajectory.position[:, :2]
            steps = np.hypot(*np.diff(plan, axis=0).T)
            moving = np.concatenate([[True], steps > 0.0])
            along = np.concatenate([[0.0], np.cumsum(steps)])[moving]
            plan = plan[moving]
            if len(plan) < 2:
                break
            at = np.linspace(0.0, along[-1], max(2, int(np.ceil(along[-1] / _STEP)) + 1))
            place = np.stack([np.interp(at, along, plan[:, axis]) for axis in range(2)], axis=-1)
            heading = np.gradient(place, at, axis=0)
            heading /= np.maximum(np.sqrt((heading**2).sum(axis=1)), 1e-300)[:, None]
            return np.column_stack([place, heading, at])
    return np.zeros((0, 5))


def _sorted_into_cells(points: Array, half_gauge: float, half_width: float) -> Tracks:
    if len(points) == 0:
        empty = np.zeros(0, np.int64)
        return Tracks(points, np.zeros(2, np.int64), empty, (0.0, 0.0), 0, half_gauge, half_width)
    reach = int(np.ceil((half_gauge + half_width + _STEP) / _CELL)) + 1
    corner = points[:, :2].min(axis=0) - (reach + 1) * _CELL
    cell = np.floor((points[:, :2] - corner) / _CELL).astype(np.int64)
    columns, rows = (int(most) + reach + 2 for most in cell.max(axis=0))
    around = np.arange(-reach, reach + 1)
    spots = cell[:, 0, None, None] + around + columns * (cell[:, 1, None, None] + around[:, None])
    who = np.repeat(np.arange(len(points)), len(around) ** 2)
    where = spots.reshape(-1)
    order = np.argsort(where, kind="stable")
    first = np.searchsorted(where[order], np.arange(columns * rows + 1))
    at = float(corner[0]), float(corner[1])
    return Tracks(points, first, who[order], at, columns, half_gauge, half_width)


@kernel
def _stamp(places, radii, kind, kinds):  # type: ignore[no-untyped-def]
    """Set the nodes within circles, all in spacings."""
    rows, columns = kinds.shape
    for n in range(len(places)):
        x, y, r = places[n, 0], places[n, 1], radii[n]
        for j in range(max(0, int(np.ceil(y - r))), min(rows - 1, int(np.floor(y + r))) + 1):
            half = np.sqrt(max(r * r - (j - y) ** 2, 0.0))
            west, east = int(np.ceil(x - half)), int(np.floor(x + half))
            kinds[j, max(0, west) : max(0, min(columns - 1, east) + 1)] = kind


@kernel
def _followed(path, places):  # type: ignore[no-untyped-def]
    found, at = np.zeros(len(places)), 0
    for n in range(len(places)):
        best = np.inf
        for m in range(at, min(len(path), at + 21)):
            away = (path[m, 0] - places[n, 0]) ** 2 + (path[m, 1] - places[n, 1]) ** 2
            if away < best:
                best, at = away, m
        if len(path):
            east, north = places[n, 0] - path[at, 0], places[n, 1] - path[at, 1]
            past = east * path[at, 2] + north * path[at, 3]
            found[n] = path[at, 4] + min(max(past, -_STEP), _STEP)
            if n:
                found[n] = max(found[n], found[n - 1])
    return found


@kernel
def _classify(points, seen, kinds, origin, spacing, tracks, behind, classes):  # type: ignore[no-untyped-def]
    rows, columns = kinds.shape
    for n in range(len(seen)):
        if seen[n] >= 0:
            classes[n] = ROCK
            continue
        if seen[n] != -1:
            classes[n] = SKY if seen[n] == -2 else BEYOND if seen[n] == -3 else ROVER
            continue
        x, y = points[n, 0], points[n, 1]
        i = min(max(int(np.rint((x - origin[0]) / spacing)), 0), columns - 1)
        j = min(max(int(np.rint((y - origin[1]) / spacing)), 0), rows - 1)
        classes[n] = kinds[j, i]
        i = int(np.floor((x - tracks.corner[0]) / _CELL))
        j = int(np.floor((y - tracks.corner[1]) / _CELL))
        cell = j * tracks.columns + i
        if not (0 <= i < tracks.columns and 0 <= cell < len(tracks.first) - 1):
            continue
        for m in range(tracks.first[cell], tracks.first[cell + 1]):
            p = tracks.near[m]
            east, north = x - tracks.points[p, 0], y - tracks.points[p, 1]
            along = east * tracks.points[p, 2] + north * tracks.points[p, 3]
            aside = north * tracks.points[p, 2] - east * tracks.points[p, 3]
            beside = abs(abs(aside) - tracks.half_gauge) <= tracks.half_width
            if beside and abs(along) <= 0.6 * _STEP and tracks.points[p, 4] + along <= behind:
                classes[n] = TRACK
                break
