"""A static model in a folder of its own, and what links consist of: shapes, masses, looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.model import Shape, moments
from terrain_forge.writers import Lines, Value, element, leaves, write_xml

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


@dataclass(frozen=True, kw_only=True)
class Model:
    """Where a model's files go and how SDF refers to them."""

    folder: Path
    """`models/NAME` of the export."""
    classic: bool
    """Whether Gazebo Classic shall read it."""
    version: str
    """Version of SDF."""
    relief: bool = True
    """Whether its materials have maps of normals and roughness; not for Gazebo Classic."""
    address: str = ""
    """Its folder as seen from a resource path, where that is not the folder's name."""
    called: str = ""
    """Its name, where that is not the folder's."""

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.called or self.folder.name

    def path(self, name: str) -> Path:
        """The path of one of the model's files; makes its folder."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def uri(self, name: str) -> str:
        """The URI of one of the model's files."""
        return f"model://{self.address or self.name}/{name}"

    def write(self, *, title: str, links: list[Lines]) -> None:
        """Write model.sdf, a static model of the links, and model.config."""
        body = element("model", element("static", "true"), *links, name=self.name)
        write_xml(self.path("model.sdf"), element("sdf", body, version=self.version))
        write_config(self.folder, "model.sdf", self.version, name=title, description=title)

    def textured(
        self,
        image: str,
        *,
        normals: str | None = None,
        roughness: str | None = None,
        factor: Sequence[float] = (1.0, 1.0, 1.0),
    ) -> Lines:
        """A matt material that shows an image of the model's materials/textures.

        Gazebo Classic does without its maps of `normals` and `roughness`, and without the linear
        `factor` on its colours.
        """
        if self.classic:
            uris = [element("uri", self.uri(path)) for path in ("materials/scripts", TEXTURES)]
            name = element("name", self._script_name(image))
            return element("material", element("script", *uris, name))
        maps = {"albedo_map": image} | ({"normal_map": normals} if normals else {})
        maps |= {"roughness_map": roughness} if roughness else {}
        uris_of_maps = {name: self.uri(f"{TEXTURES}/{file}") for name, file in maps.items()}
        metal = element("metal", *leaves(**uris_of_maps, roughness=1, metalness=0))
        shade = " ".join(f"{part:.6g}" for part in (*factor, 1.0))
        return _matt(shade, element("pbr", metal))

    def write_scripts(self, images: list[str], *, address: str) -> None:
        """Write the OGRE script that Gazebo Classic needs for textured materials, if it reads this.

        Beyond an image's edge lies the image again (`address` is `wrap`) or its rim (`clamp`).
        """
        if not self.classic or not images:
            return
        scripts = [
            _SCRIPT.format(name=self._script_name(image), image=image, address=address)
            for image in images
        ]
        path = self.path(f"materials/scripts/{self.name}.material")
        path.write_text("".join(scripts), encoding="utf-8", newline="\n")

    def _script_name(self, image: str) -> str:
        return f"{self.name}/{image.removesuffix('.png')}"


def write_config(folder: Path, file: str, version: str, *, name: str, description: str) -> None:
    """Write model.config, by which Gazebo finds the model of an SDF file."""
    config = element(
        "model",
        *leaves(name=name, version="1.0"),
        element("sdf", file, version=version),
        element("author", *leaves(name="terrain-forge")),
        *leaves(description=description),
    )
    write_xml(folder / "model.config", config)


def usable_name(name: str) -> str:
    """The name of a world or a model: SDF keeps `world` for itself."""
    return "the_world" if name == "world" else name


def mesh(uri: str) -> Lines:
    """The geometry of a mesh file."""
    return element("geometry", element("mesh", *leaves(uri=uri)))


def surface(friction: float, *, patch_radius: float | None = None) -> Lines:
    """What a collision feels like; gz-sim reads ODE's names too.

    A contact of a `patch_radius` [m] resists turning on the spot.
    """
    kinds = [element("ode", *leaves(mu=friction, mu2=friction))]
    if patch_radius is not None:
        turning = leaves(coefficient=friction, patch_radius=patch_radius)
        kinds.append(element("torsional", *turning))
    return element("surface", element("friction", *kinds))


def plain(rgb: Sequence[float], *, classic: bool = False) -> Lines:
    """A matt material of one colour (sRGB, 0 to 1).

    Classic shows what is written; gz-sim takes it for linear light and encodes what it shows.
    """
    return _matt((*(rgb if classic else linear_from_srgb(rgb).tolist()), 1))


def _matt(colour: Value, *more: Lines) -> Lines:
    looks = leaves(ambient=colour, diffuse=colour, specular="0 0 0 1")
    return element("material", *looks, *more)


def inertial(mass: float, tensor: Array, *, centre: Array | None = None, digits: int = 9) -> Lines:
    """Mass [kg], inertia about the centre of mass [kg m²], and where that is [m], if not at 0."""
    exact = partial(leaves, digits=digits)
    place = [] if centre is None else exact(pose=(*centre, 0, 0, 0))
    return element(
        "inertial", *place, *exact(mass=mass), element("inertia", *exact(**moments(tensor)))
    )


def solid(shape: Shape, uri: str, *, digits: int = 9) -> Lines:
    """The geometry of a shape, whose mesh, if it is one, is at a URI."""
    told: dict[str, Value] = {"uri": uri}
    if shape.kind == "box":
        told = {"size": shape.size}
    elif shape.kind != "mesh":
        told = dict(zip(("radius", "length"), shape.size, strict=False))
    return element("geometry", element(shape.kind, *leaves(digits=digits, **told)))
