"""The house: rooms in their order, doors, no circles, a fast `import terrain_forge`."""

from __future__ import annotations

import ast
import importlib
import json
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

import terrain_forge as tf
from tests.helpers.places import ROOT, parsed

ORDER = [
    {"base"},
    {"model"},
    {"dtm", "rovers", "writers", "sky"},
    {"terrain", "scene"},
    {"rocks", "geometry"},
    {"paths"},
    {"recipe", "truth"},
    {"making"},
    {"driving", "sensors"},
    {"validation", "datasets"},
    {"building", "exporters"},
    {"recording", "evaluation", "tiling", "variation", "illumination"},
    {"learning"},
    {"report", "terminal"},
    {"pipeline"},
    {"studies"},
    {"commands"},
    {"cli", "__init__"},
    {"__main__"},
]
"""A room imports only from rooms above it in this list."""

EXCEPTIONS = {("terrain_forge.model.site", "recipe")}
"""A site reads its recipe from the text that it carries."""

VERSION = ("terrain_forge", "__version__")
"""What everyone may import from the top."""

TOP = {"__init__.py", "__init__.pyi", "__main__.py", "cli.py", "pipeline.py", "py.typed"}
HEAVY = {
    *("numpy", "scipy", "numba", "pydantic", "rasterio", "trimesh", "PIL", "ruamel", "click"),
    *("mujoco", "pxr", "matplotlib", "coacd", "manifold3d", "embreex"),
}
PACKAGE = ROOT / "terrain_forge"
DOORS = sorted(path.parent for path in PACKAGE.glob("*/__init__.py"))
DONE_AT_DOORS = {"learning": ("__getattr__('register_environments')()",)}
"""Gymnasium finds environments where importing a package makes them known."""
DRIVERS = "terrain_forge.evaluation.drivers."
PROBES = ("terrain_forge.validation.newton_probe", "terrain_forge.exporters.drake.probe")
"""Programs that other interpreters run."""


