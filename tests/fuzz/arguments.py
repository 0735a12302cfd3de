"""Command lines of which some arguments are odd."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import click

from terrain_forge.cli import cli
from tests.fuzz import samples
from tests.fuzz.recipes import INTEGERS, NUMBERS, WORDS, put_traps

_COMMANDS = (
    *("check", "preview", "record", "evaluate", "export", "validate", "illumination"),
    *("cut", "view", "init", "sites", "completion"),
)
_LEFT_OUT = {"workers", "scheduler", "exchange", "binary", "install", "out", "runs"}
"""Options that start many processes or programs, reach a network, or say where is written."""
_ALWAYS = {"view": ["--no-browser"], "evaluate": ["--systems", "imu"], "validate": ["--quick"],
           "illumination": ["--azimuths", "8"]}  # fmt: skip
_TEXTS = (
    *(word for word in WORDS if "\x00" not in word),
    *("=", "a=b", "a=", "[=", ",", ",,", "1,2", "1,2,3,4", "0,0,1e9,1e9", "nan,nan", "-1,-1"),
    *("imu", "imu,imu", "camera,lidar", "tum,kitti", "rosbag2", "geotiff", "sdf,glb", "moon"),
    *("2030-09-01", "2030-02-30", "99999-01-01", "0001-01-01T00:00", "1h", "0s", "1e99d", "-1m"),
    *("seed=nan", "name=\u202e", "rocks=[]", "dtm.size_m=[1e9,1e9]", "sensors.0.rate_hz=1e9"),
    *("recipe.yaml", "world", "fifo", "loop", "empty", "missing", "recipe.yaml/x"),
    *("world/dataset/truth/base_link.tum", "world/truth/surface.tif", "x=world/truth/surface.tif"),
    *("bash", "zsh", "all", "align=all", "third_by=index", "stations_m=0", "drift_over_m=-1"),
    *map(str, (*NUMBERS, *INTEGERS)),
)  # fmt: skip


class Arguments:
    """Draws command lines for a recorded world and its recipe.

    Args:
        rng: where chance comes from.
        world: a recorded one.
    """

    def __init__(self, rng: random.Random, world: Path) -> None:
        self._rng, self._world = rng, world

    def write(self, folder: Path) -> tuple[str, ...]:
        """Lay out what commands read; a command."""
        rng = self._rng
        shutil.copytree(self._world, folder / "world")
        samples.write_recipe(samples.of_sensors(), folder)
        put_traps(folder)
        name = rng.choice(_COMMANDS)
        words = [name, *_ALWAYS.get(name, ())]
        options = []
        for one in cli.commands[name].params:
            if isinstance(one, click.Argument):
                good = "world" if one.name == "out" else "recipe.yaml"
                words.append(good if rng.random() < 0.9 else self._value(one))
            elif one.name not in _LEFT_OUT:
                options.append(one)
        for one in rng.sample(options, min(rng.choice((1, 1, 2, 3)), len(options))):
            words.append(max(one.opts, key=len))
            if not one.is_flag:
                words += [self._value(one) for _ in range(one.nargs)]
        return tuple(words)

    def _value(self, one: click.Parameter) -> str:
        if isinstance(one.type, click.Choice) and self._rng.random() < 0.7:
            return str(self._rng.choice(one.type.choices))
        return self._rng.choice(_TEXTS)
