"""What a build costs on the machine at hand: time stage by stage, memory, disk.

The rates are those of one machine of two cores, of which `pace` tells how much slower this one is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from numpy.typing import NDArray

from terrain_forge import validation
from terrain_forge.base import returning, size_text, to_plain
from terrain_forge.building.calibration import LIBRARY, calibrated, pace
from terrain_forge.geometry import pixel_beside
from terrain_forge.model import Site
from terrain_forge.paths import PathSpec, Planned, duration
from terrain_forge.recipe import (
    ExportOrder,
    expected_nodes,
    memory_needed,
    rocks_of,
    tile_cells,
)
from terrain_forge.rocks import expected_dynamic, is_library_kept

SETTLING = 0.035
"""Time to settle a dynamic rock [s]."""
WATCHING = 0.06
"""Time to watch a dynamic rock in the exported world [s]."""
DRIVING, FILMING = 0.05, 0.8
"""Time to simulate a second of driving [s], of many drives two at once, and to film a drive [s]."""
TEXEL, USUAL_SIDE = 1e-6, 1024
"""Time for each pixel of a larger texture [s] than one of so many pixels a side."""
CLOSE_TEXEL, CLOSE_SIZE = 4.2e-7, 0.7
"""Time [s] and bytes of each pixel of the ground near paths."""
AGAIN = 2e-6
"""Time for each node of a tile that is made again for what lies near paths [s]."""
BESIDE = 40.0
"""Width along paths across tiles in which dynamic rocks are settled again [m]."""
READ_SHAPE, SHAPE, CUT_SHAPE, CUT = 0.002, 0.035, 0.3, 2.0
"""Time for each shape of a library [s] to read it, make it, make it where hulls are to be closer
than usual, of which some are cut up, and make the user's own."""
EXPORT, WRITING, READING = 0.2, 9e-9, 6.5e-9
"""Processor time for each export, to write a byte of it, and to read it again [s]."""
SHARED = 0.75
"""Part of the processor time that passes where two cores share the work."""
CONSUMER = 3.0
"""Time that an export's own programs take to begin [s]."""
OTHER_SIZE = (100, 4000)
"""Bytes of an export for each node and rock whose options have no `bytes_each`."""
PICTURES, HORIZON = 1.5e6, 4.5e6
"""Bytes of an export's textures, and of its horizon."""
WORLD_SIZE, WORLD_SIZES = 5.8e6, (3.9e5, 30, 400)
"""Bytes of all but the exports, and what each shape, node and rock adds to them."""
DETAIL = 4
"""Bytes that a world keeps for each pixel of a detail image, beside the image itself."""
HELD, DRIVEN = 0.4, 0.15e9
"""Memory for each byte of an export, and for driving [bytes]."""
DETOUR = 1.2
"""Length of a planned path over that of the straight lines between its places."""
TILE, TILE_WRITING = (0.3, 1.3e-6, 6e-5, 0.12), 5e-9
"""Processor time of a tile, of each of its nodes, rocks and exports, and to write a byte [s]."""
SITE_SIZE, TILE_SIZE, TILE_PICTURE = 12e6, (5e4, 9.5, 210), 8e5
"""Bytes of a site in tiles, of a tile and each of its nodes and rocks but for exports, and of an
export's pictures of a tile."""
FAR_PATH, FAR_PLAN = 0.011, 0.015
"""Time for each metre of a path over tiles, and to find it where it is planned [s]."""
SERIES_TIME, SERIES_SIZE = (0.12, 1.2e-6, 8e-5), (1.1e6, 30, 100)
"""Time [s] and bytes of one of many worlds but for its exports, and what nodes and rocks add."""
TOLD = 0.1
"""What a stage must take to be named [s]."""


def stage_seconds(site: Site, orders: Sequence[ExportOrder]) -> dict[str, float]:
    """Time that each stage of a build takes on this machine [s], its kernels being compiled."""
    recipe = site.recipe
    if recipe.tiles is not None:
        return calibrated(_tiled_seconds(site, orders))
    nodes, rocks = expected_nodes(recipe), rocks_of(site)
    dynamic = expected_dynamic(recipe.rocks.populations, size=site.size)
    exported = exported_bytes(orders, site)
    written = 1.4 + nodes / 3.7e5 + rocks / 4e4 + EXPORT * len(orders) + exported * WRITING
    read = 1.6 + nodes / 4.2e5 + exported * READING
    watched = min(dynamic, validation.MOST_WATCHED) * WATCHING if dynamic else 0.0
    stages = {
        "plan": 0.45,
        LIBRARY: _library(site),
        "ground": 0.3 + nodes / 6e6,
        "rocks": 0.35 + rocks / 60e3 + dynamic * SETTLING,
        "paths": 0.05 + 0.1 * len(site.routes),
        "writing": SHARED * written + _pictures(orders) + _near_paths(orders, site)[0],
        "validation": SHARED * read + watched,
        "report page": 0.65 + nodes / 5e6,
        "manifest": 0.05 + exported / 1.5e9,
    }
    if recipe.validate and recipe.validate.consumers == "all":
        stages["validation"] += CONSUMER * len(orders) + 2 * exported * READING
    told = calibrated(stages)
    return told | {"validation": told["validation"] + drive_seconds(site)}