def name_of(path: Path) -> str:
    """The module that a file is."""
    folder = PACKAGE.parent if path.is_relative_to(PACKAGE) else ROOT
    parts = path.relative_to(folder).with_suffix("").parts
    if folder == ROOT and parts[0] == "exporters":
        parts = ("terrain_forge", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def files() -> dict[str, Path]:
    """All modules of the package and of our exporters."""
    found = [*PACKAGE.rglob("*.py"), *(ROOT / "exporters").rglob("*.py")]
    named = {name_of(path): path for path in found if "__pycache__" not in path.parts}
    return {n: p for n, p in named.items() if n not in PROBES and DRIVERS not in n}


def room_of(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


@cache
def names_of_door(package: str) -> dict[str, str]:
    """Where each public name of a package comes from, by its stub."""
    stub = files()[package].with_suffix(".pyi")
    if not stub.exists():
        return {}
    found = {}
    for node in parsed(stub).body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                home = f"{package}.{node.module}" if node.module else package
                found[alias.asname or alias.name] = home
    return found


def loaded(tree: ast.AST) -> Iterator[ast.AST]:
    """All statements but those of `if TYPE_CHECKING:`."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            continue
        yield node
        for block in ("body", "handlers", "cases", "orelse", "finalbody"):
            waiting.extend(getattr(node, block, ()))


def imported(path: Path, package: str) -> Iterator[tuple[str, str]]:
    """(module, name) of each import of ours that a file does; the name is empty for `import a`."""
    for node in loaded(parsed(path)):
        if isinstance(node, ast.Import):
            yield from ((a.name, "") for a in node.names if a.name.startswith("terrain_forge"))
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            if node.level:
                up = package.split(".")[: len(package.split(".")) - node.level + 1]
                module = ".".join([*up, module] if module else up)
            if module.split(".")[0] == "terrain_forge":
                yield from ((module, alias.name) for alias in node.names)


def resolved(module: str, name: str) -> str:
    """The file that an import reads: through a door, the one that the door names."""
    if f"{module}.{name}" in files():
        return f"{module}.{name}"
    source = names_of_door(module).get(name) if module in files() else None
    return resolved(source, name) if source else module


@cache
def arrows() -> list[tuple[str, str, str, str]]:
    """(importing file, module as written, name, file that it reads) of all imports."""
    found = []
    for importer, path in files().items():
        package = importer if path.name == "__init__.py" else importer.rpartition(".")[0]
        for module, name in imported(path, package):
            found.append((importer, module, name, resolved(module, name)))
    return found


def test_four_files_at_the_top():
    assert {path.name for path in PACKAGE.iterdir() if path.is_file()} == TOP


def test_each_room_has_its_place():
    placed = set().union(*ORDER)
    assert {door.name for door in DOORS} <= placed
    assert {room_of(module) for module in files()} <= placed


def test_rooms_import_only_from_rooms_before_them():
    level = {room: n for n, rooms in enumerate(ORDER) for room in rooms}
    wrong = []
    for importer, module, name, source in arrows():
        here, there = room_of(importer), room_of(source)
        if here == there or (importer, there) in EXCEPTIONS or (module, name) == VERSION:
            continue
        if level[there] >= level[here]:
            wrong.append(f"{importer}: from {module} import {name}")
    assert wrong == []


def test_outsiders_come_through_the_door():
    """Exporters are one room, in which each has a door of its own for the other rooms."""
    wrong = []
    for importer, module, name, _ in arrows():
        room = room_of(module)
        door = module.count(".") < (3 if room == "exporters" else 2)
        offered = name in names_of_door(module) or module.count(".") != 1
        loose = room in ("pipeline", "cli", "exporters") or (module, name) == VERSION
        if room_of(importer) != room and not (door and (offered or loose)):
            wrong.append(f"{importer}: from {module} import {name}")
    assert wrong == []


def test_no_circle_of_files():
    graph: dict[str, set[str]] = {module: set() for module in files()}
    for importer, _, _, source in arrows():
        door = "__init__.py" in (files()[importer].name, files().get(source, Path()).name)
        if importer != source and not door:
            graph[importer].add(source)
    for importer, room in EXCEPTIONS:
        graph[importer] = {source for source in graph[importer] if room_of(source) != room}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


@pytest.mark.parametrize("door", DOORS, ids=lambda p: p.name)
def test_a_door_says_what_its_room_is_for_and_opens_nothing_else(door):
    tree = parsed(door / "__init__.py")
    told = ast.get_docstring(tree)
    assert told
    assert len(told.splitlines()) == 1
    assert told.endswith(".")
    text = [ast.unparse(node) for node in tree.body[1:]]
    assert text == [
        "from lazy_loader import attach_stub",
        "__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)",
        *DONE_AT_DOORS.get(door.name, ()),
    ]


@pytest.mark.parametrize("package", ["terrain_forge", *(f"terrain_forge.{d.name}" for d in DOORS)])
def test_each_name_of_a_door_is_there(package):
    room = importlib.import_module(package)
    names = set(names_of_door(package))
    assert names == set(room.__all__)
    assert names <= set(dir(room))
    assert {name for name in names if name.startswith("_")} == set()
    for name in names:
        getattr(room, name)


def test_nothing_public_of_the_package_is_named_as_a_file():
    """`from terrain_forge.rocks import scatter` must not depend on what was imported before."""
    for door in DOORS:
        there = {path.stem for path in door.glob("*.py")} | {p.name for p in door.iterdir()}
        package = f"terrain_forge.{door.name}"
        clashes = {n for n, s in names_of_door(package).items() if n in there and s.count(".") == 2}
        assert clashes == set(), package


def test_import_is_light():
    """Only our own code and what loads its names on demand: what a first name needs comes then."""
    script = (
        "import sys, json; before = set(sys.modules); import terrain_forge as tf; dir(tf);"
        "print(json.dumps(sorted(set(sys.modules) - before)))"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    modules = json.loads(done.stdout)
    assert {name for name in modules if name.startswith("terrain_forge")} == {"terrain_forge"}
    assert {name.split(".")[0] for name in modules}.isdisjoint(HEAVY)


def test_everything_is_offered_from_one_place():
    assert dir(tf) == sorted(dir(tf))
    assert {"load_recipe", "plan", "realise", "build", "World", "Recipe"} <= set(dir(tf))


def specs(hint):
    """The types of what a recipe may hold, but for those that are made of a rover's description."""
    for part in get_args(hint):
        yield from specs(part)
    if isinstance(hint, type) and is_dataclass(hint):
        if hint.__name__ in vars(sys.modules[hint.__module__]):
            yield hint
        hints = get_type_hints(hint, include_extras=True)
        for one in fields(hint):
            yield from specs(hints[one.name])


def test_all_that_a_recipe_holds_can_be_made_in_python():
    found = {one.__name__ for one in specs(tf.Recipe)}
    assert len(found) > 80
    assert found - set(dir(tf)) == set()


def test_threads_begin_in_one_place():
    """Elsewhere an interrupt could meet the main thread where others then wait for it for ever."""
    words = ("ThreadPoolExecutor(", "Thread(")
    files = [*PACKAGE.rglob("*.py"), *(ROOT / "exporters").rglob("*.py")]
    found = [path for path in files if any(word in path.read_text() for word in words)]
    assert found == [PACKAGE / "base" / "threads.py"]


def test_every_package_comes_with_the_wheel():
    """Setuptools takes the list as it is; what it lacks, only an installed wheel would miss."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    homes = {"terrain_forge": PACKAGE, "terrain_forge.exporters": ROOT / "exporters"}
    found = {
        ".".join([name, *path.parent.relative_to(home).parts])
        for name, home in homes.items()
        for path in home.rglob("__init__.py")
    }
    data = {"terrain_forge.dtm_samples", "terrain_forge.recipes", "terrain_forge.recipes.studies"}
    assert set(listed) == found | data


def test_every_room_of_the_package_has_a_title_on_the_site():
    """The site's own packages are not here, so its hooks are read, not run."""
    tree = ast.parse((ROOT / "docs" / "site_hooks.py").read_text())
    (titles,) = [
        ast.literal_eval(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "ROOMS"
    ]
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text())
    rooms = {node.module for node in stub.body if isinstance(node, ast.ImportFrom)}
    assert rooms <= titles.keys()


def test_what_holds_arrays_is_compared_by_identity():
    """NumPy's arrays have no single answer to `==`, and no hash."""
    found = []
    for module, path in files().items():
        for node in ast.walk(parsed(path)):
            if not isinstance(node, ast.ClassDef):
                continue
            decorators = [ast.unparse(one) for one in node.decorator_list]
            fields = [one.annotation for one in node.body if isinstance(one, ast.AnnAssign)]
            names = {getattr(part, "id", "") for one in fields for part in ast.walk(one)}
            if names & {"Array", "NDArray"} and any(
                "dataclass" in one and "eq=False" not in one for one in decorators
            ):
                found.append(f"{module}.{node.name}")
    assert not found
