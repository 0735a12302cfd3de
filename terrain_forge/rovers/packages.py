"""ROS packages that a rover's file names, and expanding xacro, without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from terrain_forge.base import DataError

KEY = ("rover", "file")


class Packages:
    """Finds packages: those that the recipe names, else by the names of folders about the file.

    Args:
        given: Folder of each package that the recipe names.
        file: The rover's file.
    """

    def __init__(self, given: Mapping[str, Path], file: Path) -> None:
        self._given = given
        self._file = file

    def folder(self, package: str) -> Path:
        """The folder of a package.

        Raises:
            DataError: if it is not found.
        """
        if package in self._given:
            return self._given[package]
        for above in self._file.resolve().parents:
            for candidate in (above, above / package):
                if candidate.name == package and candidate.is_dir():
                    return candidate
        raise DataError(
            f"package {package!r} is not found above {self._file.name}: name its folder under "
            "packages",
            key=("rover", "packages"),
        )

    def path(self, name: str, beside: Path) -> Path:
        """The file that a mesh's `filename` means: package://, model://, file:// or a path."""
        for scheme in ("package://", "model://"):
            if name.startswith(scheme):
                package, _, rest = name.removeprefix(scheme).partition("/")
                return self.folder(package) / rest
        return beside / name.removeprefix("file://")


def expand_xacro(file: Path, packages: Packages) -> tuple[str, tuple[Path, ...]]:
    """The URDF text of a xacro file, and the files that it includes.

    Raises:
        DataError: if the package `xacro` is not installed, or the file is not right.
    """
    try:
        import xacro
    except ImportError:
        raise DataError(
            f"{file.name} is a xacro file, which needs the package xacro: "
            "pip install 'terrain-forge[xacro]'",
            key=KEY,
        ) from None
    xacro.all_includes.clear()
    try:
        with _finding(packages):
            text = str(xacro.process_file(str(file)).toxml())
    except DataError:
        raise
    except Exception as error:  # xacro evaluates Python: whatever the file's expressions raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{file.name}: xacro cannot expand it: {why}", key=KEY) from None
    return text, tuple(dict.fromkeys(map(Path, xacro.all_includes)))


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
