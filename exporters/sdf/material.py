"""Materials: physically based ones for gz-sim, OGRE scripts for Gazebo Classic."""

from __future__ import annotations

from .markup import Lines, element, numbers
from .model import Model

Colour = tuple[float, float, float]

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


def plain(rgb: Colour) -> Lines:
    """A matt material of one colour (sRGB, 0 to 1)."""
    colour = numbers([*rgb, 1])
    return element(
        "material",
        element("ambient", colour),
        element("diffuse", colour),
        element("specular", "0 0 0 1"),
    )


def textured(model: Model, image: str, *, normals: str | None = None) -> Lines:
    """A matt material that shows an image of the model's materials/textures.

    Args:
        model: The model.
        image: Name of the image.
        normals: Name of its normal map, which Gazebo Classic does without.
    """
    if model.flavour == "classic":
        name = f"{model.name}/{image.removesuffix('.png')}"
        return element(
            "material",
            element(
                "script",
                element("uri", model.uri("materials/scripts")),
                element("uri", model.uri("materials/textures")),
                element("name", name),
            ),
        )
    metal = element(
        "metal",
        element("albedo_map", model.uri(f"materials/textures/{image}")),
        *([element("normal_map", model.uri(f"materials/textures/{normals}"))] if normals else []),
        element("roughness", "1"),
        element("metalness", "0"),
    )
    white = "1 1 1 1"
    return element(
        "material",
        element("ambient", white),
        element("diffuse", white),
        element("specular", "0 0 0 1"),
        element("pbr", metal),
    )


def write_scripts(model: Model, images: list[str], *, address: str) -> None:
    """Write the OGRE script that Gazebo Classic needs for the model's textured materials.

    Args:
        model: The model.
        images: Files of its textures.
        address: What lies beyond an image's edge: `wrap` for the image again, `clamp` for its rim.
    """
    names = [f"{model.name}/{image.removesuffix('.png')}" for image in images]
    scripts = [
        _SCRIPT.format(name=name, image=image, address=address)
        for name, image in zip(names, images, strict=True)
    ]
    path = model.path(f"materials/scripts/{model.name}.material")
    path.write_text("".join(scripts), encoding="utf-8", newline="\n")
