"""Meshes of a rover's file: read in metres, one for each colour, and their convex hulls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, TerrainForgeError, placed, portable, require_gltf
from terrain_forge.model import Mesh
from terrain_forge.rovers import bounds
from terrain_forge.rovers.assembly import Solid, bare_shape
from terrain_forge.rovers.bounds import FileError
from terrain_forge.rovers.packages import Packages

_GREY = (0.6, 0.6, 0.6)
_THINNEST = 1e-5
"""Smallest thickness of what is touched [m]; exports round its corners to 1e-6."""
Part = tuple[Array, NDArray[np.int32], tuple[float, ...]]
"""Vertices, faces and colour."""


class MeshFiles:
    """Reads each mesh file once; remembers which files it read.

    Args:
        packages: Which files they may name.
    """

    def __init__(self, packages: Packages) -> None:
        self.read: dict[Path, list[Part]] = {}
        self._packages = packages
        self._hulls: dict[tuple[Path, bytes], tuple[Array, NDArray[np.int32]]] = {}
        self._triangles = 0

    def solids(
        self,
        path: Path,
        *,
        scale: Array,
        placement: Array,
        collides: bool,
        rgb: tuple[float, float, float] | None,
    ) -> list[Solid]:
        """The mesh of a file as solids: a solid for each colour to look at, a hull to touch.

        Args:
            path: The file.
            scale: Factors along the file's axes, shape [3].
            placement: In the body's frame, shape [4, 4].
            collides: Whether to touch, else to look at.
            rgb: Colour in place of the file's own.

        Raises:
            DataError: if it is missing or no mesh, or scaled to nothing.
        """
        if np.abs(scale).min() < bounds.SMALLEST:
            found = " ".join(f"{value:g}" for value in scale)
            raise FileError(f"mesh {path.name} has the scale {found}, at least {bounds.SMALLEST:g}")
        if path not in self.read:
            self.read[path] = _load(path, self._packages)
        turn = -1 if np.prod(np.sign(scale)) < 0.0 else 1  # what is mirrored would be inside out
        parts = [(v * scale, f[:, ::turn], colour) for v, f, colour in self.read[path]]
        if not all(np.abs(v).max() <= bounds.FARTHEST for v, _, _ in parts):
            raise FileError(
                f"mesh {path.name} has vertices beyond {bounds.FARTHEST:g} m, or none that are "
                "numbers: is its scale right?"
            )
        if collides:
            place = (path, scale.tobytes())
            if place not in self._hulls:
                self._hulls[place] = hull_of(np.concatenate([v for v, _, _ in parts]), path.name)
            vertices, faces = self._hulls[place]
            return [mesh_solid(vertices, faces, placement, collides=True, rgb=_GREY)]
        self._triangles += sum(len(f) for _, f, _ in parts)
        bounds.require_below(self._triangles, bounds.MOST_TRIANGLES, "triangles", "the rover")
        return [
            mesh_solid(v, f, placement, collides=False, rgb=rgb or (c[0], c[1], c[2]))
            for v, f, c in parts
        ]


def mesh_solid(
    vertices: Array,
    faces: NDArray[np.int32],
    placement: Array,
    *,
    collides: bool,
    rgb: tuple[float, float, float],
) -> Solid:
    """Triangles as a solid, whose origin becomes the centre of their box."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = (low + high) / 2
    shape = bare_shape(
        kind="mesh",
        size=tuple((high - low).tolist()),
        collides=collides,
        visible=not collides,
        rgb=rgb,
        mesh=Mesh(vertices=vertices - centre, faces=faces),
    )
    return portable.product(placement, placed(centre, np.eye(3))), shape


def hull_of(vertices: Array, name: str) -> tuple[Array, NDArray[np.int32]]:
    """The convex hull of points, shape [n, 3].

    Raises:
        DataError: if they lie in a plane, or nearly.
    """
    import trimesh

    spread = vertices - vertices.mean(axis=0)
    _, axes = portable.eigh(portable.product(spread.T, spread))
    if float(np.ptp(portable.product(spread, axes[:, 0]))) < _THINNEST:
        raise FileError(f"{name}: a mesh that is flat cannot be collided with")
    hull = trimesh.convex.convex_hull(vertices)
    return np.array(hull.vertices, np.float64), np.array(hull.faces, np.int32)


