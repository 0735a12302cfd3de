"""Soil that banks up against rocks: drifts and wind tails, moats, lunar fillets, in the ground.

Known before the rocks are embedded, since a rock's bank hangs on its place, shape, diameter and
drawn burial alone, so that what embeds them has the ground as it will be. Outside a rock's outline
the bank runs out as (1 - d / w)², with 25° at the rock; beneath the rock, where nobody sees it, it
goes down to the lowest that it has anywhere around. So the ground at a rock's centre is the lowest
soil that touches it, from which its diameter and its burial count. Banks that meet are as high as
the higher, and as deep as the deeper, so that no order of the rocks changes the ground. Soil fills
what is rough beneath it: the thicker it is, the nearer the ground comes to the mean of the nodes
around.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    inner,
    kernel,
    mix,
    over_chunks,
    portable,
    remembered,
    stage_key,
    uniform,
)
from terrain_forge.model import Heightfield, RockLibrary, RockPrototype, Site
from terrain_forge.rocks.contact import (
    FilletContact,
    NoContact,
    WindContact,
    contact_of,
    wear_rate,
    wind_from,
)
from terrain_forge.rocks.embedding.exposure import DEEPEST, exposure
from terrain_forge.rocks.embedding.outline import edges, exposed_diameter, exposed_points
from terrain_forge.rocks.scattering.scatter import Scattered

FILLED = 3
"""Nodes around one over whose mean soil lies even."""

_CONTACT_SLOPE = 0.466
"""Rise of a bank where it meets its rock: 25°."""
_FLANK = 0.577
"""Largest rise of a tail's flanks: 30°, less than sand rests at."""
_HIGHEST_ROCK = 0.8
"""Height over diameter above which rocks count as no higher."""
_HIGHEST_BANK = 0.4
"""Height of a bank over its rock's, at most."""
_LONGEST = 1.5
"""Length of a tail over the mean, at most."""
_FEWEST, _FULL = 2.0, 3.0
"""Diameters, in spacings, from which a bank is there and from which in full height."""
_BLUR = 0.7
"""How far a bank goes on before it falls, in spacings: nodes do not lie at outlines."""
_JITTER = np.radians(15.0)
_DIRECTIONS = 32
_BURIED = 0.275  # part of a rock below the ground for its outline
_TAIL_WIDTH = 0.45  # half of it, in diameters
_TAPER = 0.7  # what a tail's width loses to its end
_STEEPEST = 1.54  # rise of (1 - x²)², at most
_UPRIGHT = np.eye(3)


class Banked(NamedTuple):
    """Ground with the soil that lies at rocks."""

    ground: Heightfield
    """With banks and moats."""
    raised: NDArray[np.float32]
    """How much soil was laid on each node [m], shape [rows, columns]."""


def bank_soil(
    *, site: Site, scattered: Scattered, library: RockLibrary, ground: Heightfield
) -> Banked | None:
    """The ground with what lies at the static rocks; None where the recipe wants none.

    A node has the same height whatever part of the site the ground is, if all rocks are there that
    lie within `bank_reach` of it, and `FILLED` nodes around it.

    Args:
        site: The place.
        scattered: The rocks in plan.
        library: Their shapes.
        ground: The bare ground.
    """
    contact = contact_of(site)
    if isinstance(contact, NoContact):
        return None
    static = np.flatnonzero(~scattered.dynamic & (scattered.diameter > _FEWEST * site.spacing))
    raised = np.zeros(ground.elevation.shape, np.float32)
    scoured = np.zeros_like(raised)
    if len(static):
        column, row = site.first_node(ground)
        places = (site.west, site.south), (column, row), site.spacing
        banks = _banks(contact, site, scattered, static, library)
        over_chunks(_bank, len(raised), *banks, places, raised, scoured)
    elevation = ground.elevation.copy()
    over_chunks(_lay, len(raised), ground.elevation, raised, scoured, elevation)
    return Banked(ground.replace(elevation=elevation), raised)


def bank_reach(site: Site, library: RockLibrary) -> float:
    """How far from the centre of a rock its bank can go [m]."""
    contact, largest = contact_of(site), site.largest_rock
    if isinstance(contact, NoContact) or not library.prototypes:
        return 0.0
    height = _HIGHEST_ROCK * largest
    width = 2.0 * _HIGHEST_BANK * height / _CONTACT_SLOPE
    tail = _LONGEST * contact.tail * height if isinstance(contact, WindContact) else 0.0
    reach = max(prototype.reach for prototype in library.prototypes) * largest
    return 2.0 * reach + max(width, tail) + 2.0 * site.spacing


