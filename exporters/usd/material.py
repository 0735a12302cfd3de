"""Materials: a preview surface for pictures and, on the same prim, friction for physics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdPhysics, UsdShade

from terrain_forge.base import linear_from_srgb

_KINDS = Sdf.ValueTypeNames
_NO_GLOSS = 1.0
"""Index of refraction of soil and rocks: of the usual 1.5 even the roughest surface is nearly white
towards a low Sun."""


def define_textured(
    stage: Usd.Stage,
    path: str,
    image: str,
    friction: float | None,
    *,
    wrap: str,
    factor: Sequence[float] = (1.0, 1.0, 1.0),
    scale: tuple[float, float] = (1.0, 1.0),
    offset: tuple[float, float] = (0.0, 0.0),
) -> UsdShade.Material:
    """A material without gloss that shows an sRGB image at `scale` · st + `offset`.

    Without friction it is visual-only. Beyond the image's edge lies the image again (`wrap`
    is `repeat`) or its rim (`clamp`); its linear light is multiplied by `factor`.
    """
    plain = friction is None
    material = (
        UsdShade.Material.Define(stage, path) if plain else define_friction(stage, path, friction)
    )
    shader = _surface(stage, material, roughness=1.0)
    shader.CreateInput("ior", _KINDS.Float).Set(_NO_GLOSS)
    coordinates = _coordinates(stage, f"{path}/st", "st")
    texture = _define_image(stage, f"{path}/image", image, "sRGB", wrap=wrap)
    if tuple(factor) != (1.0, 1.0, 1.0):
        texture.CreateInput("scale", _KINDS.Float4).Set(Gf.Vec4f(*factor, 1.0))
    if (scale, offset) != ((1.0, 1.0), (0.0, 0.0)):
        coordinates = _laid(stage, f"{path}/image_st", coordinates, scale, offset)
    texture.CreateInput("st", _KINDS.Float2).ConnectToSource(coordinates)
    colour = texture.CreateOutput("rgb", _KINDS.Float3)
    shader.CreateInput("diffuseColor", _KINDS.Color3f).ConnectToSource(colour)
    return material


def define_paint(stage: Usd.Stage, looks: str, rgb: Sequence[float]) -> UsdShade.Material:
    """The material of an sRGB colour, 0 to 1, in the scope `looks`."""
    path = f"{looks}/paint_{bytes(round(255 * value) for value in rgb).hex()}"
    if prim := stage.GetPrimAtPath(path):
        return UsdShade.Material(prim)
    material = UsdShade.Material.Define(stage, path)
    colour = Gf.Vec3f(*linear_from_srgb(np.array(rgb)).tolist())
    _surface(stage, material, roughness=0.6).CreateInput("diffuseColor", _KINDS.Color3f).Set(colour)
    return material


def add_normal_map(
    stage: Usd.Stage,
    path: str,
    image: str,
    *,
    scale: tuple[float, float] | None = None,
    offset: tuple[float, float] = (0.0, 0.0),
    coordinates: str | None = None,
) -> None:
    """Bend the light on a textured material by an image of normals that repeats.

    The image is -1 to 1 as 0 to 255, green towards v; it lies at `scale` · st + `offset`, or as the
    mesh's other `coordinates` say, or as the material's own image.
    """
    if coordinates is not None:
        place = _coordinates(stage, f"{path}/normals_st", coordinates)
    elif scale is None:
        image_st = UsdShade.Shader.Get(stage, f"{path}/image").GetInput("st")
        place = image_st.GetConnectedSources()[0][0]
    else:
        whole = UsdShade.Shader.Get(stage, f"{path}/st").GetOutput("result")
        place = _laid(stage, f"{path}/normals_st", whole, scale, offset)
    texture = _define_image(stage, f"{path}/normals", image, "raw", wrap="repeat")
    for name, value in (("scale", (2.0, 2.0, 2.0, 1.0)), ("bias", (-1.0, -1.0, -1.0, 0.0))):
        texture.CreateInput(name, _KINDS.Float4).Set(Gf.Vec4f(*value))
    texture.CreateInput("st", _KINDS.Float2).ConnectToSource(place)
    normals = texture.CreateOutput("rgb", _KINDS.Float3)
    surface = UsdShade.Shader.Get(stage, f"{path}/surface")
    surface.CreateInput("normal", _KINDS.Normal3f).ConnectToSource(normals)


def add_roughness_map(stage: Usd.Stage, path: str, image: str) -> None:
    """Let an image that repeats say how rough a textured material shines."""
    texture = _define_image(stage, f"{path}/roughness", image, "raw", wrap="repeat")
    place = UsdShade.Shader.Get(stage, f"{path}/st")
    texture.CreateInput("st", _KINDS.Float2).ConnectToSource(place.GetOutput("result"))
    surface = UsdShade.Shader.Get(stage, f"{path}/surface")
    rough = texture.CreateOutput("r", _KINDS.Float)
    surface.GetInput("roughness").ConnectToSource(rough)


def _coordinates(stage: Usd.Stage, path: str, name: str) -> UsdShade.Output:
    """A mesh's texture coordinates of a name."""
    kind = "UsdPrimvarReader_float2"
    reader = _shader(stage, path, kind, varname=(_KINDS.String, name))
    return reader.CreateOutput("result", _KINDS.Float2)


def _laid(
    stage: Usd.Stage,
    path: str,
    coordinates: UsdShade.Output,
    scale: tuple[float, float],
    offset: tuple[float, float],
) -> UsdShade.Output:
    """`scale` · (texture coordinates) + `offset`."""
    laid = {"scale": scale, "translation": offset}
    kinds = {name: (_KINDS.Float2, Gf.Vec2f(*value)) for name, value in laid.items()}
    place = _shader(stage, path, "UsdTransform2d", **kinds)
    place.CreateInput("in", _KINDS.Float2).ConnectToSource(coordinates)
    return place.CreateOutput("result", _KINDS.Float2)


def define_friction(stage: Usd.Stage, path: str, friction: float) -> UsdShade.Material:
    """A material that is nothing but friction."""
    material = UsdShade.Material.Define(stage, path)
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(friction)
    physics.CreateDynamicFrictionAttr(friction)
    physics.CreateRestitutionAttr(0.0)
    return material


def bind_friction(prim: Usd.Prim, material: UsdShade.Material) -> None:
    """Give a prim and all below it the friction of a material, whatever they look like."""
    binding = UsdShade.MaterialBindingAPI.Apply(prim)
    binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")


def bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    """Give a prim and all below it a material."""
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def _surface(stage: Usd.Stage, material: UsdShade.Material, *, roughness: float) -> UsdShade.Shader:
    """The preview surface that a material shows, of no metal."""
    figures = {"roughness": (_KINDS.Float, roughness), "metallic": (_KINDS.Float, 0.0)}
    shader = _shader(stage, f"{material.GetPath()}/surface", "UsdPreviewSurface", **figures)
    material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", _KINDS.Token))
    return shader


def _define_image(
    stage: Usd.Stage, path: str, image: str, colours: str, *, wrap: str
) -> UsdShade.Shader:
    wraps = dict.fromkeys(("wrapS", "wrapT"), (_KINDS.Token, wrap))
    told = {"file": (_KINDS.Asset, image), "sourceColorSpace": (_KINDS.Token, colours), **wraps}
    return _shader(stage, path, "UsdUVTexture", **told)


def _shader(
    stage: Usd.Stage, path: str, kind: str, **inputs: tuple[Sdf.ValueTypeName, Any]
) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(kind)
    for name, (type_name, value) in inputs.items():
        shader.CreateInput(name, type_name).Set(value)
    return shader
