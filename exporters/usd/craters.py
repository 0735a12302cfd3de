"""Which of the ground's faces lie in craters, for segmentation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, Vt

from terrain_forge.model import Heightfield, World
from terrain_forge.terrain import Craters
from terrain_forge.truth import craters_of

from .layer import label

LEAST_DEPTH = 0.1
"""A crater that has less of its fresh depth left than this part is ground like any other."""
_CENTRES = np.array([(2 / 3, 1 / 3), (1 / 3, 2 / 3)])
"""Centres of a cell's two triangles, in the order of `ground_mesh.grid_faces` [cells]."""


def fresh_craters(world: World) -> list[Craters]:
    """The craters of each layer that still show in the world's ground."""
    found = [craters for _, craters in craters_of(world)]
    return [some.select(some.depth >= LEAST_DEPTH * some.fresh_depth) for some in found]


def label_craters(mesh: UsdGeom.Mesh, ground: Heightfield, layers: list[Craters]) -> None:
    """Label the faces of a tile's ground within the rims of craters, where there are any."""
    inside = faces_inside(ground, layers)
    if not inside.any():
        return
    faces = Vt.IntArray.FromNumpy(np.flatnonzero(inside).astype(np.int32))
    subset = UsdGeom.Subset.CreateGeomSubset(
        mesh, "craters", UsdGeom.Tokens.face, faces, "semantics", UsdGeom.Tokens.nonOverlapping
    )
    label(subset.GetPrim(), "crater")


def faces_inside(ground: Heightfield, layers: list[Craters]) -> NDArray[np.bool_]:
    """Which of the ground's faces have their centres within a crater's rim, shape [faces]."""
    rows, columns = ground.shape
    inside = np.zeros((rows - 1, columns - 1, 2), np.bool_)
    for craters in layers:
        centres = (craters.xy - ground.origin) / ground.spacing
        radii = 0.5 * craters.diameter / ground.spacing
        low = np.floor(centres - radii[:, None]).astype(np.int64).clip(0)
        high = np.ceil(centres + radii[:, None]).astype(np.int64)
        for (x, y), radius, (west, south), (east, north) in zip(
            centres.tolist(), radii.tolist(), low.tolist(), high.tolist(), strict=True
        ):
            part = inside[south : max(north, 0), west : max(east, 0)]
            u = west + np.arange(part.shape[1])[:, None] + _CENTRES[:, 0] - x
            v = south + np.arange(part.shape[0])[:, None] + _CENTRES[:, 1] - y
            part |= u**2 + v[:, None, :] ** 2 <= radius**2
    return inside.reshape(-1)
