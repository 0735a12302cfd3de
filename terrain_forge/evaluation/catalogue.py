"""The systems that are known by name, and environments in which those that pip brings run."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import venv
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from terrain_forge.base import (
    DataError,
    OutputError,
    RecipeError,
    cache_folder,
    complaint,
    hint_at,
    load_plugin,
    plugins,
    read_text,
    reading,
    skip_plugin,
)
from terrain_forge.evaluation.adapter import Adapter
from terrain_forge.evaluation.vocabulary import make_vocabulary, vocabulary_file

GROUP = "terrain_forge.systems"
"""Entry points that name packages with folders of system files, as ours has."""
_OURS = Path(__file__).parent / "systems"
DRIVERS = Path(__file__).parent / "drivers"
_MOST = 2**16
_DONE = "installed.json"
_REMEDIES = {"cv2": "pip install 'terrain-forge[slam]'"}
"""How modules that our own systems need are installed."""


@cache
def known_systems() -> dict[str, Adapter]:
    """All systems that are known by name: ours, and those of installed packages.

    A file of theirs that cannot be used is skipped with a warning.
    """
    found = {file.stem: read_system(file) for file in _OURS.glob("*.yaml")}
    for point in plugins(GROUP).values():
        if module := load_plugin(point, GROUP):
            _add_systems(found, point, module)
    return dict(sorted(found.items()))


def _add_systems(found: dict[str, Adapter], point: EntryPoint, module: ModuleType) -> None:
    """Add the systems of another package's folder, but for files that cannot be used."""
    folders = map(Path, getattr(module, "__path__", ()))
    files = [file for folder in folders for file in sorted(folder.glob("*.yaml"))]
    if not files:
        skip_plugin(point, GROUP, "has no .yaml file of a system")
    for file in files:
        if file.stem in found:
            skip_plugin(point, GROUP, f"{file}: there is a system of that name")
            continue
        try:
            found[file.stem] = read_system(file)
        except DataError as error:
            skip_plugin(point, GROUP, str(error))


def find_system(name: str) -> Adapter:
    """The system of a name, or of a file.

    Raises:
        DataError: if there is none; lists what is known.
    """
    if name.endswith((".yaml", ".yml")):
        return read_system(Path(name))
    if name not in known_systems():
        known = ", ".join(known_systems())
        raise DataError(f"unknown system {name!r}{hint_at(name, known_systems())}, known: {known}")
    return known_systems()[name]


def with_binaries(adapters: Sequence[Adapter], told: Sequence[str]) -> list[Adapter]:
    """The systems, with the programs of the user that `NAME=PATH` tells; what is new comes last.

    Raises:
        DataError: for what is no such pair, or a system that runs no program of a user; for two
            systems of one name.
    """
    require_distinct(adapters)
    found = {one.name: one for one in adapters}
    for pair in told:
        name, equals, path = pair.partition("=")
        if not equals or not path:
            raise DataError(f"--binary {pair!r}: NAME=PATH, such as orb-slam2=/opt/stereo_kitti")
        adapter = found.get(name) or find_system(name)
        if "{binary}" not in adapter.command:
            raise DataError(f"--binary {name}: that system runs no program of yours")
        place = Path(path).expanduser()
        binary = str(place.absolute()) if place.exists() else path
        found[adapter.name] = replace(adapter, binary=binary)
    return list(found.values())


def require_program(adapter: Adapter) -> None:
    """Refuse a user's program that is not there.

    Raises:
        DataError: says which; also where none was named.
    """
    name, place = adapter.name, Path(adapter.binary).expanduser()
    if adapter.needs_binary:
        raise DataError(f"{name} is a program of yours: --binary {name}=PATH")
    if len(place.parts) > 1 and not place.exists():
        raise DataError(f"{name}: no such program: {adapter.binary}")


def require_distinct(adapters: Sequence[Adapter]) -> None:
    """Refuse systems of one name, whose results would overwrite each other.

    Raises:
        DataError: says which.
    """
    names = [one.name for one in adapters]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise DataError(
            f"system {twice!r} is there twice: name it once, or give one of two files a `name`"
        )