def _banks(
    contact: WindContact | FilletContact,
    site: Site,
    scattered: Scattered,
    rows: NDArray[np.intp],
    library: RockLibrary,
) -> tuple[Array, NDArray[np.int64], Array, tuple[float, ...], np.uint64]:
    """What a kernel needs: rocks, their ids and shapes, outlines, wind and what it lays."""
    used, shape = np.unique(scattered.prototype[rows], return_inverse=True)
    shapes = [library.prototypes[n] for n in used]
    diameter, buried = scattered.diameter[rows], scattered.buried[rows]
    known = exposure(shapes)
    part = np.minimum(buried / DEEPEST, 1.0) * (known.upright.shape[1] - 1)
    below = np.minimum(part.astype(np.int64), known.upright.shape[1] - 2)
    low, high = known.upright[shape, below], known.upright[shape, below + 1]
    width = low + (part - below) * (high - low)
    height = np.minimum((1.0 - buried) * known.span[shape] / width, _HIGHEST_ROCK) * diameter
    if isinstance(contact, WindContact):
        towards = np.radians(wind_from(contact, site) + 180.0)
        lee, windward = contact.drift * height, contact.moat * height
        hidden = np.full_like(height, np.inf)
        laid, tail = (float(np.sin(towards)), float(np.cos(towards)), 1.0), contact.tail * height
    else:
        worn = wear_rate(diameter) * contact.exposure_myr
        lee, windward = np.sqrt(1.5 * _CONTACT_SLOPE * worn * height), np.zeros_like(height)
        hidden = buried / (1.0 - buried) * height  # a fillet lifts no rock off the ground beneath
        laid, tail = (0.0, 1.0, 0.0), np.zeros_like(height)
    fade = np.clip((diameter / site.spacing - _FEWEST) / (_FULL - _FEWEST), 0.0, 1.0)
    yaw = scattered.yaw[rows]
    most = np.minimum(_HIGHEST_BANK * height, hidden)
    rocks = np.column_stack(
        [scattered.xy[rows], np.cos(yaw), np.sin(yaw), diameter, most, lee, windward, tail, fade]
    )
    named = np.column_stack([scattered.id[rows], shape]).astype(np.int64)
    outlines = np.array([_outline(prototype) for prototype in shapes])
    return rocks, named, outlines, laid, stage_key(site.seed, "rock-contact")


@remembered
def _outline(prototype: RockPrototype) -> Array:
    """How far the hull of a shape's outline goes from its centre, over its diameter, all around.

    Along directions counter-clockwise from its x axis, shape [directions].
    """
    mesh = prototype.meshes[0]
    level = mesh.vertices[:, 2].min() + _BURIED * np.ptp(mesh.vertices[:, 2])
    cut = mesh.vertices.copy(), edges(mesh), _UPRIGHT, (0.0, 0.0, 1.0), level
    angle = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    axes = np.stack([np.cos(angle), np.sin(angle)])
    support = portable.product(exposed_points(*cut), axes).max(axis=0)
    apart = np.cos(angle[:, None] - angle[None, :])
    along = np.where(apart > 0.1, np.maximum(support, 0.05) / np.maximum(apart, 0.1), np.inf)
    return np.asarray(along.min(axis=1) / exposed_diameter(*cut))


@inner
def _radius(outline, u, v):  # type: ignore[no-untyped-def]
    """How far an outline goes towards a place, over the diameter."""
    turn = np.arctan2(v, u) / (2.0 * np.pi)
    part = (turn - np.floor(turn)) * _DIRECTIONS
    n = np.int64(part)
    here, following = outline[n % _DIRECTIONS], outline[(n + 1) % _DIRECTIONS]
    return here + (part - n) * (following - here)


