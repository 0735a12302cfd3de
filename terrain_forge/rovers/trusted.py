"""Expanding a xacro that the user trusts: the package `xacro` runs its expressions as Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from terrain_forge.base import DataError
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.rover_xml import KEY


def expand_trusted(file: Path, packages: Packages) -> tuple[bytes, tuple[Path, ...]]:
    """The URDF text of a xacro file, and the files that it includes.

    Raises:
        DataError: if the package `xacro` is not installed, or the file is not right.
    """
    try:
        import xacro
    except ImportError:
        raise DataError(
            f"{file.name} with `trust: true` needs the package xacro: "
            "pip install 'terrain-forge[xacro]'",
            key=KEY,
        ) from None
    xacro.all_includes.clear()
    try:
        with _finding(packages), redirect_stderr(StringIO()), redirect_stdout(StringIO()):
            text = str(xacro.process_file(str(file)).toxml())
    except DataError:
        raise
    except Exception as error:  # xacro evaluates Python: whatever the file's expressions raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{file.name}: xacro cannot expand it: {why}", key=KEY) from None
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
