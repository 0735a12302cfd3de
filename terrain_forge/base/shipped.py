"""Kernels that a wheel brings along, compiled already: `python -m terrain_forge.base.shipped`.

That writes them beside this file for the Python and the numba that it runs with, as code for
x86-64-v3, which all processors since 2013 run and which makes the same bytes as code for a newer
one. They hold for just these sources, this Python and this numba; for others kernels compile when
they are first needed.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zipfile import ZIP_LZMA, ZipFile

import llvmlite
import numba
from llvmlite import binding

from terrain_forge.base.listed import kernel, numba_types, place, signatures

settings: Any = numba.config
HERE = Path(__file__).parent
TARGET = "x86-64-v3"
_NEEDED = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
_HOLDS_FOR = "holds_for.json"


def unpack(missing: dict[str, dict[str, list[Any]]]) -> bool:
    """Put those of the kernels that were brought along into the cache, if they hold here.

    Args:
        missing: Signatures of what the cache lacks, by room and name.
    """
    if not _archive().is_file() or not _runs_here():
        return False
    with ZipFile(_archive()) as archive:
        if json.loads(archive.read(_HOLDS_FOR)) != _conditions():
            return False
        brought = set(archive.namelist())
        for name in (name for room in missing.values() for name in room):
            if _entry(name) in brought:
                file, key = place(name, signatures()[name])
                file.save(key, pickle.loads(archive.read(_entry(name))))
    return True


def write() -> Path:
    """Compile all listed kernels for other processors too, and write them beside this file."""
    with tempfile.TemporaryDirectory() as folder:
        own = {"NUMBA_CACHE_DIR": folder, "NUMBA_CPU_NAME": TARGET, "NUMBA_CPU_FEATURES": ""}
        command = [sys.executable, "-m", "terrain_forge.base.shipped", "compile"]
        subprocess.run(command, env=os.environ | own, check=True)
        return _archive()


def _compile() -> None:
    """Compile into the cache that the environment names, and write from there."""
    with ZipFile(_archive(), "w", compression=ZIP_LZMA) as archive:
        archive.writestr(_HOLDS_FOR, json.dumps(_conditions(), indent=1))
        for name, signature in signatures().items():
            kernel(name).compile(numba_types(signature))
            file, key = place(name, signature)
            archive.writestr(_entry(name), pickle.dumps(file.load(key)))


def _archive() -> Path:
    return HERE / f"kernels-{sys.implementation.cache_tag}-{sysconfig.get_platform()}.zip"


def _entry(name: str) -> str:
    return name.replace(":", "/")


def _runs_here() -> bool:
    """Whether this is the processor that numba compiles for, and it has what the code uses."""
    if settings.CPU_NAME not in (None, "", TARGET, binding.get_host_cpu_name()):
        return False
    has = binding.get_host_cpu_features()
    return all(has.get(feature) for feature in _NEEDED)


def _conditions() -> dict[str, str]:
    """What machine code and its wrapping depend on."""
    sources = sha256()
    for path in sorted(_sources()):
        sources.update(path.name.encode() + path.read_bytes())
    return {
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        "python": sys.version.split()[0].rpartition(".")[0],
        "sources": sources.hexdigest(),
    }


def _sources() -> Iterator[Path]:
    """The files of the rooms, and of the packages that a checkout keeps elsewhere."""
    rooms = {name.split(".")[1] for name in signatures()} | {"base", "model"}
    for room in rooms:
        found = find_spec(f"terrain_forge.{room}")
        assert found is not None
        for folder in found.submodule_search_locations or ():
            yield from Path(folder).rglob("*.py")


if __name__ == "__main__":
    if sys.argv[1:2] == ["compile"]:
        _compile()
    else:
        print(write())  # noqa: T201