@kernel
def _bank(  # type: ignore[no-untyped-def]
    first, last, rocks, named, outlines, laid, key, places, raised, scoured
):
    """Lay the banks of all rocks on some of the rows."""
    corner, node, spacing = places
    for rock in range(len(rocks)):
        x, y, diameter = rocks[rock, 0], rocks[rock, 1], rocks[rock, 4]
        bank = _drawn(rocks[rock], mix(key, named[rock, 0]), laid)
        outline = outlines[named[rock, 1]]
        reach = outline.max() * diameter + _BLUR * spacing + max(bank[5], 0.5 * diameter + bank[4])
        south = np.int64(np.ceil((y - reach - corner[1]) / spacing)) - node[1]
        north = np.int64(np.floor((y + reach - corner[1]) / spacing)) - node[1]
        west = np.int64(np.ceil((x - reach - corner[0]) / spacing)) - node[0]
        east = np.int64(np.floor((x + reach - corner[0]) / spacing)) - node[0]
        for j in range(max(south, first), min(north + 1, last)):
            dy = corner[1] + np.float64(j + node[1]) * spacing - y
            for i in range(max(west, 0), min(east + 1, raised.shape[1])):
                dx = corner[0] + np.float64(i + node[0]) * spacing - x
                height = _height(rocks[rock], bank, outline, dx, dy, spacing)
                if height > raised[j, i]:
                    raised[j, i] = height
                if -height > scoured[j, i]:
                    scoured[j, i] = -height


@kernel
def _lay(first, last, bare, raised, scoured, elevation):  # type: ignore[no-untyped-def]
    """The ground of some rows, with its soil."""
    rows, columns = bare.shape
    for j in range(first, last):
        for i in range(columns):
            soil = np.float64(raised[j, i])
            height = np.float64(bare[j, i]) + soil - np.float64(scoured[j, i])
            if soil > 0.0:
                south, north = max(j - FILLED, 0), min(j + FILLED + 1, rows)
                west, east = max(i - FILLED, 0), min(i + FILLED + 1, columns)
                total = 0.0
                for row in range(south, north):
                    for column in range(west, east):
                        total += np.float64(bare[row, column])
                hollow = total / ((north - south) * (east - west)) - np.float64(bare[j, i])
                height += hollow * soil / (soil + abs(hollow))
            elevation[j, i] = height


@inner
def _drawn(rock, own, laid):  # type: ignore[no-untyped-def]
    """The wind of a rock, what it lays to the lee and digs before it, tail and width [m]."""
    most, fade, amount = rock[5], rock[9], 2.0 * uniform(mix(own, 0))
    if laid[2] == 0.0:
        lee = fade * min(rock[6] * np.sqrt(amount), most)
        return 0.0, 0.0, lee, lee, 0.0, 2.0 * lee / _CONTACT_SLOPE
    turn = _JITTER * (2.0 * uniform(mix(own, 1)) - 1.0)
    cos, sin = np.cos(turn), np.sin(turn)
    lee = fade * min(rock[6] * amount, most)
    windward = -fade * rock[7] * (2.0 - amount)
    tail = rock[8] * (0.5 + 0.5 * amount) if rock[6] > 0.0 else 0.0
    width = 2.0 * max(lee, -windward) / _CONTACT_SLOPE
    return laid[0] * cos - laid[1] * sin, laid[0] * sin + laid[1] * cos, lee, windward, tail, width


@inner
def _height(rock, bank, outline, dx, dy, spacing):  # type: ignore[no-untyped-def]
    """How much higher a bank makes the ground at a place from its rock's centre [m]."""
    east, north, lee, windward, tail, width = bank
    away, diameter = np.sqrt(dx * dx + dy * dy), rock[4]
    along = dx * east + dy * north
    edge = _BLUR * spacing + diameter * _radius(
        outline, rock[2] * dx + rock[3] * dy, rock[2] * dy - rock[3] * dx
    )
    share = 0.5 + 0.5 * along / away if away > 0.0 else 0.5
    rim = lee  # a fillet's
    if windward <= 0.0:
        rim = lee * share + windward * (1.0 - share) * (1.0 - share)
    if away < edge:
        part = away * away / (edge * edge)
        height = windward + (rim - windward) * part * part
    else:
        part = max(1.0 - (away - edge) / width, 0.0) if width > 0.0 else 0.0
        height = rim * part * part
    if along <= 0.0 or tail <= 0.0:
        return height
    ended = max(along - 0.5 * diameter, 0.0) / tail
    half = _TAIL_WIDTH * diameter * (1.0 - _TAPER * ended)
    beside = (dx * north - dy * east) / half
    if ended >= 1.0 or beside * beside >= 1.0:
        return height
    crest = min(lee, _FLANK / _STEEPEST * _TAIL_WIDTH * diameter)
    begun = min(along / (0.5 * diameter), 1.0)
    left, round_ = 1.0 - ended, 1.0 - beside * beside
    return max(height, crest * begun * begun * left * np.sqrt(left) * round_ * round_)
