"""The GLB export from first to last."""

from __future__ import annotations

import json
from itertools import chain
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import ExportError, xyzw
from terrain_forge.geometry import (
    PLACE_LOSS,
    close_loss,
    close_pixel,
    detail_loss,
    level_of_detail,
    lightest_rock_colour,
    pebbles_loss,
    texture_loss,
    with_horizon_loss,
)
from terrain_forge.model import CLOSE, ExportReport, GroundDetail, Trajectory, World
from terrain_forge.rocks import path_pebbles, seen_close
from terrain_forge.writers import LARGEST_FILE, Gltf

from .ground import Z_UP_TO_Y_UP, SharedParts, ground_tile, matt
from .lights import EXTENSION, add_lights
from .options import Options
from .pebbles import FILE, write_pebbles
from .rocks import merged_rocks, node_texts, rock_meshes

_BYTES_PER_NODE = 24
"""Of a node of the ground at least: its position and normal."""
_BYTES_PER_ROCK = 140
"""Of a rock at least: its node as text."""


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write world.glb: ground, rocks, Sun, and a moving node for each path.

    Raises:
        ExportError: if the world does not fit into the 4 GiB of a GLB.
    """
    rows, columns = world.ground.shape
    check_capacity(options, nodes=rows * columns, rocks=len(world.field))
    shapes = world.library.prototypes
    coarse = np.array([level_of_detail(shape, options.outline_error) for shape in shapes])
    with TemporaryFile(dir=directory) as binary:
        gltf = Gltf(binary)
        paths = [
            _moving_node(trajectory, gltf, node=1 + number)
            for number, trajectory in enumerate(world.trajectories)
        ]
        shared = SharedParts(gltf, _soil(world, options))
        tiles = _tiles(world, gltf, coarse, shared, options)
        single = world.field.select(world.field.diameter >= options.instances_min_m)
        fine = single.diameter >= options.finest_min_m
        levels = np.where(fine, 0, coarse[single.prototype])
        levels[np.isin(single.id, seen_close(world, within=options.close_within_m))] = CLOSE
        rocks = node_texts(single, rock_meshes(world, single, gltf, levels))
        beyond = []
        if options.horizon and world.horizon:
            piece = {"name": "horizon", "primitives": [shared.beyond(world.horizon)]}
            beyond.append({"name": "horizon", "mesh": gltf.add("meshes", piece)})
        lights, shining = add_lights(world, gltf, options)
        fixed = [*paths, *shining, *tiles, *beyond]
        root = {
            "name": world.site.name,
            "rotation": Z_UP_TO_Y_UP,
            "children": list(range(1, 1 + len(fixed) + len(single))),
        }
        gltf.write(
            directory / "world.glb",
            nodes=chain(map(json.dumps, [root, *fixed]), rocks),
            extensions={EXTENSION: {"lights": lights}},
            scene=0,
            scenes=[{"name": world.site.name, "nodes": [0]}],
        )
    files, losses = [Path("world.glb")], _losses(world, coarse, options)
    if options.pebbles_min_m > 0.0:
        laid = path_pebbles(world, smallest=options.pebbles_min_m, within=options.pebbles_within_m)
        beside = ""
        if len(laid):
            write_pebbles(world, laid, directory / FILE)
            files.append(Path(FILE))
            beside = f" They are in {FILE}, which trimesh cannot read."
        losses = (*losses, f"{pebbles_loss(len(laid), options.pebbles_within_m)}{beside}")
    report = ExportReport(files=tuple(files), losses=losses)
    return with_horizon_loss(report, world.horizon, shown=options.horizon)


def _tiles(
    world: World, gltf: Gltf, coarse: NDArray[np.int64], shared: SharedParts, options: Options
) -> list[dict[str, Any]]:
    """Add the ground and the merged rocks, tile by tile; returns their nodes."""
    shapes = [p.meshes[level] for p, level in zip(world.library.prototypes, coarse, strict=True)]
    nodes = []
    small = world.field.diameter < options.instances_min_m
    merged = world.replace(field=world.field.select(small))
    names = world.field.populations if small.any() else ()
    materials = [
        gltf.add(
            "materials",
            matt(f"{name}_merged", rgb=lightest_rock_colour(world, n).tolist()),
        )
        for n, name in enumerate(names)
    ]
    for tile in merged.tiles(cells=options.tile_cells):
        nodes.append(ground_tile(tile, gltf, shared=shared, options=options))
        nodes += merged_rocks(tile, gltf, shapes=shapes, materials=materials)
    return nodes


def _moving_node(trajectory: Trajectory, gltf: Gltf, *, node: int) -> dict[str, Any]:
    """Add the animation of the node of that index: the trajectory's samples, straight between.

    Returns:
        The node, in the pose of the first sample.
    """
    # A quaternion and its negative are the same turn, but between the two a reader that blends
    # numbers would spin: each is on the side of the one before.
    turns = xyzw(trajectory.quaternion)
    turns_over = (turns[1:] * turns[:-1]).sum(axis=1) < 0
    turns = turns * np.cumprod(np.where([False, *turns_over], -1.0, 1.0))[:, None]
    values = {"translation": trajectory.position, "rotation": turns}
    times = gltf.add_samples(trajectory.time[:, None].astype(np.float32), bounded=True)
    samplers = [
        {"input": times, "output": gltf.add_samples(some.astype(np.float32)),
         "interpolation": "LINEAR"}
        for some in values.values()
    ]  # fmt: skip
    channels = [
        {"sampler": number, "target": {"node": node, "path": name}}
        for number, name in enumerate(values)
    ]
    animation = {"name": trajectory.name, "samplers": samplers, "channels": channels}
    gltf.add("animations", animation)
    return {"name": f"path_{trajectory.name}", **{k: v[0].tolist() for k, v in values.items()}}


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, a ground or rocks that cannot fit into a file.

    Raises:
        ExportError: if they cannot.
    """
    del options
    if nodes * _BYTES_PER_NODE + rocks * _BYTES_PER_ROCK > LARGEST_FILE:
        raise ExportError(
            f"the ground's {nodes:.4g} nodes and {rocks:.4g} rocks do not fit into the 4 GiB of a "
            "GLB: choose a smaller area, a coarser spacing_m, or the format usd"
        )


