"""What an MJCF holds and names, looked at before MuJoCo loads it: no file of others, no bombs."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from terrain_forge.rovers import bounds
from terrain_forge.rovers.bounds import FileError
from terrain_forge.rovers.packages import Packages

_MOST_ELEMENTS = 200_000
_LIMITS = {
    "copies": 1_000,  # that `replicate`, `composite`, `flexcomp` and `attach` make, in all
    "elements": _MOST_ELEMENTS,
    "bodies": bounds.MOST_LINKS,
    "geoms": bounds.MOST_SHAPES,
}
_CAPS = {
    **dict.fromkeys(("width", "height", "nrow", "ncol"), 8192),
    **dict.fromkeys(("params", "maxhullvert", "nkey", "nuserdata"), 1000),
    **dict.fromkeys(("njmax", "nconmax"), 1_000_000),
}
_DIRECTORIES = ("meshdir", "texturedir", "assetdir")
_MODELS = ("include", "model")
_COUNTED = {"body": "bodies", "geom": "geoms"}
_COPYING = ("replicate", "composite", "flexcomp", "attach")
_TEXTS = ("name", "class", "childclass", "prefix", "model", "data", "value", "comment")
_NO_NUMBER = re.compile(r"(?i)(?<![\w.])[-+]?(nan|inf|infinity)(?![\w.])")
_PIXELS = 2**26


def check_mjcf(file: Path, packages: Packages) -> list[Path]:
    """The model's file, those that it includes, its meshes and pictures.

    Raises:
        DataError: if one lies outside of the rover's folders, is no regular file or too large, or
            if the model repeats itself too often.
    """
    found = _Model(file, packages)
    found.read(file, file.name)
    if any(part.attached for part in found.parts):
        raise FileError(f"{file.name}: a model that is attached attaches others")
    for what, most in _LIMITS.items():
        attached = found.attached * sum(part.counts[what] for part in found.parts)
        bounds.require_below(found.counts[what] + attached, most, what, file.name)
    return [path for model in (found, *found.parts) for path in (*model.files, *model.assets())]


@dataclass
class _Model:
    """Counts what a model has, copies included, and gathers the files that it names."""

    main: Path
    packages: Packages
    files: list[Path] = field(default_factory=list)
    parts: list[_Model] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    attached: int = 0
    strips: bool = False
    names: dict[str, str] = field(default_factory=dict)
    """The tag of an element by the file that it names."""
    missing: list[FileError] = field(default_factory=list)
    """What is to be said of models that are nowhere, once nothing worse is found."""
    directories: list[str] = field(default_factory=lambda: [""])

    def read(self, file: Path, name: str, times: int = 1) -> None:
        """Read a file that stands so many times in the model."""
        self.files.append(file)
        self._walk(bounds.read_xml(file, name), file, times)

    def _walk(self, element: Element, file: Path, times: int) -> None:
        for what in ("elements", _COUNTED.get(element.tag, "others")):
            self.counts[what] += times
        if element.tag in _COPYING:
            copies = math.prod(max(n, 1.0) for n in _numbers(element.get("count", "1")))
            times *= int(min(copies, 1e9))
            self.counts["copies"] += times
            self.attached += times * (element.tag == "attach")
            bounds.require_below(self.counts["copies"], _LIMITS["copies"], "copies", file.name)
        for key, text in element.attrib.items():
            self._look_at(element, key, text)
        if element.tag in _MODELS and "file" in element.attrib:
            self._follow(element, file, times)
        for child in element:
            self._walk(child, file, times)

    def _follow(self, element: Element, file: Path, times: int) -> None:
        """Read a file that is included or attached; MuJoCo looks for it beside the model's own."""
        name = element.attrib["file"]
        places = [f.parent / name for f in dict.fromkeys((self.main, file))]
        for path in filter(_is_there, dict.fromkeys(places)):
            self.packages.require(path, name)
            if element.tag == "model" and all(path != part.files[0] for part in self.parts):
                self.parts.append(_Model(path, self.packages))
                self.parts[-1].read(path, name)
            elif element.tag == "include" and path not in self.files:
                self.read(path, name, times)
        if not any(map(_is_there, places)):
            self.missing.append(_missing(self.main, element.tag, name, places))

    def _look_at(self, element: Element, key: str, text: str) -> None:
        if key in _DIRECTORIES:
            self.directories.append(text)
        elif key.startswith("file"):
            if element.tag not in _MODELS:
                self.names.setdefault(text, element.tag)
        elif key == "strippath":
            self.strips |= text != "false"
        elif key == "memory":
            if _bytes(text) > 2**32:
                raise FileError(f"{element.tag} memory={text[:40]!r}: at most 4 GB")
        elif key not in _TEXTS:
            if _NO_NUMBER.search(text):
                raise FileError(f"{element.tag} {key}={text[:80]!r}: must be numbers")
            most = 1000 if key.startswith("nuser") else _CAPS.get(key, math.inf)
            if any(number > most for number in _numbers(text)):
                raise FileError(f"{element.tag} {key}={text[:80]!r}: at most {most:g}")

    def assets(self) -> list[Path]:
        """Meshes, pictures and fields, wherever MuJoCo may look for them.

        Raises:
            DataError: for one that must not be read, or is not there.
        """
        for error in self.missing:
            raise error
        found: dict[Path, None] = {}
        bases = dict.fromkeys(file.parent / d for file in self.files for d in self.directories)
        bounds.require_below(len(bases) * len(self.names), _MOST_ELEMENTS, "paths", self.main.name)
        for name, tag in self.names.items():
            spellings = dict.fromkeys((Path(name).name, name)) if self.strips else (name,)
            paths = [p for s in spellings for b in bases if _is_there(p := b / s)]
            if not paths:
                raise _missing(self.main, tag, name, [base / name for base in bases])
            for path in paths:
                self.packages.require(path, name)
                _check_asset(path, name[:200])
                found[path] = None
        return list(found)


def _is_there(path: Path) -> bool:
    return path.exists() or path.is_symlink()


def _missing(main: Path, tag: str, name: str, places: list[Path]) -> FileError:
    """The error of a file that a model names and that is nowhere."""
    looked = ", ".join(dict.fromkeys(str(place.parent)[-200:] for place in places[:3]))
    return FileError(f"{main.name}: the file {name[:200]!r} of a <{tag}> is not there, in {looked}")


def _check_asset(path: Path, name: str) -> None:
    head = bounds.read_file(path, name, most=bounds.MOST_MESH)[:24]
    width, height = (int.from_bytes(head[n : n + 4], "big") for n in (16, 20))
    if head[1:4] == b"PNG" and width * height > _PIXELS:
        raise FileError(f"{name} has {width} × {height} pixels, too many")


def _numbers(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def _bytes(text: str) -> float:
    """A size as MuJoCo writes it, such as 10M; without end where it cannot be read."""
    found = re.fullmatch(r"\s*(-?\d+)\s*([KMGTPE]?)\s*", text, re.IGNORECASE)
    if not found:
        return math.inf
    return float(found[1]) * 1024.0 ** (" KMGTPE".index((found[2] or " ").upper()))
