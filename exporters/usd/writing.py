"""The USD export from first to last."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    LightLevels,
    Lights,
    close_loss,
    close_pixel,
    coarse_shape,
    collision_losses,
    detail_loss,
    dome_image,
    dome_level,
    largest_outline_error,
    level_of_detail,
    lie_upright,
    light_levels,
    pebbles_loss,
    rock_texture,
    static_losses,
    texture_loss,
    touched_shapes,
    with_horizon_loss,
)
from terrain_forge.model import ExportReport, Mesh, World
from terrain_forge.rocks import path_pebbles, seen_close
from terrain_forge.writers import encode_hdr, write_png, write_texture

from .ground import DETAIL, shown_craters, write_ground, write_horizon
from .layer import ROOT, new_stage, save, turn_by
from .options import Options
from .rocks import write_library, write_pebbles, write_rock_maps, write_rocks
from .rover import rig_losses, write_scene

_STOPS = 2.0
"""By how many stops Blender brightens the Sun, and so the sky."""
SKY = "sky.hdr"
"""The image of the sky, in the assets."""


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write world.usda, scene.usda (with a replay of each trajectory) and their assets."""
    assets = directory / "assets"
    assets.mkdir()
    close = seen_close(world, within=options.close_within_m)
    drawn_close = world.field.prototype[np.isin(world.field.id, close)]
    turned = not lie_upright(world.field).all()
    write_library(world.library, assets, close=set(drawn_close.tolist()), turned=turned)
    for population in np.unique(world.field.population).tolist():
        texture = rock_texture(world, population, tinted=True)
        write_texture(assets / f"rock_{population}.png", texture)
    write_rock_maps(world, assets)
    write_sky(world, assets)
    if world.appearance.detail:
        write_png(assets / DETAIL, image_rows(world.appearance.detail.normals))
    shapes = world.library.prototypes
    coarse = [coarse_shape(shape, options.outline_error) for shape in shapes]
    levels = np.array([level_of_detail(shape, options.outline_error) for shape in shapes], np.int64)
    craters, parts = shown_craters(world), {"Ground": list[str](), "Rocks": list[str]()}
    for tile in world.tiles(cells=options.tile_cells):
        write_ground(tile, assets, craters=craters, options=options)
        write_rocks(tile, assets, coarse=coarse, levels=levels, close=close, options=options)
        parts["Ground"].append(tile.name("ground"))
        parts["Rocks"].append(tile.name("rocks"))
    if options.horizon and world.horizon:
        write_horizon(world.horizon, world.appearance.detail, assets)
        parts["Horizon"] = ["horizon"]
    pebbles = 0
    if options.pebbles_min_m > 0.0:
        laid = path_pebbles(world, smallest=options.pebbles_min_m, within=options.pebbles_within_m)
        if len(laid):
            write_pebbles(world, laid, assets)
            parts["Pebbles"], pebbles = ["pebbles"], len(laid)
    _write_world(directory / "world.usda", world, parts, options)
    write_scene(directory / "scene.usda", world, base="./world.usda")
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    losses = _losses(world, coarse, levels, close, pebbles, options)
    report = ExportReport(files=tuple(files), losses=losses)
    return with_horizon_loss(report, world.horizon, shown=options.horizon)


def _write_world(path: Path, world: World, parts: dict[str, list[str]], options: Options) -> None:
    """Write the stage without a rover: physics, Sun, sky and payloads, for a person to read."""
    stage = new_stage(path, ROOT, kind=Kind.Tokens.assembly)
    define_world(stage, world, options.lights)
    for group, names in parts.items():
        define_parts(stage, group, names)
    save(stage)


def define_parts(stage: Usd.Stage, group: str, names: list[str]) -> None:
    """Define a group of payloads from the assets."""
    prim = UsdGeom.Xform.Define(stage, f"/{ROOT}/{group}").GetPrim()
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.group)
    for name in names:
        part = UsdGeom.Xform.Define(stage, f"/{ROOT}/{group}/{name}").GetPrim()
        part.GetPayloads().AddPayload(f"./assets/{name}.usdc")


def define_world(stage: Usd.Stage, world: World, lights: Lights) -> None:
    """Define gravity, Sun and sky."""
    scene = UsdPhysics.Scene.Define(stage, f"/{ROOT}/PhysicsScene")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0, 0, -1))
    scene.CreateGravityMagnitudeAttr(world.site.body.gravity)
    _define_lights(stage, world, light_levels(world, lights))