def drive_seconds(site: Site) -> float:
    """Time that driving takes on this machine [s]."""
    return calibrated({"drive": _drives(site)})["drive"]


def _tiled_seconds(site: Site, orders: Sequence[ExportOrder]) -> dict[str, float]:
    """Processor time of the stages of a build in tiles on the machine of the rates [s]."""
    dynamic = expected_dynamic(site.recipe.rocks.populations, size=site.size)
    tiles = _tiles_of(site)
    amounts = tiles, expected_nodes(site.recipe), rocks_of(site), tiles * len(orders)
    made = _sum(TILE, amounts) + exported_bytes(orders, site) * TILE_WRITING + dynamic * SETTLING
    planned = sum(map(_planned_length, site.recipe.paths))
    length = sum(route.length for route in site.routes) + planned
    beside = min(BESIDE * length / (site.size[0] * site.size[1]), 1.0) * dynamic
    return {
        "plan": 0.45,
        LIBRARY: _library(site),
        "tiles": made,
        "paths across tiles": FAR_PATH * length + FAR_PLAN * planned + beside * SETTLING,
        "drive": _drives(site),
        "near paths": _near_paths(orders, site)[0],
        "joining": 0.5 + 0.025 * tiles,
    }


def _tiles_of(site: Site) -> int:
    """How many tiles a site has that is built in them."""
    return math.prod(math.ceil(length / site.tile_side) for length in site.size)


def export_bytes(order: ExportOrder, site: Site) -> float:
    """About how large an export of a site becomes, but for pictures and horizon [bytes]."""
    recipe = site.recipe
    each_node, each_rock, each_face, _ = _bytes_each(order)
    each_rock += each_face * recipe.rocks.library.coarse_faces
    return each_node * expected_nodes(recipe) + each_rock * rocks_of(site)


def _bytes_each(order: ExportOrder) -> tuple[float, ...]:
    """Bytes of an export for each node, rock, triangle of a merged rock, and texel of `detail`.

    Raises:
        PluginError: if the exporter's options say anything else.
    """
    options = order.options
    allowed = "two numbers of bytes, and bytes_each_face and bytes_each_texel one each"
    with returning(order.exporter, f"exporter {order.kind!r}: bytes_each", allowed):
        node, rock = getattr(options, "bytes_each", OTHER_SIZE)
        more = (getattr(options, f"bytes_each_{name}", 0) for name in ("face", "texel"))
        return tuple(float(one) for one in (node, rock, *more))


def exported_bytes(orders: Sequence[ExportOrder], site: Site) -> float:
    """Bytes of all exports."""
    pictured = sum(hasattr(order.options, "texture_pixels") for order in orders)
    pictures = PICTURES + (0.0 if site.recipe.horizon.reach_m == 0.0 else HORIZON)
    if site.recipe.tiles is not None:
        pictures = TILE_PICTURE * _tiles_of(site)
    each_texel = sum(_bytes_each(order)[-1] for order in orders)
    each = (export_bytes(order, site) for order in orders)
    near = _near_paths(orders, site)[1]
    return pictures * pictured + each_texel * _detail_texels(site) + near + sum(each)


def _near_paths(orders: Sequence[ExportOrder], site: Site) -> tuple[float, float]:
    """Processor time [s] and bytes of what exports draw near paths, but for bytes of pebbles."""
    planned = sum(map(_planned_length, site.recipe.paths))
    length = sum(route.length for route in site.routes) + planned
    seconds = size = 0.0
    for options in (order.options for order in orders):
        close = getattr(options, "close_within_m", 0.0)
        pebbles = getattr(options, "pebbles_min_m", 0.0) and options.pebbles_within_m
        if length and (close or pebbles):
            tiles, nodes = _tiles_near(site, length, max(close, pebbles))
            pixels = 2.0 * close * length / pixel_beside(length / tiles, close) ** 2
            seconds += CLOSE_TEXEL * pixels + AGAIN * tiles * nodes
            size += CLOSE_SIZE * pixels
    return seconds, size


def _tiles_near(site: Site, length: float, within: float) -> tuple[float, float]:
    """About how many tiles lie near so many metres of paths, and nodes of each; else one of none.

    A straight line of any direction crosses 4 / π sides of squares for each length of a side.
    """
    if site.recipe.tiles is None:
        return 1.0, 0.0
    nodes = min(tile_cells(site.recipe) ** 2, expected_nodes(site.recipe))
    side = site.tile_side
    crossed = length * (4.0 / math.pi * side + 2.0 * within) / side**2
    return min(len(site.recipe.paths) + crossed, _tiles_of(site)), nodes


