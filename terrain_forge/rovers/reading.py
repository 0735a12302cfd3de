"""Reading the user's own rover: which format, which files, then what of it is a rover."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from terrain_forge.base import TerrainForgeError
from terrain_forge.rovers.assembly import Assembly
from terrain_forge.rovers.bounds import FileError, parse_xml, read_xml
from terrain_forge.rovers.custom import FileRover, FoundRover
from terrain_forge.rovers.macros import expand_xacro
from terrain_forge.rovers.mesh_files import MeshFiles
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.rolling import make_rover
from terrain_forge.rovers.urdf import read_urdf

_LONGEST = 600
"""Characters of a message."""


def read_rover(spec: FileRover, folder: Path) -> FoundRover:
    """The rover of a URDF, xacro or MJCF file.

    Args:
        spec: What the recipe says about it.
        folder: What the recipe's paths are relative to.

    Raises:
        DataError: if a file is missing or cannot be read, or if it holds no wheeled rover.
    """
    with _one_line(spec.file):
        file = folder / spec.file
        given = {name: folder / place for name, place in spec.packages.items()}
        assembly, files = _read(spec, file, Packages(given, file))
        rover = make_rover(assembly, spec)
    return FoundRover(rover=rover, files=tuple(dict.fromkeys(files)))


def _read(spec: FileRover, file: Path, packages: Packages) -> tuple[Assembly, list[Path]]:
    root = read_xml(file, spec.file)
    if root.tag == "mujoco":
        from terrain_forge.rovers.mjcf import read_mjcf

        return read_mjcf(file, packages)
    if root.tag != "robot":
        raise FileError(
            f"{spec.file} is a <{root.tag}>, allowed: a URDF or xacro (<robot>), an MJCF (<mujoco>)"
        )
    files = [file]
    if file.suffix != ".xacro":
        _require_plain(root, spec.file)
    elif spec.trust:
        text, included = expand_trusted(file, packages)
        root, files = parse_xml(text, spec.file), [file, *included]
    else:
        root, included = expand_xacro(file, packages)
        files += included
    meshes = MeshFiles(packages)
    assembly = read_urdf(root, file=file, packages=packages, meshes=meshes)
    return assembly, [*files, *meshes.read]


def _require_plain(root: Element, name: str) -> None:
    for element in root.iter():
        if element.tag.startswith("xacro:"):
            raise FileError(
                f"{name} holds <{element.tag}>; a .urdf is not evaluated, name it .xacro"
            )


@contextmanager
def _one_line(name: str) -> Iterator[None]:
    """Turns whatever a file provokes into one line; libraries have nothing to say on their own."""
    log = logging.getLogger("trimesh")
    level = log.level
    try:
        log.setLevel(logging.CRITICAL + 1)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except TerrainForgeError as error:
        raise type(error)(_printable(str(error)), key=error.key) from None
    except RecursionError:
        raise FileError(_printable(f"{name} nests too deep")) from None
    except Exception as error:  # readers raise whatever a broken file provokes
        why = f"{type(error).__name__}: {error}"
        raise FileError(_printable(f"{name} cannot be read as a rover: {why}")) from None
    finally:
        log.setLevel(level)


def _printable(text: str) -> str:
    """One line that no terminal takes for a command."""
    line = " ".join(text.split())
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…"


def expand_trusted(file: Path, packages: Packages) -> tuple[bytes, tuple[Path, ...]]:
    """The URDF text of a xacro file, and the files that it includes.

    Raises:
        DataError: if the package `xacro` is not installed, or the file is not right.
    """
    try:
        import xacro
    except ImportError:
        raise FileError(
            f"{file.name} with `trust: true` needs the package xacro: "
            "pip install 'terrain-forge[xacro]'"
        ) from None
    xacro.all_includes.clear()
    try:
        with _finding(packages), redirect_stderr(StringIO()), redirect_stdout(StringIO()):
            text = str(xacro.process_file(str(file)).toxml())
    except TerrainForgeError:
        raise
    except Exception as error:  # xacro evaluates Python: whatever the file's expressions raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"{file.name}: xacro cannot expand it: {why}") from None
    return text.encode(), tuple(dict.fromkeys(map(Path, xacro.all_includes)))


@contextmanager
def _finding(packages: Packages) -> Iterator[None]:
    """Lets xacro's $(find PACKAGE) ask us, where it would ask an installed ROS."""
    from xacro import substitution_args

    original = substitution_args._eval_find
    substitution_args._eval_find = lambda package: str(packages.folder(package))
    try:
        yield
    finally:
        substitution_args._eval_find = original