def read_system(path: Path) -> Adapter:
    """The adapter that a YAML file describes; its name is the file's unless it gives one.

    Raises:
        DataError: naming the file and what is wrong.
    """
    from pydantic import TypeAdapter, ValidationError
    from ruamel.yaml import YAML

    text = read_text(path, str(path), most=_MOST)
    with reading(str(path)):
        plain: Any = YAML(typ="safe", pure=True).load(text)
    if not isinstance(plain, dict):
        raise DataError(f"{path}: a system is a mapping of keys")
    adapter, told = TypeAdapter(Adapter), {"name": path.stem, **plain}
    with reading(str(path)):
        written = json.dumps(told, default=str)
    try:
        found: Adapter = adapter.validate_json(written, strict=True)
        found.require_sound()
    except (DataError, RecipeError) as error:
        raise DataError(f"{path}: {error}") from None
    except ValidationError as error:
        raise DataError(f"{path}: {complaint(error, adapter, told)}") from None
    return found


def environment(adapter: Adapter) -> Path:
    """The folder of a system's own Python environment.

    Raises:
        OutputError: if there is no cache folder to keep it in.
    """
    folder = cache_folder()
    if folder is None:
        raise OutputError("TERRAIN_FORGE_CACHE is off: environments of systems need a folder")
    return folder / "systems" / (adapter.environment_of or adapter.name)


def interpreter(adapter: Adapter) -> Path:
    """The Python that runs a system: of its own environment, or this one where it needs none.

    Raises:
        DataError: if the environment was not made yet, or a module is missing; says how.
    """
    if not adapter.packages:
        for module in adapter.modules:
            if find_spec(module.partition(".")[0]) is None:
                remedy = _REMEDIES.get(module, f"install it for {sys.executable}")
                raise DataError(f"{adapter.name} needs the module {module}: {remedy}")
        return Path(sys.executable)
    folder = environment(adapter)
    if not (folder / _DONE).is_file():
        raise DataError(
            f"{adapter.name} is not installed: terrain-forge evaluate --install {adapter.name}"
        )
    return _python(folder)


def require_ready(adapter: Adapter) -> None:
    """Refuse a system whose environment or vocabulary was not made yet.

    Raises:
        DataError: says how it is made.
    """
    interpreter(adapter)
    if adapter.needs_vocabulary:
        vocabulary_of(adapter)


def vocabulary_of(adapter: Adapter) -> Path:
    """The vocabulary for a system: ORB-SLAM's own where its program lies in its source, or ours.

    Raises:
        DataError: if there is none yet; says how it is made.
    """
    if adapter.binary:
        for folder in Path(adapter.binary).resolve().parents:
            if (own := folder / "Vocabulary" / "ORBvoc.txt").is_file():
                return own
    path = vocabulary_file()
    if not path.is_file():
        raise DataError(
            f"{adapter.name} needs a vocabulary: terrain-forge evaluate --install {adapter.name}"
        )
    return path


def install_system(adapter: Adapter) -> Path:
    """Make what a system needs anew: its environment, by pip, and a vocabulary of ORB features.

    Returns:
        The folder of the environment, or else the vocabulary.

    Raises:
        DataError: if it needs nothing, what stands in the environment's place is none that this
            made, or pip cannot install it; tells pip's last line.
    """
    if not adapter.packages and not adapter.needs_vocabulary:
        require_ready(adapter)
        raise DataError(f"{adapter.name} needs no packages: {adapter.about or 'nothing to do'}")
    if adapter.needs_vocabulary:
        vocabulary = make_vocabulary()
        if not adapter.packages:
            return vocabulary
    folder = environment(adapter)
    if folder.is_symlink() or (folder.exists() and not (folder / _DONE).is_file()):
        raise DataError(f"{folder} is no environment that was made here: move it away")
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        _fill(folder, adapter)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def _fill(folder: Path, adapter: Adapter) -> None:
    """Make an environment where there is none yet."""
    venv.create(folder, with_pip=True)
    first, *rest = adapter.packages
    orders = [["--no-deps", first], rest] if adapter.loose else [list(adapter.packages)]
    for order in filter(None, orders):
        command = [str(_python(folder)), "-P", "-m", "pip", "install", "-q", *order]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            why = (done.stderr.strip().splitlines() or ["no reason told"])[-1]
            raise DataError(f"{adapter.name}: pip cannot install {' '.join(order)}: {why}")
    (folder / _DONE).write_text(json.dumps({"packages": adapter.packages}), encoding="utf-8")


def _python(folder: Path) -> Path:
    return folder / ("Scripts" if sys.platform == "win32" else "bin") / "python"