def _site_bytes(site: Site) -> float:
    """Bytes that a world keeps of what its site was planned from: images, heights, tables."""
    arrays: dict[str, NDArray[Any]] = {}
    to_plain(site, arrays)
    return DETAIL * _detail_texels(site) + sum(array.nbytes for array in arrays.values())


def _detail_texels(site: Site) -> int:
    """Pixels of the recipe's detail image, where it has one."""
    detail = site.recipe.terrain.appearance.detail
    return min(site.image(detail.image).shape) ** 2 if detail else 0


def cost_line(site: Site, orders: Sequence[ExportOrder]) -> str:
    """Size, time, memory and disk of a build, as a line."""
    recipe = site.recipe
    nodes, rocks = expected_nodes(recipe), rocks_of(site)
    dynamic = expected_dynamic(recipe.rocks.populations, size=site.size)
    seconds = sum(stage_seconds(site, orders).values())
    exported = exported_bytes(orders, site)
    each = recipe.rocks.library.shapes, nodes, rocks
    disk = WORLD_SIZE + _sum(WORLD_SIZES, each) + _site_bytes(site) + exported
    if recipe.tiles is not None:
        amounts = _tiles_of(site), nodes, rocks
        disk = SITE_SIZE + _sum(TILE_SIZE, amounts) + _site_bytes(site) + exported
    settled = f" ({dynamic:.0f} dynamic)" if dynamic else ""
    told = f"{nodes / 1e6:.2g} M nodes, {rocks / 1e3:.2g} k rocks{settled}: about "
    if recipe.tiles is not None:
        share = min((tile_cells(recipe) + 1) ** 2 / nodes, 1.0)
        memory = memory_needed(nodes * share, rocks * share)
        return (
            f"{told}{seconds:.0f} s of a core, {memory / 1e9:.1f} GB of memory for each worker, "
            f"{disk / 1e9:,.2g} GB on disk"
        )
    memory = memory_needed(nodes, rocks) + HELD * exported
    if recipe.validate and (recipe.validate.drive or recipe.validate.drives):
        memory += DRIVEN
    return f"{told}{seconds:.0f} s, {memory / 1e9:.1f} GB of memory, {disk / 1e6:,.0f} MB on disk"


def series_line(site: Site, orders: Sequence[ExportOrder]) -> str:
    """What the many worlds of a recipe cost, of which each is made without page and validation."""
    recipe = site.recipe
    amounts = 1.0, expected_nodes(recipe), rocks_of(site)
    exported = sum(export_bytes(order, site) for order in orders)
    seconds = _sum(SERIES_TIME, amounts) + exported * WRITING
    size = _sum(SERIES_SIZE, amounts) + exported
    each, count = pace() * seconds, recipe.worlds.count if recipe.worlds else 1
    return (
        f"about {each:.2g} s of a core and {size_text(size)} each; {count:,}: "
        f"{each * count / 60:,.1f} min of a core, {size_text(size * count)}"
    )


def stage_line(site: Site, orders: Sequence[ExportOrder]) -> str:
    """Time of those stages that take any, as a line."""
    stages = stage_seconds(site, orders)
    told = (f"{stage} {seconds:.2g} s" for stage, seconds in stages.items() if seconds >= TOLD)
    return ", ".join(told)


def _sum(rates: Sequence[float], amounts: Sequence[float]) -> float:
    return sum(rate * amount for rate, amount in zip(rates, amounts, strict=True))


def _pictures(orders: Sequence[ExportOrder]) -> float:
    """Time that the exports' textures take [s]."""
    sides = [getattr(order.options, "texture_pixels", 0) for order in orders]
    return TEXEL * sum(side**2 for side in sides if side > USUAL_SIDE)


def _library(site: Site) -> float:
    """Time that the library takes, to be read or to be made [s]."""
    spec = site.recipe.rocks.library
    if is_library_kept(spec, custom=site.meshes):
        return 0.1 + READ_SHAPE * spec.shapes
    return 0.3 + (CUT_SHAPE if spec.is_tight else SHAPE) * spec.shapes + CUT * len(spec.meshes)


def _drives(site: Site) -> float:
    """Time that driving takes [s]."""
    spec = site.recipe.validate
    starts, drive = (spec.starts_spec, spec.drive_spec) if spec else (None, None)
    seconds = 0.5 * starts.count * starts.length_m / starts.speed_m_s if starts else 0.0
    seconds += sum(duration(r) for r in site.routes if drive and r.name == drive.path)
    planned = (path for path in site.recipe.paths if drive and path.name == drive.path)
    seconds += sum(_planned_length(path) / path.speed_m_s for path in planned)
    return DRIVING * seconds + (FILMING if drive and drive.film else 0.0)


def _planned_length(path: PathSpec) -> float:
    """About how long a path is that is planned on the finished ground [m]; 0 for any other."""
    if not isinstance(path.route, Planned):
        return 0.0
    places = [place for _, place in path.route.stops]
    return DETOUR * sum(math.dist(*two) for two in pairwise(places))
