"""world.usda: physics, Sun, sky and one payload per tile, in a file that a person can read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Usd, UsdGeom, UsdLux, UsdPhysics

from terrain_forge.model import World

from .layer import asset, new_stage, save

ROOT = "World"
_SKY_SHARE = 0.2
"""Irradiance of the sky over the Sun's, an even compromise between a dusty day and a clear one."""


def write_world(path: Path, world: World, *, tiles: list[tuple[str, str]]) -> None:
    """Write the stage of the world without a rover.

    Args:
        path: The file.
        world: The world.
        tiles: Names of each tile's ground and rocks among the assets.
    """
    stage = new_stage(path, ROOT, kind=Kind.Tokens.assembly)
    _define_physics(stage, world)
    _define_lights(stage, world)
    for number, group in enumerate(("Ground", "Rocks")):
        prim = UsdGeom.Xform.Define(stage, f"/{ROOT}/{group}").GetPrim()
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.group)
        for tile in tiles:
            name = tile[number]
            part = UsdGeom.Xform.Define(stage, f"/{ROOT}/{group}/{name}").GetPrim()
            part.GetPayloads().AddPayload(asset(f"{name}.usdc"))
    save(stage)


def _define_physics(stage: Usd.Stage, world: World) -> None:
    scene = UsdPhysics.Scene.Define(stage, f"/{ROOT}/PhysicsScene")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0, 0, -1))
    scene.CreateGravityMagnitudeAttr(world.site.body.gravity)


def _define_lights(stage: Usd.Stage, world: World) -> None:
    lighting = world.lighting
    sun = UsdLux.DistantLight.Define(stage, f"/{ROOT}/Sun")
    # A normalised distant light gives its intensity as irradiance, whatever its angle.
    sun.CreateIntensityAttr(lighting.irradiance)
    sun.CreateNormalizeAttr(True)
    sun.CreateAngleAttr(float(np.degrees(world.site.body.sun_diameter)))
    # It shines along its -z axis: its z axis points to the Sun.
    towards = Gf.Vec3d(*lighting.towards_sun.tolist())
    turn = Gf.Rotation(Gf.Vec3d(0, 0, 1), towards).GetQuat()
    UsdGeom.Xformable(sun).AddOrientOp().Set(Gf.Quatf(turn))
    sky = UsdLux.DomeLight.Define(stage, f"/{ROOT}/Sky")
    sky.CreateColorAttr(Gf.Vec3f(*lighting.sky_rgb))
    sky.CreateIntensityAttr(_SKY_SHARE * lighting.irradiance / np.pi)
