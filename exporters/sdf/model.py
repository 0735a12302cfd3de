"""A static model in its own folder: the unit that Gazebo finds, loads and places."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .markup import Lines, element, leaves, write_document


@dataclass(frozen=True, kw_only=True)
class Model:
    """Where a model's files go and how SDF refers to them."""

    folder: Path
    """`models/NAME` of the export."""
    name: str
    """Name of the model, and of its folder."""
    flavour: str
    """`gz` or `classic`."""
    version: str
    """Version of SDF."""

    def path(self, name: str) -> Path:
        """The path of one of the model's files; makes its folder."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def uri(self, name: str) -> str:
        """The URI of one of the model's files."""
        return f"model://{self.name}/{name}"

    def write(self, *, title: str, links: list[Lines]) -> None:
        """Write model.sdf, a static model of the links, and model.config."""
        body = element("model", element("static", "true"), *links, name=self.name)
        write_document(self.path("model.sdf"), self.version, body)
        config = element(
            "model",
            *leaves(name=title, version="1.0"),
            element("sdf", "model.sdf", version=self.version),
            element("author", *leaves(name="terrain-forge")),
            *leaves(description=title),
        )
        text = "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *config]) + "\n"
        self.path("model.config").write_text(text, encoding="utf-8", newline="\n")


def mesh(uri: str) -> Lines:
    """The geometry of a mesh file."""
    return element("geometry", element("mesh", *leaves(uri=uri)))


def surface(friction: float, *, patch_radius: float | None = None) -> Lines:
    """What a collision feels like; gz-sim reads ODE's names too.

    Args:
        friction: Coulomb friction.
        patch_radius: Radius of a contact [m], which then resists turning on the spot.
    """
    kinds = [element("ode", *leaves(mu=friction, mu2=friction))]
    if patch_radius is not None:
        turning = leaves(coefficient=friction, patch_radius=patch_radius)
        kinds.append(element("torsional", *turning))
    return element("surface", element("friction", *kinds))
