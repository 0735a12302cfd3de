"""What the ground is made of, for labels: craters, bedforms of the wind, wheel tracks."""

from __future__ import annotations

from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel
from terrain_forge.model import World, merge
from terrain_forge.scene import GROUND, MISSED, OUTSIDE, prepare_wheels
from terrain_forge.sensors.instrument import Setting
from terrain_forge.sensors.scenery import Scenery
from terrain_forge.terrain import Ripples, mask_weight
from terrain_forge.truth import craters_of

CLASSES = ("ground", "crater", "rock", "ripple", "track", "rover", "sky", "beyond")
"""Classes of pixels by their numbers; `beyond` is the ground beyond the site."""
SOIL, CRATER, ROCK, RIPPLE, TRACK, ROVER, SKY, BEYOND = range(len(CLASSES))

_FEWEST_CELLS = 4.0


class Labels:
    """The classes of a world's places, and the ids of its rocks."""

    def __init__(self, scenery: Scenery) -> None:
        world, scene = scenery.world, scenery.scene
        rocks = merge(world.field, world.neighbours)
        self.ids: NDArray[np.int32] = rocks.id
        """Ids by the rows that rays tell, shape [rocks]."""
        self.kinds = _kinds(world)
        """Class of the ground at its nodes, shape [rows, columns]."""
        self._wheels = prepare_wheels(scene, scenery.motion.base.samples[:, :2])
        east, north, _ = scene.origin.tolist()
        corner = world.ground.origin[0] - east, world.ground.origin[1] - north
        self._frame = (east, north), corner, world.ground.spacing

    def of(self, points: Array, seen: NDArray[np.int32], behind: float) -> NDArray[np.uint8]:
        """Classes of what rays met.

        Args:
            points: Where [m], shape [rays, 3]; not read where nothing was met.
            seen: What: row of a rock, or GROUND, MISSED, OUTSIDE, BODY of `scene`, shape [rays].
            behind: How far along the motion wheels have left tracks [m].
        """
        classes = np.empty(len(seen), dtype=np.uint8)
        wheels = self._wheels
        strip = float(wheels.half_gauge), 0.5 * float(wheels.width)
        tracks = wheels.newest, wheels.passes, wheels.points, *strip
        _classify(points, seen, self.kinds, *self._frame, tracks, behind, classes)
        return classes


_KEPT: WeakKeyDictionary[Setting, Labels] = WeakKeyDictionary()
_LOCK = Lock()


def labels_of(setting: Setting) -> Labels:
    """The labels of a setting's world, made once."""
    with _LOCK:
        if setting not in _KEPT:
            _KEPT[setting] = Labels(setting.scenery)
        return _KEPT[setting]


def _kinds(world: World) -> NDArray[np.uint8]:
    """Class of each node: bedforms where their layer moves it, craters within their rims.

    Craters count that show and are wide enough for the grid. They come before bedforms,
    which they are wider than or have broken up.
    """
    site, ground = world.site, world.ground
    kinds = np.zeros(ground.shape, dtype=np.uint8)
    window, heights = world.window, ground.elevation.astype(np.float64)
    for layer in site.recipe.terrain.layers:
        if isinstance(layer, Ripples):
            kinds[layer.masked_relief(site=site, window=window, elevation=heights) != 0.0] = RIPPLE
    for made, craters in craters_of(world):
        wide = craters.diameter >= _FEWEST_CELLS * ground.spacing
        seen = craters.select(craters.shows & wide)
        places = np.ascontiguousarray((seen.xy - ground.origin) / ground.spacing)
        within = kinds.copy()
        _stamp(places, 0.5 * seen.diameter / ground.spacing, np.uint8(CRATER), within)
        if made.mask is not None:
            weight = mask_weight(made.mask, site=site, window=window, elevation=heights)
            within = np.where(weight < 0.5, kinds, within)
        kinds = within
    return kinds


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
def _classify(  # type: ignore[no-untyped-def]
    points, seen, kinds, origin, corner, spacing, tracks, behind, classes
):
    rows, columns = kinds.shape
    newest, passes, path, half_gauge, half_width = tracks
    for n in range(len(seen)):
        if seen[n] != GROUND:
            far = SKY if seen[n] == MISSED else BEYOND if seen[n] == OUTSIDE else ROVER
            classes[n] = ROCK if seen[n] >= 0 else far
            continue
        x, y = points[n, 0] - origin[0], points[n, 1] - origin[1]
        i = min(max(int(np.floor((x - corner[0]) / spacing + 0.5)), 0), columns - 1)
        j = min(max(int(np.floor((y - corner[1]) / spacing + 0.5)), 0), rows - 1)
        classes[n] = kinds[j, i]
        one = newest[j, i]
        while one >= 0:  # any pass that was there already
            at, one = passes[one, 0], passes[one, 1]
            east, north = x - path[at, 0], y - path[at, 1]
            if 0.0 < path[at, 4] + east * path[at, 2] + north * path[at, 3] <= behind:
                aside = abs(north * path[at, 2] - east * path[at, 3])
                if abs(aside - half_gauge) <= half_width:
                    classes[n] = TRACK
                    break
