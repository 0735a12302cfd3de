"""Materials: physically based ones for gz-sim, OGRE scripts for Gazebo Classic."""

from __future__ import annotations

from collections.abc import Sequence

from .markup import Lines, element, leaves, numbers
from .model import Model

TEXTURES = "materials/textures"
"""Where a model's images lie."""

_SCRIPT = """material {name}
{{
  technique
  {{
    pass
    {{
      ambient 1 1 1 1
      diffuse 1 1 1 1
      specular 0 0 0 1 0
      texture_unit
      {{
        texture {image}
        tex_address_mode {address}
        filtering anisotropic
        max_anisotropy 8
      }}
    }}
  }}
}}
"""


def plain(rgb: Sequence[float]) -> Lines:
    """A matt material of one colour (sRGB, 0 to 1)."""
    return _matt(numbers([*rgb, 1]))


def textured(model: Model, image: str, *, normals: str | None = None) -> Lines:
    """A matt material that shows an image of the model's materials/textures.

    Args:
        model: The model.
        image: Name of the image.
        normals: Name of its normal map, which Gazebo Classic does without.
    """
    if model.flavour == "classic":
        script = element(
            "script",
            element("uri", model.uri("materials/scripts")),
            element("uri", model.uri(TEXTURES)),
            element("name", _script_name(model, image)),
        )
        return element("material", script)
    maps = {"albedo_map": image} | ({"normal_map": normals} if normals else {})
    uris = {name: model.uri(f"{TEXTURES}/{file}") for name, file in maps.items()}
    metal = element("metal", *leaves(**uris, roughness=1, metalness=0))
    return _matt("1 1 1 1", element("pbr", metal))


def write_scripts(model: Model, images: list[str], *, address: str) -> None:
    """Write the OGRE script that Gazebo Classic needs for the model's textured materials.

    Args:
        model: The model.
        images: Files of its textures.
        address: What lies beyond an image's edge: `wrap` for the image again, `clamp` for its rim.
    """
    scripts = [
        _SCRIPT.format(name=_script_name(model, image), image=image, address=address)
        for image in images
    ]
    path = model.path(f"materials/scripts/{model.name}.material")
    path.write_text("".join(scripts), encoding="utf-8", newline="\n")


def _script_name(model: Model, image: str) -> str:
    return f"{model.name}/{image.removesuffix('.png')}"


def _matt(colour: str, *more: Lines) -> Lines:
    looks = leaves(ambient=colour, diffuse=colour, specular="0 0 0 1")
    return element("material", *looks, *more)
