"""Whether every exported format holds the world's ground, read back as its consumer reads it."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numba import njit

from terrain_forge.base import Array, mix, stage_key, uniform
from terrain_forge.model import Check, Heightfield, Mesh, World, at_most, failed
from terrain_forge.validation.surface_mesh import heights_on, read_mesh

GROUND_LIMIT, GROUND_LIMIT_OF_RANGE = 1e-3, 1e-5
"""A ground may be off by a millimetre, or by this part of its range of heights."""


def ground_agreement(world: World, directory: Path, *, points: int = 2000) -> list[Check]:
    """Compare the ground of every export in `directory` with the world's at random points.

    Formats are told by their files: `world.xml` (MuJoCo casts rays; gravity and a sample of rocks
    too), `world.sdf` (the collision meshes), `world.usda` or `.usdc` (the ground's mesh prims).

    Returns:
        The checks, each named after its export's folder.
    """
    at = random_points(world, points)
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(partial(_read_back, world, at), export_folders(directory))
        return [check for checks in found for check in checks]


def _read_back(world: World, at: Array, folder: Path) -> list[Check]:
    try:
        return _folder_checks(world, folder, at)
    except Exception as error:  # each consumer has its own; an export that it cannot read fails
        why = " ".join(str(error).split())
        return [failed(f"{folder.name}: ground", f"cannot be opened: {why}")]


def _folder_checks(world: World, folder: Path, at: Array) -> list[Check]:
    if (folder / "world.xml").is_file():
        from terrain_forge.validation.mujoco_agreement import mujoco_agreement, sample_model

        return mujoco_agreement(world, sample_model(world, folder), folder.name, at)
    if (folder / "world.sdf").is_file():
        from terrain_forge.validation.heightmap_agreement import find_heightmap, heightmap_checks

        heightmap = find_heightmap(folder)
        if heightmap is not None:
            return heightmap_checks(world, folder, heightmap, at)
        return [_compare(world, folder.name, at, _sdf_meshes(folder))]
    return [_compare(world, folder.name, at, _usd_meshes(usd_layer(folder)))]


def export_folders(directory: Path) -> list[Path]:
    """The folders of a built world and of its validation that hold a known format, by name."""
    known = ("world.xml", "world.sdf", "world.usda", "world.usdc")
    folders = sorted(directory.glob("*/")) + sorted(directory.glob("validation/*/"))
    return [folder for folder in folders if any((folder / name).is_file() for name in known)]


def usd_layer(folder: Path) -> Path:
    """The root layer of a USD export."""
    text = folder / "world.usda"
    return text if text.is_file() else folder / "world.usdc"


def random_points(world: World, count: int) -> Array:
    """Points all over the world's ground, drawn by the site's seed, shape [count, 2] [m]."""
    west, south, east, north = world.ground.bounds
    unit = _unit_pairs(stage_key(world.site.seed, "agreement"), count)
    return np.asarray((west, south) + unit * (east - west, north - south))


@njit(cache=True)
def _unit_pairs(key, count):  # type: ignore[no-untyped-def]
    pairs = np.empty((count, 2))
    for n in range(count):
        for axis in range(2):
            pairs[n, axis] = uniform(mix(mix(key, n), axis))
    return pairs


def ground_check(world: World, name: str, at: Array, heights: Array) -> Check:
    """The largest difference of heights [m] that were read back at points from the world's own."""
    missed = int(np.isnan(heights).sum())
    title = f"{name}: ground"
    if missed:
        return failed(title, f"no ground under {missed} of {len(at)} points")
    off = np.abs(heights - world.ground.height_at(at[:, 0], at[:, 1]))
    limit = ground_limit(world.ground)
    note = f"largest difference in height at {len(at)} points"
    return at_most(title, float(off.max()), limit, unit="m", note=note)


def ground_limit(ground: Heightfield) -> float:
    """How far a format's ground may be off [m]."""
    extent = float(np.ptp(ground.elevation.astype(np.float64)))
    return max(GROUND_LIMIT, GROUND_LIMIT_OF_RANGE * extent)


def _compare(world: World, name: str, at: Array, meshes: Iterator[Mesh]) -> Check:
    heights = np.full(len(at), np.nan)
    for mesh in meshes:
        heights = np.fmax(heights, heights_on(mesh, at))
    return ground_check(world, name, at, heights)


def _sdf_meshes(folder: Path) -> Iterator[Mesh]:
    """The collision meshes of the ground: in the world's file itself (Drake), in its models."""
    world = ElementTree.parse(folder / "world.sdf").getroot()
    yield from (read_mesh(folder / uri) for uri in _ground_uris(world))
    for include in world.iter("include"):
        model = _model_path(folder, include.findtext("uri", ""))
        if (model / "model.sdf").is_file():
            for uri in _ground_uris(ElementTree.parse(model / "model.sdf").getroot()):
                yield read_mesh(_model_path(folder, uri))


def _ground_uris(root: ElementTree.Element) -> Iterator[str]:
    for collision in root.iter("collision"):
        uri = collision.findtext("geometry/mesh/uri", "")
        if collision.get("name", "").startswith("ground") and uri:
            yield uri


def _model_path(folder: Path, uri: str) -> Path:
    return folder / "models" / uri.removeprefix("model://")


def _usd_meshes(layer: Path) -> Iterator[Mesh]:
    """The ground's meshes of a stage in world coordinates; they are named after the ground."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(layer))
    places = UsdGeom.XformCache()
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh) or "ground" not in str(prim.GetPath()).lower():
            continue
        mesh = UsdGeom.Mesh(prim)
        points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(), dtype=np.int32)
        matrix = np.array(places.GetLocalToWorldTransform(prim))
        yield Mesh(vertices=points @ matrix[:3, :3] + matrix[3, :3], faces=corners.reshape(-1, 3))
