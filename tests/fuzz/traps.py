"""Folders of ours that would have a command touch what is not in them, or run what is not ours."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Sequence
from pathlib import Path

from terrain_forge.building.manifest import MARK
from tests.fuzz.files import Folder
from tests.fuzz.kills import digest

_MODULES = "numpy", "random", "sitecustomize", "usercustomize", "json", "hostile"
_PLACES = (
    *("x", ".terrain-forge", ".terrain-forge/lock", ".terrain-forge/next", ".terrain-forge/old"),
    *(".terrain-forge/whole", ".terrain-forge/whole/world", ".terrain-forge/site", "shared"),
    *(".terrain-forge/0", ".terrain-forge/drive", ".begun-00000-1", "00000", "00001", "tiles"),
    *("tiles/000", "dataset", "dataset/.writing", "dataset/written.csv", "dataset/slam"),
    *("dataset/slam/inputs", "dataset/slam/imu_1", "dataset/mav0", "dataset/tum", "truth"),
    *("dataset/.calibration.part", "validation", "validation/consumers", "geotiff", "paths"),
)
"""Where a link or a pipe may do harm, in whichever folder."""
_LISTS = "[", "5", "[1]", "", '["x/.bashrc"]', '["../home/.bashrc"]', "[]", "[]"


class Traps:
    """Draws folders of ours with traps, beside a folder of a user's that must stay as it is.

    Args:
        rng: Where chance comes from.
        folders: Good ones; the recipes that commands read lie beside them.
    """

    def __init__(self, rng: random.Random, folders: Sequence[Folder]) -> None:
        self._rng, self._folders = rng, folders
        self._before = ""

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write a folder with traps; the command that works on it."""
        rng, world, home = self._rng, folder / "world", folder / "home"
        good = rng.choice(self._folders)
        shutil.copytree(good.path, world, symlinks=True)
        for recipe in good.path.parent.glob("*.yaml"):
            shutil.copyfile(recipe, folder / recipe.name)
        names = [path.relative_to(world).as_posix() for path in sorted(world.rglob("*"))]
        _furnish(home, [name for name in names if (world / name).is_file()])
        kinds = self._link, self._link, self._pipe, self._listed, self._left, self._modules
        for kind in rng.sample(kinds, rng.choice((1, 2, 3))):
            kind(world, home, names)
        self._before = digest(home)
        commands = {*good.commands, *_more(world)}
        return rng.choice(sorted(commands))

    def sprung(self, folder: Path) -> list[str]:
        """Whether a command touched the user's folder, or ran a program that lay there."""
        ran = [path.name for path in folder.glob("ran-*")]
        touched = [] if digest(folder / "home") == self._before else ["touched the user's folder"]
        return [*touched, *(f"executed: {name}" for name in sorted(ran))]

    def _place(self, world: Path, names: list[str]) -> str:
        """A name in the folder, whose place is free now."""
        if self._rng.random() < 0.3:
            self._left(world, world.with_name("home"), names)
        likely = names if self._rng.random() < 0.3 else _PLACES
        name = self._rng.choice([name for name in likely if _is_plain(world, name)])
        place = world / name
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place)
        place.unlink(missing_ok=True)
        return name

    def _link(self, world: Path, home: Path, names: list[str]) -> None:
        name = self._place(world, names)
        ends = home / name, home, home / ".bashrc", home / "new", home / "Documents"
        target = os.path.relpath(self._rng.choice(ends), (world / name).parent)
        (world / name).symlink_to(target)

    def _pipe(self, world: Path, home: Path, names: list[str]) -> None:
        os.mkfifo(world / self._place(world, names))

    def _listed(self, world: Path, home: Path, names: list[str]) -> None:
        """Names in a list that lead elsewhere, or to the folder itself."""
        lists = [name for name in names if name.endswith(("written.csv", "manifest.json"))]
        lists += [name for name in names if name.endswith("tile.json")]
        lists = [name for name in lists if (world / name).is_file() and _is_plain(world, name)]
        if not lists or (path := world / self._rng.choice(lists)).is_symlink():
            return
        if not os.path.lexists(path.parent / "x"):
            (path.parent / "x").symlink_to(os.path.relpath(home, path.parent))
        odd = ("./", ".", "", "/", "x/Documents/", "x/.bashrc", "x/new/file", f"{home}/",
               f"{home}/.bashrc", "x/../x/.bashrc", "../home/Documents/", "x")  # fmt: skip
        named = self._rng.sample(odd, 3)
        if path.suffix == ".csv":
            with path.open("a", encoding="utf-8") as file:
                file.writelines(f"{self._rng.choice((0, 0, 1, 5))},{name}\n" for name in named)
            return
        plain = json.loads(path.read_text(encoding="utf-8"))
        for key in ("outputs", "files"):
            if isinstance(plain.get(key), dict):
                plain[key] |= dict.fromkeys(named, "0" * 64)
        path.write_text(json.dumps(plain), encoding="utf-8")

    def _left(self, world: Path, home: Path, names: list[str]) -> None:
        """What a killed process leaves, but with a file beside a link and an odd list."""
        staging = world / ".terrain-forge"
        if os.path.lexists(staging):
            return
        whole = staging / "whole" / world.name
        (whole / "x").mkdir(parents=True)
        (whole / "x" / ".bashrc").write_text("hostile")
        (staging / "lock").write_bytes(MARK)
        (whole.parent / "gone.json").write_text(self._rng.choice(_LISTS))
        if (world / "manifest.json").is_file():
            shutil.copyfile(world / "manifest.json", whole / "manifest.json")
        if not os.path.lexists(world / "x"):
            (world / "x").symlink_to("../home")

    def _modules(self, world: Path, home: Path, names: list[str]) -> None:
        """Programs in the current folder that tell when they are run."""
        for name in _MODULES:
            ran = world.with_name(f"ran-{name}")
            text = f"open({str(ran)!r}, 'w').close()\nraise ImportError({name!r})\n"
            world.with_name(f"{name}.py").write_text(text)
        world.with_name("matplotlibrc").write_text("backend: module://hostile\n")


def _furnish(home: Path, names: Sequence[str]) -> None:
    """A user's folder in which any name of ours is taken."""
    for name in (*names, ".bashrc", "Documents/thesis", "gone.json", "dataset/slam/imu.tum"):
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).write_text("mine")


def _is_plain(world: Path, name: str) -> bool:
    """Whether what a place lies in is there, with no link on the way."""
    folders = [world / above for above in Path(name).parents]
    return all(folder.is_dir() and not folder.is_symlink() for folder in folders)


def _more(world: Path) -> list[tuple[str, ...]]:
    """What else works on a folder."""
    if (world / "worlds.json").exists():
        return [("worlds", "series.yaml", "-o", "world", "--workers", "2")]
    if (world / "site").exists():
        return [("build", "site.yaml", "-o", "world", "--workers", "2")]
    record = "record", "world", "--force"
    evaluate = "evaluate", "world", "--systems", "imu,wheel-odometry", "--force"
    recorded = [record, evaluate] if (world / "dataset").exists() else []
    return [("build", "recipe.yaml", "-o", "world", "--force"), *recorded]
