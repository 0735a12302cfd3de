"""Input files and saved worlds with broken bytes."""

from __future__ import annotations

import io
import json
import os
import random
import shutil
import struct
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fuzz import samples
from tests.fuzz.recipes import NUMBERS, TEXTS

VALIDATE = "validate", "world", "--quick"
"""A command, of which `world` is the folder that is broken."""


@dataclass(frozen=True, kw_only=True)
class Folder:
    """A folder that a command made."""

    path: Path
    known: tuple[str, ...]
    """Files of it that others read; they are broken more often than the others."""
    commands: tuple[tuple[str, ...], ...]
    """What reads them."""


def folder_of_world(path: Path) -> Folder:
    """What a build made."""
    return Folder(
        path=path,
        known=(
            *("world/world.json", "world/arrays.npz", "world/shared.npz", "manifest.json"),
            *("paths/way.csv", "report.html"),
        ),
        commands=(
            *(VALIDATE, VALIDATE, ("export", "world", "--only", "geotiff")),
            ("view", "world", "--no-browser"),
        ),
    )


def folder_of_recording(path: Path) -> Folder:
    """A world that was recorded, and systems evaluated on it."""
    stamp = 1_600_000_000_000_000_000
    known = (
        *("dataset.json", "plan.json", "formats.json", "written.csv", "slam/evaluation.json"),
        *("slam/evaluation.csv", "slam/evaluation.txt", "calibration/README.txt"),
        *("slam/imu_1/imu.tum", "slam/imu_1/errors.csv", "truth/base_link.tum"),
        *(f"mav0/{name}/data.csv" for name in ("imu0", "odometry0", "lidar0", "cam0")),
        *(f"mav0/lidar0/data/{stamp}.npy", f"mav0/cam0/data/{stamp}.png"),
        *("mav0/state_groundtruth_estimate0/data.csv", "mav0/imu0/sensor.yaml"),
    )
    return Folder(
        path=path,
        known=tuple(f"dataset/{name}" for name in known),
        commands=(
            *(VALIDATE, ("record", "world"), ("record", "world", "--formats", "tum,rosbag2")),
            ("evaluate", "world", "--systems", "imu,wheel-odometry", "--force"),
        ),
    )


def _data_files(path: Path) -> tuple[str, ...]:
    return tuple(
        file.relative_to(path).as_posix()
        for file in sorted(path.rglob("*"))
        if file.suffix in (".json", ".csv", ".npz") and file.is_file()
    )


def folder_of_site(path: Path) -> Folder:
    """A site in tiles."""
    return Folder(
        path=path,
        known=_data_files(path),
        commands=(
            *(VALIDATE, ("cut", "world", "--centre", "1,1", "--size", "4,4", "-o", "cut")),
            ("build", "site.yaml", "-o", "world", "--workers", "0"),
        ),
    )


def folder_of_series(path: Path) -> Folder:
    """Worlds of one recipe."""
    return Folder(
        path=path,
        known=_data_files(path),
        commands=(("worlds", "series.yaml", "-o", "world", "--workers", "0"),),
    )


class Files:
    """Draws good recipes with broken inputs.

    Args:
        rng: where chance comes from.
        folder: where good files are written once.
    """

    def __init__(self, rng: random.Random, folder: Path) -> None:
        self._rng, self._folder = rng, folder
        self._recipes = samples.file_recipes(folder)

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write a recipe and its inputs; the command that reads them."""
        recipe, names, command = self._rng.choice(self._recipes)
        for path in self._folder.iterdir():
            os.link(path, folder / path.name)
        for name in names if self._rng.random() < 0.2 else [self._rng.choice(names)]:
            spoil(self._rng, folder / name, [self._folder / path for path in self._others()])
        samples.write_recipe(recipe, folder)
        if names[0].endswith((".tif", ".img", ".asc", ".LBL")) and self._rng.random() < 0.2:
            return ("check", names[0])
        return command

    def _others(self) -> list[str]:
        return sorted(path.name for path in self._folder.iterdir())


class Worlds:
    """Draws folders of ours with broken files.

    Args:
        rng: where chance comes from.
        folders: good ones; the recipes that commands read lie beside them.
    """

    def __init__(self, rng: random.Random, folders: Sequence[Folder]) -> None:
        self._rng, self._folders = rng, folders

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write a folder; the command that reads it."""
        rng, world = self._rng, folder / "world"
        good = rng.choice(self._folders)
        shutil.copytree(good.path, world)
        for recipe in good.path.parent.glob("*.yaml"):
            shutil.copyfile(recipe, folder / recipe.name)
        files = sorted(path for path in world.rglob("*") if path.is_file())
        names = [str(path.relative_to(world)) for path in files]
        name = rng.choice(good.known if rng.random() < 0.8 else names)
        path = world / name
        if name.endswith(".npz") and rng.random() < 0.6:
            path.write_bytes(_spoilt_archive(rng, path.read_bytes()))
        elif name.endswith(".json") and rng.random() < 0.6:
            data = _spoilt_json(rng, json.loads(path.read_text(encoding="utf-8")))
            path.write_text(json.dumps(data), encoding="utf-8")
        else:
            spoil(rng, path, [world / other for other in names])
        return rng.choice(good.commands)


