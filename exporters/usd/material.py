"""Materials: a preview surface for pictures and, on the same prim, friction for physics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pxr import Gf, Sdf, Usd, UsdPhysics, UsdShade

from terrain_forge.frames import Array


def linear_from_srgb(colour: ArrayLike) -> Array:
    """Linear colour of an sRGB one, 0 to 1 (IEC 61966-2-1): USD's plain colours are linear."""
    values = np.asarray(colour, dtype=np.float64)
    result: Array = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return result


def define_plain(stage: Usd.Stage, path: str, rgb: Array, friction: float) -> UsdShade.Material:
    """A matt material of one linear colour."""
    material, shader = _define_matt(stage, path, friction)
    colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    colour.Set(Gf.Vec3f(*(float(channel) for channel in rgb)))
    return material


def define_textured(stage: Usd.Stage, path: str, image: str, friction: float) -> UsdShade.Material:
    """A matt material that shows an sRGB image through the texture coordinates `st`."""
    material, shader = _define_matt(stage, path, friction)
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/image")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(image)
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    for wrap in ("wrapS", "wrapT"):
        texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("clamp")
    coordinates = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
    colour = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    return material


def bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    """Give a prim and all below it a material."""
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def _define_matt(
    stage: Usd.Stage, path: str, friction: float
) -> tuple[UsdShade.Material, UsdShade.Shader]:
    material = UsdShade.Material.Define(stage, path)
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(friction)
    physics.CreateDynamicFrictionAttr(friction)
    physics.CreateRestitutionAttr(0.0)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    return material, shader
