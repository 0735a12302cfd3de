"""Files that are given in the place of the raster that is meant."""

from __future__ import annotations

from glob import escape
from pathlib import Path

ARRAYS = {".npy", ".npz"}
"""Endings of NumPy's files."""
_HEADER = ".hdr"
_BESIDE = {_HEADER: (".img", ".dat", ".bsq", ".bil", ".bip", ".raw"), ".img": (".lbl",)}
"""Endings of the files that are opened instead of such a one."""


def file_to_open(path: Path) -> Path:
    """The file that is opened: of an ENVI header the data beside it, of PDS3 data the label."""
    if path.suffix.lower() == _HEADER and path.with_suffix("").is_file():  # dem.img.hdr
        return path.with_suffix("")
    return _beside(path, _BESIDE.get(path.suffix.lower(), ()))


def data_beside(path: Path) -> Path:
    """The file that a recipe names for one: as is opened, or data of any ending by a header."""
    found = _only_data(path) if path.suffix.lower() == _HEADER else None
    return found or file_to_open(path)


def remedy(path: Path) -> str:
    """What to do about a file that is no raster, in brackets; empty where nothing is known."""
    if path.suffix.lower() in ARRAYS:
        return (
            " (an array: save it as a GeoTIFF, or in Python give it to terrain_forge.plan as "
            "`heights`, with dtm: {kind: array})"
        )
    if (label := _beside(path, (".lbl",))) != path:
        return f" (it has a label: name {label.name})"
    if path.suffix.lower() == _HEADER and (data := _only_data(path)):
        return f" (a header: if {data.name} has its data, name that)"
    meant = file_to_open(path)
    if path.suffix.lower() == _HEADER and meant == path:
        names = ", ".join(path.stem + ending for ending in _BESIDE[_HEADER])
        return f" (a header alone: put its data beside it, as one of {path.stem}, {names})"
    return f" (the heights are in {meant.name}: name that)" if meant != path else ""


def _only_data(header: Path) -> Path | None:
    """A file beside a header that has its stem and an ending that we do not know."""
    known = {_HEADER, *_BESIDE[_HEADER], ".xml", ".txt", *ARRAYS}
    beside = header.parent.glob(f"{escape(header.stem)}.*")
    found = [file for file in beside if file.suffix.lower() not in known and file.is_file()]
    return found[0] if len(found) == 1 and file_to_open(header) == header else None


def _beside(path: Path, endings: tuple[str, ...]) -> Path:
    """The first of the files of that stem that has one of the endings, or the file itself."""
    found = {file.suffix.lower(): file for file in path.parent.glob(f"{escape(path.stem)}.*")}
    return next((found[ending] for ending in endings if ending in found), path)
