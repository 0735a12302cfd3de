"""Reading the user's own rover: which format, which files, then what of it is a rover."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from terrain_forge.base import DataError
from terrain_forge.rovers.assembly import Assembly
from terrain_forge.rovers.custom import FileRover, FoundRover
from terrain_forge.rovers.mesh_files import MeshFiles
from terrain_forge.rovers.packages import KEY, Packages, expand_xacro
from terrain_forge.rovers.rolling import make_rover
from terrain_forge.rovers.urdf import parse_xml, read_urdf

_XACRO = "http://www.ros.org/wiki/xacro", "http://wiki.ros.org/xacro"
_MESH_SUFFIXES = {".stl", ".obj", ".msh", ".png"}


def read_rover(spec: FileRover, folder: Path) -> FoundRover:
    """The rover of a URDF, xacro or MJCF file.

    Args:
        spec: What the recipe says about it.
        folder: What the recipe's paths are relative to.

    Raises:
        DataError: if a file is missing or cannot be read, or if it holds no wheeled rover.
    """
    file = folder / spec.file
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise DataError(f"no such file: {spec.file}", key=KEY) from None
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{spec.file} cannot be read as text: {error}", key=KEY) from None
    given = {name: folder / place for name, place in spec.packages.items()}
    root = parse_xml(text, spec.file)
    if root.tag == "mujoco":
        from terrain_forge.rovers.mjcf import read_mjcf

        assembly, files = read_mjcf(file), _mjcf_files(file, root)
    elif root.tag == "robot":
        assembly, files = _read_robot(file, text, Packages(given, file))
    else:
        raise DataError(
            f"{spec.file} is a <{root.tag}>, allowed: a URDF or xacro (<robot>), an MJCF "
            "(<mujoco>)",
            key=KEY,
        )
    return FoundRover(rover=make_rover(assembly, spec), files=tuple(dict.fromkeys(files)))


def _read_robot(file: Path, text: str, packages: Packages) -> tuple[Assembly, list[Path]]:
    files = [file]
    # Some URDFs were written from a xacro with a `$(optenv …)` left over.
    if "$(" in text or file.suffix == ".xacro" or any(name in text for name in _XACRO):
        text, included = expand_xacro(file, packages)
        files += included
    meshes = MeshFiles()
    robot = parse_xml(text, file.name)
    assembly = read_urdf(robot, file=file, packages=packages, meshes=meshes)
    return assembly, [*files, *meshes.read]


def _mjcf_files(file: Path, root: Element) -> list[Path]:
    """The model's file, those that it includes, its meshes and pictures."""
    files = [file]
    for include in root.iter("include"):
        other = file.parent / include.get("file", "")
        if other.is_file():
            files += _mjcf_files(other, parse_xml(other.read_text("utf-8"), other.name))
    compiler = root.find("compiler")
    place = {} if compiler is None else compiler.attrib
    for element in root.iter():
        name = element.get("file", "")
        if Path(name).suffix.lower() in _MESH_SUFFIXES:
            kind = "texturedir" if element.tag == "texture" else "meshdir"
            path = file.parent / place.get(kind, place.get("assetdir", "")) / name
            files += [path] if path.is_file() else []
    return files