def _load(path: Path, packages: Packages) -> list[Part]:
    import trimesh

    name, kind = f"mesh {path.name[:200]}", path.suffix.lower().removeprefix(".")
    if kind not in _READ_AS:
        raise FileError(f"{name}: allowed are {', '.join(_READ_AS)}")
    if not path.exists():
        raise FileError(f"{name} is missing: looked for {path}")
    data = bounds.read_file(path, name, most=bounds.MOST_MESH)
    try:
        if kind in _CHECKS:
            _CHECKS[kind](data)
        if kind == "dae":
            data = _without_lost_materials(data)
        beside: Any = _Beside(path.parent, packages)
        scene = trimesh.load_scene(BytesIO(data), file_type=kind, resolver=beside, process=False)
        for mesh in scene.geometry.values():
            if not np.isfinite(mesh.vertices).all():  # trimesh would leave them out
                raise FileError(f"{name} has vertices that are no numbers")
            if isinstance(mesh, trimesh.Trimesh):
                mesh.process()
        shown = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
        triangles = sum(len(getattr(mesh, "faces", ())) for mesh in shown)
        bounds.require_below(triangles, bounds.MOST_TRIANGLES, "triangles", name)
        if kind == "dae" and scene.units not in (None, "m", "meter", "meters"):
            scene = scene.convert_units("meters")
        meshes = [m for m in scene.dump() if isinstance(m, trimesh.Trimesh) and len(m.faces)]
    except TerrainForgeError:
        raise
    except Exception as error:  # trimesh's readers raise whatever a broken file provokes
        if isinstance(error, ImportError) and kind == "dae":
            raise FileError(f"{name} needs the package {error.name}") from None
        why = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"{name} cannot be read: {why}") from None
    parts: dict[tuple[float, ...], list[Any]] = {}
    for mesh in meshes:
        if mesh.vertices.shape[1:] != (3,) or mesh.faces.shape[1:] != (3,):
            raise FileError(f"{name} is flat, or not made of triangles")
        if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
            raise FileError(f"{name} has triangles of vertices that it lacks")
        parts.setdefault(_colour(mesh), []).append(mesh)
    if not parts:
        raise FileError(f"{name} holds no triangles")
    joined: dict[tuple[float, ...], Any] = {
        colour: trimesh.util.concatenate(some) for colour, some in parts.items()
    }
    return [
        (np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int32), colour)
        for colour, mesh in joined.items()
    ]


@dataclass(frozen=True)
class _Beside:
    """Lets trimesh read what a mesh names: materials and buffers, of the rover's own folders."""

    folder: Path
    packages: Packages

    def get(self, name: str) -> bytes:
        """The content of a file; textures are not read."""
        path = self.packages.path(str(name), self.folder)
        if path.suffix.lower() not in (".mtl", ".bin"):
            raise FileNotFoundError(path.name)
        return bounds.read_file(path, path.name, most=bounds.MOST_MESH)

    __getitem__ = get


def _check_collada(data: bytes) -> None:
    """Refuse a COLLADA file that declares entities, or whose nodes repeat each other endlessly."""
    if b"\0" in data or b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise ValueError("it declares entities, or is no text of single bytes")
    root = ElementTree.fromstring(data)
    space = root.tag.partition("}")[0] + "}" if "}" in root.tag else ""
    marked = {e.get("id"): e for e in root.iter() if e.get("id")}
    known: dict[Element, int] = {}

    def size(element: Element) -> int:
        """Characters of all geometry that an element shows, once for each time it does."""
        if element not in known:
            known[element] = bounds.MOST_MESH  # while it is not known: a loop is endless
            total = 1
            for child in element:
                target = marked.get(child.get("url", "")[1:])
                if child.tag.startswith(f"{space}instance_") and target is not None:
                    texts = (part.text or "" for part in target.iter())
                    total += sum(map(len, texts)) if "geometry" in child.tag else size(target)
                elif child.tag in (f"{space}node", f"{space}visual_scene"):
                    total += size(child)
            known[element] = total
        return known[element]

    if sum(map(size, root.iter(f"{space}visual_scene"))) > bounds.MOST_MESH:
        raise ValueError("its nodes repeat each other too often")


def _without_lost_materials(data: bytes) -> bytes:
    """A COLLADA file without the uses of materials that cannot be read.

    pycollada leaves out a geometry with such a use, as of a texture whose image is not declared.
    """
    import collada

    root = ElementTree.fromstring(data)
    space = root.tag.partition("}")[0] + "}" if "}" in root.tag else ""
    looks = Element(root.tag, root.attrib)
    looks_like = "asset", "library_images", "library_effects", "library_materials"
    kinds = {space + name for name in looks_like}
    looks.extend(child for child in root if child.tag in kinds)
    read = collada.Collada(BytesIO(ElementTree.tostring(looks)), ignore=[collada.DaeError])
    lost = False
    for parent in root.iter(f"{space}technique_common"):
        for use in parent.findall(f"{space}instance_material"):
            if use.get("target", "")[1:] not in read.materials:
                parent.remove(use)
                lost = True
    return ElementTree.tostring(root) if lost else data


_READ_AS = ("stl", "obj", "dae", "ply", "off", "glb", "gltf")
_check_gltf = partial(require_gltf, most=200_000_000)
_CHECKS: dict[str, Callable[[bytes], None]] = {
    "dae": _check_collada, "glb": _check_gltf, "gltf": _check_gltf
}  # fmt: skip


def _colour(mesh: Any) -> tuple[float, ...]:
    """The mesh's main sRGB colour, 0 to 1; grey where it has none."""
    colour = getattr(getattr(mesh.visual, "material", None), "main_color", None)
    if colour is None:
        colour = mesh.visual.main_color if mesh.visual.defined else np.multiply(255, _GREY)
    return tuple((np.asarray(colour, np.float64)[:3] / 255.0).round(3).tolist())