def spoil(rng: random.Random, path: Path, others: list[Path]) -> None:
    """Break a file, or put another thing in its place."""
    data = path.read_bytes()
    path.unlink()
    match rng.randrange(24):
        case 0:
            os.mkfifo(path)
        case 1:
            path.symlink_to(rng.choice(("/dev/zero", path.name, "/dev/null", "/proc/self/mem")))
        case 2:
            path.mkdir()
        case 3:
            return
        case 4:
            with path.open("wb") as file:
                file.truncate(2**32)  # more than memory allowed, and hashed in time
        case 5:
            path.write_bytes(rng.choice([one for one in others if one != path]).read_bytes())
        case 6:
            path.write_bytes(data + data)
        case _:
            path.write_bytes(_spoilt(rng, data))


def _spoilt(rng: random.Random, data: bytes) -> bytes:
    """Bytes with a few of them changed; text in text's ways."""
    changed = bytearray(data)
    texty = b"\x00" not in data[:512]
    for _ in range(rng.choice((1, 1, 2, 5, 30))):
        near = rng.random() < 0.5  # headers stand at the beginning
        size = len(changed)
        at = rng.randrange(min(size, 400) if near and size else size + 1)
        end = min(at + rng.choice((1, 4, 8, 64)), size)
        match rng.randrange(7):
            case 0:
                changed[at : at + 1] = bytes([rng.randrange(256)])
            case 1:
                del changed[at:]
            case 2:
                del changed[at:end]
            case 3:
                changed[at:at] = changed[at:end] * rng.choice((1, 100))
            case 4:
                changed[at:end] = rng.choice(TEXTS)
            case 5 if texty:
                words = bytes(changed).split(b" ")
                words[rng.randrange(len(words))] = repr(rng.choice((*NUMBERS, 10**30))).encode()
                changed = bytearray(b" ".join(words))
            case _:
                packed = rng.choice(
                    (struct.pack("<I", rng.choice((0, 2**31 - 1, 2**32 - 1))),
                     struct.pack("<d", rng.choice((float("nan"), 1e300, 1e-300, float("inf")))))
                )  # fmt: skip
                changed[at : at + len(packed)] = packed
    return bytes(changed)


def _spoilt_json(rng: random.Random, data: Any) -> Any:
    """Plain data in which one part is another."""
    if isinstance(data, dict) and data and rng.random() < 0.95:
        name = rng.choice([*data])
        if rng.random() < 0.1:
            return {key: value for key, value in data.items() if key != name}
        return {**data, name: _spoilt_json(rng, data[name])}
    if isinstance(data, list) and data and rng.random() < 0.9:
        which = rng.randrange(len(data))
        return [*data[:which], _spoilt_json(rng, data[which]), *data[which + 1 :]]
    return rng.choice(
        (None, True, -1, 0, 10**30, 1e308, "", "x", "\x1b[31m", "../../x", [], {}, [1])
    )


def _spoilt_archive(rng: random.Random, data: bytes) -> bytes:
    """An npz of which one array is another, larger than its bytes, a bomb, or missing."""
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as source:
        victim = rng.choice(source.namelist() or [""])
        with zipfile.ZipFile(target, "w") as archive:
            for name in source.namelist():
                content, method = source.read(name), zipfile.ZIP_STORED
                if name == victim:
                    match rng.randrange(5):
                        case 0:
                            continue
                        case 1:
                            content = _header((10**10, 10)) + content[128:]
                        case 2:
                            content = _header((2**20, 600)) + bytes(3 * 2**20)
                        case 3:
                            content, method = bytes(200 * 2**20), zipfile.ZIP_DEFLATED
                        case 4:
                            content = _spoilt(rng, content)
                archive.writestr(name, content, method)
    return target.getvalue()


def _header(shape: tuple[int, ...]) -> bytes:
    text = str({"descr": "<f8", "fortran_order": False, "shape": shape})
    text = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()