def _define_lights(stage: Usd.Stage, world: World, levels: LightLevels) -> None:
    lighting = world.lighting
    sun = UsdLux.DistantLight.Define(stage, f"/{ROOT}/Sun")
    # A normalised distant light gives its intensity as irradiance, whatever its angle.
    sun.CreateIntensityAttr(levels.sun)
    sun.CreateNormalizeAttr(True)
    sun.CreateAngleAttr(float(np.degrees(world.sun_diameter)))
    # It shines along its -z axis: its z axis points to the Sun.
    towards = Gf.Vec3d(*lighting.towards_sun.tolist())
    turn = Gf.Rotation(Gf.Vec3d(0, 0, 1), towards).GetQuat()
    turn_by(UsdGeom.Xformable(sun)).Set(turn)
    sky = UsdLux.DomeLight.Define(stage, f"/{ROOT}/Sky")
    level = dome_level(lighting, levels)
    # Blender takes the Sun's intensity four times, and passes over a dome's exposure alone.
    sky.CreateIntensityAttr(2.0**_STOPS * (levels.sky if level is None else level))
    sky.CreateExposureAttr(-_STOPS)
    if level is None:
        sky.CreateColorAttr(Gf.Vec3f(*lighting.sky_rgb))
        return
    sky.CreateTextureFileAttr(Sdf.AssetPath(f"./assets/{SKY}"))
    sky.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    # A dome's pole is its y axis, its image's middle on z: so x stays east, the middle is south.
    UsdGeom.Xformable(sky).AddRotateXOp().Set(90.0)


def write_sky(world: World, assets: Path, *, highest: float | None = None) -> None:
    """Write the sky as an image, where it is more than a colour; `highest` as of `dome_image`."""
    if (image := dome_image(world, highest=highest)) is not None:
        (assets / SKY).write_bytes(encode_hdr(image))


def _losses(
    world: World,
    coarse: list[Mesh],
    levels: NDArray[np.int64],
    close: NDArray[np.int32],
    pebbles: int,
    options: Options,
) -> tuple[str, ...]:
    """What USD, or this export of it, does not say."""
    detail, within = world.appearance.detail, options.close_within_m
    losses = [
        texture_loss(world.ground, options.texture_pixels, normals=detail is not None),
        *([detail_loss(detail)] if detail else []),
        *([close_loss(close_pixel(world, within), within)] if within > 0.0 else []),
        *static_losses(world.field),
        "USD lights have no physical unit: intensities are "
        + (
            "made for display, and Blender takes them four times as bright."
            if options.lights == "display"
            else "W/m² and want an exposure."
        ),
        "USD does not say whose friction counts where two things touch: PhysX takes their mean.",
    ]
    if options.pebbles_min_m > 0.0:
        losses.append(pebbles_loss(pebbles, options.pebbles_within_m))
    if world.site.georeferenced:
        losses.append("Longitude and latitude of the site are left out: no USD schema holds them.")
    if world.trajectories:
        losses += rig_losses(world.rover)
    if world.field.dynamic.any():
        losses.append("Dynamic rocks have no torsional and no rolling friction: USD knows neither.")
    losses += _outline_losses(world, coarse, levels, close, options)
    return (*losses, *collision_losses(touched_shapes(world)))


def _outline_losses(
    world: World,
    coarse: list[Mesh],
    levels: NDArray[np.int64],
    close: NDArray[np.int32],
    options: Options,
) -> Iterator[str]:
    """How far small static rocks are off, as they are drawn and as they are touched."""
    field, shapes = world.field, world.library.prototypes
    if not field.dynamic.all():
        yield (
            "Static rocks in pictures are turned by half-precision quaternions, off by below "
            "0.001 rad."
        )
    small = ~field.dynamic & (field.diameter < options.collider_min_m)
    rough = small & ~np.isin(field.id, close)
    drawn = np.unique(field.prototype[rough]).tolist()
    error = max((shapes[n].outline_errors[levels[n]] for n in drawn), default=0.0)
    if error:
        yield (
            f"{int(rough.sum())} static rocks below {options.collider_min_m:g} m are drawn by "
            f"coarser meshes, their outlines off by up to {100 * error:.2g} % of their size."
        )
    small &= field.collides
    if small.any():
        used = np.unique(field.prototype[small]).tolist()
        error = largest_outline_error([coarse[n] for n in used], [shapes[n] for n in used])
        off = f", their outlines off by up to {100 * error:.2g} % of their size" if error else ""
        yield (
            f"{int(small.sum())} rocks below {options.collider_min_m:g} m share colliders per "
            f"tile{off}."
        )