def _soil(world: World, options: Options) -> GroundDetail | None:
    """The detail tile whose normals are in the file, if there is one."""
    return world.appearance.detail if options.soil_normals else None


def _losses(world: World, coarse: NDArray[np.int64], options: Options) -> tuple[str, ...]:
    """What a GLB, or this export of one, does not say."""
    detail, within = _soil(world, options), options.close_within_m
    losses = [
        texture_loss(world.ground, options.texture_pixels, normals=detail is not None),
        *([detail_loss(detail)] if detail else []),
        *([close_loss(close_pixel(world, within), within)] if within > 0.0 else []),
        "glTF knows no physics: gravity, masses, friction and collision shapes are not in the "
        f"file{', and no rock moves' if world.field.dynamic.any() else ''}.",
        "The Sun's angular size is lost, and of the sky all but one colour."
        if options.lights == "display"
        else "The Sun's angular size and the colour of the sky are lost.",
    ]
    unfelt = int((~world.field.collides).sum())
    if unfelt:
        losses.append(f"{unfelt} rocks that are visual-only look like the others.")
    if world.site.georeferenced:
        losses.append(PLACE_LOSS)
    if world.trajectories:
        losses.append("Paths move an empty node: the rover's looks are not in the file.")
    small = int((world.field.diameter < options.instances_min_m).sum())
    if small:
        losses.append(
            f"{small} rocks below {options.instances_min_m:g} m are merged per tile, without names "
            "and textures."
        )
    finest = max(options.instances_min_m, options.finest_min_m)
    if np.any(world.field.diameter < finest):
        shapes = zip(world.library.prototypes, coarse, strict=True)
        error = 100 * max(shape.outline_errors[level] for shape, level in shapes)
        losses.append(
            f"The outlines of rocks below {finest:g} m are off by up to {error:.1f} % of their "
            "size."
        )
    return tuple(losses)
