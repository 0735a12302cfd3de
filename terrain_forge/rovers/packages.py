"""Which files a rover's file may name, ROS packages among them, without ROS."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from terrain_forge.base import lies_within
from terrain_forge.rovers.bounds import FileError

_BESIDE = ("assets", "materials", "mesh", "meshes", "robots", "textures", "urdf", "xacro")
"""Folders that may lie beside that of a file which is in no package."""
_WILD = re.compile(r"[*?[]")
_NEAR = 4
"""Folders above a file of which one may be a package without a package.xml."""


class Packages:
    """Finds packages and files, none of them outside of what the rover is made of.

    A rover's files lie below the package that its file is in (the nearest folder above it with a
    package.xml); without one, below the file's own folder or in one like `meshes` beside that; or
    below a package that the recipe names or that a path of the file names.

    Args:
        given: Folder of each package that the recipe names.
        file: The rover's file.
        library: A folder that it may also use.
    """

    def __init__(
        self, given: Mapping[str, Path], file: Path, *, library: Path | None = None
    ) -> None:
        self._known = {name: place.absolute() for name, place in given.items()}
        self._library = library
        self._file = file.resolve()
        self._home = next(filter(_is_package, self._file.parents), None)
        folder = self._file.parent
        self._roots = [folder if self._home is None else self._home]
        if self._home is None:
            self._roots += [folder.parent / name for name in _BESIDE]
        self._roots += [place.resolve() for place in given.values()]
        self._roots += [] if library is None else [library.resolve()]

    def folder(self, package: str) -> Path:
        """The folder of a package: named by the recipe, or found by its name about the file.

        Without a package.xml, it is a folder close above the file, or beside it or its package.

        Raises:
            DataError: if it is not found.
        """
        if package in self._known:
            return self._known[package]
        if package and Path(package).name == package and package != "..":
            beside = (self._file.parent, (self._home or self._file.parent).parent)
            for level, above in enumerate(self._file.parents):
                for folder, bare in ((above, level < _NEAR), (above / package, above in beside)):
                    if folder.name == package and _is_found(folder, bare=bare):
                        self._known[package] = folder
                        self._roots.append(folder.resolve())
                        return folder
        raise FileError(
            f"package {package[:80]!r} is not found about {self._file.name}: name its folder under "
            "packages",
            key=("rover", "packages"),
        )

    def path(self, name: str, beside: Path) -> Path:
        """The file that a path means: package://, model://, file://, absolute or beside a folder.

        Raises:
            DataError: if it lies outside of the rover's folders.
        """
        scheme, mark, rest = name.partition("://")
        if scheme in ("package", "model") and mark:
            package, _, rest = rest.partition("/")
            path = self.folder(package) / rest
        elif mark and scheme != "file":
            raise FileError(f"{name[:200]!r} is no file: only package://, file:// are")
        else:
            path = beside / (rest if mark else name)
        self.require(path, name)
        return path

    def found(self, name: str, beside: Path) -> list[Path]:
        """The files that an include means: one, or all that fit a `*.xacro` in their order.

        Raises:
            DataError: if one lies outside of the rover's folders.
        """
        path = self.path(name, beside)
        if not _WILD.search(name):
            alike = self._library / name if self._library else path
            return [path if path.is_file() else alike]
        if not path.parent.is_dir():
            raise FileError(f"{name[:200]!r}: there is no such folder")
        files = sorted(path.parent.glob(path.name))
        for file in files:
            self.require(file, str(file))
        return files

    def require(self, path: Path, name: str) -> None:
        """Refuse a path that lies outside of the rover's folders, links followed.

        Raises:
            DataError: if it does.
        """
        try:
            inside = lies_within(path, self._roots)
        except (OSError, RuntimeError, ValueError) as error:
            raise FileError(f"{name[:200]!r} is no path: {error}") from None
        if not inside:
            raise FileError(
                f"{name[:200]!r} lies outside of {self._roots[0].name!r}, the folder of "
                f"{self._file.name}: name its own folder under packages",
                key=("rover", "packages"),
            )


def _is_package(folder: Path) -> bool:
    return folder != folder.parent and (folder / "package.xml").is_file()


def _is_found(folder: Path, *, bare: bool) -> bool:
    """Whether a folder may be a package: by its package.xml, or without one where it is `bare`."""
    try:
        whole = folder.resolve()
        if whole.parent == whole.parent.parent or not whole.is_dir():  # such as /etc
            return False
        return _is_package(whole) or (bare and whole == folder and whole not in _personal())
    except (OSError, RuntimeError, ValueError):
        return False


def _personal() -> tuple[Path, ...]:
    """The user's own folder and those above it."""
    try:
        home = Path.home().resolve()
    except RuntimeError:
        return ()
    return (home, *home.parents)
