"""Gazebo's own libraries, run by the small programs of tests/consumers."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.places import PROGRAMS

PLUGIN = Path("/usr/lib/x86_64-linux-gnu/libignition-physics5-dartsim-plugin.so")

Build = Callable[..., Path]


def compile_program(folder: Path, name: str, *packages: str) -> Path:
    """One of the small programs, compiled with the libraries of pkg-config; or skips the test."""
    if not shutil.which("g++") or not shutil.which("pkg-config"):
        pytest.skip("g++ or pkg-config is not installed")
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", *packages], capture_output=True, text=True
    )
    if flags.returncode:
        pytest.skip(f"not installed: {flags.stderr.splitlines()[0]}")
    program = folder / name
    if not program.exists():
        source = PROGRAMS / f"{name}.cc"
        command = ["g++", "-std=c++17", "-O1", str(source), *flags.stdout.split()]
        subprocess.run([*command, "-o", str(program)], check=True, capture_output=True)
    return program


def rested(build: Build, directory: Path, world: Path, seconds: float) -> dict[str, np.ndarray]:
    """Place and quaternion (w, x, y, z) of each model after some time in Gazebo's physics."""
    if not PLUGIN.exists():
        pytest.skip("the DART plugin of ign-physics5 is not installed")
    program = build(
        "gazebo_rest",
        *("ignition-physics5", "ignition-physics5-sdf", "ignition-physics5-mesh", "sdformat12"),
        "ignition-physics5-heightmap",
        *("ignition-common4-graphics", "ignition-plugin1-loader", "eigen3"),
        "ignition-math6-eigen3",
    )
    command = [program, PLUGIN, world, directory / "models", str(seconds)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    lines = [line.split() for line in run.stdout.splitlines() if "Dbg" not in line]
    return {name: np.array(values, float) for name, *values in lines}
