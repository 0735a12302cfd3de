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
from zipfile import ZIP_LZMA, BadZipFile, ZipFile

import llvmlite
import numba
from llvmlite import binding

from terrain_forge.base.interpreter import python_words
from terrain_forge.base.listed import kernel, numba_types, place, signatures

settings: Any = numba.config
HERE = Path(__file__).parent
_HOME = "terrain_forge.base.shipped"
TARGET = "x86-64-v3"
_NEEDED = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
_HOLDS_FOR = "holds_for.json"


def unpack() -> bool:
    """Put the kernels that were brought along into the cache, if they hold here."""
    if not _runs_here() or not _holds():
        return False
    with ZipFile(_archive()) as archive:
        for entry in archive.namelist():
            if entry != _HOLDS_FOR:
                name, signature, code = pickle.loads(archive.read(entry))
                file, key = place(name, signature)
                if key not in file._load_index():
                    file.save(key, code)
    return True


def write() -> Path:
    """Compile all listed kernels for other processors too, and write them beside this file.

    Those that are there and hold stay.
    """
    if _holds():
        return _archive()
    with tempfile.TemporaryDirectory() as folder:
        own = {"NUMBA_CACHE_DIR": folder, "NUMBA_CPU_NAME": TARGET, "NUMBA_CPU_FEATURES": ""}
        command = python_words(f"from {_HOME} import compile_all; compile_all()")
        subprocess.run(command, env=os.environ | own, check=True)
        return _archive()


def compile_all() -> None:
    """Compile into the cache that the environment names, and write from there."""
    for name, signature in signatures().items():
        kernel(name).compile(numba_types(signature))
    with ZipFile(_archive(), "w", compression=ZIP_LZMA) as archive:
        archive.writestr(_HOLDS_FOR, json.dumps(_conditions(), indent=1))
        for name, compiled in _compiled():
            for number, signature in enumerate(compiled.signatures):
                file, key = place(name, signature)
                entry = pickle.dumps((name, signature, file.load(key)))
                archive.writestr(f"{name.replace(':', '/')}/{number}", entry)


def _compiled() -> Iterator[tuple[str, Any]]:
    """All kernels that are compiled, those too that others call."""
    for home, module in sorted(sys.modules.items()):
        if home.startswith("terrain_forge."):
            for name, found in vars(module).items():
                own = getattr(getattr(found, "py_func", None), "__module__", "") == home
                if own and found.targetoptions.get("nogil") and found.signatures:
                    yield f"{home}:{name}", found


def _archive() -> Path:
    return HERE / f"kernels-{sys.implementation.cache_tag}-{sysconfig.get_platform()}.zip"


def _holds() -> bool:
    """Whether kernels were brought along, and for what this runs with."""
    try:
        with ZipFile(_archive()) as archive:
            return bool(json.loads(archive.read(_HOLDS_FOR)) == _conditions())
    except (OSError, BadZipFile, LookupError, ValueError):
        return False


def _runs_here() -> bool:
    """Whether this is the processor that numba compiles for, and it has what the code uses."""
    if settings.CPU_NAME not in (None, "", TARGET, binding.get_host_cpu_name()):
        return False
    has = binding.get_host_cpu_features()
    return all(has.get(feature) for feature in _NEEDED)


def _conditions() -> dict[str, str]:
    """What machine code and its wrapping depend on."""
    sources = sha256(json.dumps(signatures(), sort_keys=True).encode())
    for room in sorted({name.split(".")[1] for name in signatures()} | {"base", "model"}):
        found = find_spec(f"terrain_forge.{room}")  # a checkout keeps some elsewhere
        assert found is not None
        for folder in map(Path, found.submodule_search_locations or ()):
            for path in sorted(folder.rglob("*.py")):
                sources.update(f"{room}/{path.relative_to(folder).as_posix()}".encode())
                sources.update(path.read_bytes())
    return {
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        "python": sys.version.split()[0].rpartition(".")[0],
        "sources": sources.hexdigest(),
    }


if __name__ == "__main__":
    print(write())  # noqa: T201
