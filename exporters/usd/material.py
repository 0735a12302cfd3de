"""Materials: a preview surface for pictures and, on the same prim, friction for physics."""

from __future__ import annotations

from pxr import Sdf, Usd, UsdPhysics, UsdShade


def define_textured(
    stage: Usd.Stage, path: str, image: str, friction: float, *, wrap: str
) -> UsdShade.Material:
    """A matt material that shows an sRGB image through the texture coordinates `st`.

    Args:
        stage: Where to.
        path: Path of the material.
        image: The image's path, relative to the layer.
        friction: Coulomb friction.
        wrap: What lies beyond the image's edge: `repeat` for the image again, `clamp` for its rim.
    """
    material, shader = _define_matt(stage, path, friction)
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/image")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(image)
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    for side in ("wrapS", "wrapT"):
        texture.CreateInput(side, Sdf.ValueTypeNames.Token).Set(wrap)
    coordinates = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
    colour = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    return material


def define_friction(stage: Usd.Stage, path: str, friction: float) -> UsdShade.Material:
    """A material that is nothing but friction."""
    material = UsdShade.Material.Define(stage, path)
    _make_physical(material, friction)
    return material


def bind_friction(prim: Usd.Prim, material: UsdShade.Material) -> None:
    """Give a prim and all below it the friction of a material, whatever they look like."""
    binding = UsdShade.MaterialBindingAPI.Apply(prim)
    binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")


def bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    """Give a prim and all below it a material."""
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def _define_matt(
    stage: Usd.Stage, path: str, friction: float
) -> tuple[UsdShade.Material, UsdShade.Shader]:
    material = UsdShade.Material.Define(stage, path)
    _make_physical(material, friction)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    return material, shader


def _make_physical(material: UsdShade.Material, friction: float) -> None:
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(friction)
    physics.CreateDynamicFrictionAttr(friction)
    physics.CreateRestitutionAttr(0.0)
