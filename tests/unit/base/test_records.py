"""What holds for the whole package: documented types, lazy imports, contents of the wheel."""

from __future__ import annotations

import ast
import pkgutil
import shutil
import subprocess
import sys
from dataclasses import fields
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import terrain_forge
from terrain_forge.base import DataError, Spec, records
from terrain_forge.model import Heightfield
from tests.helpers.places import ROOT, parsed


def all_modules():
    names = [m.name for m in pkgutil.walk_packages(terrain_forge.__path__, "terrain_forge.")]
    apart = (".dtm_samples", ".recipes", "probe", ".drivers")  # those that others run
    return [n for n in names if not any(part in n for part in apart)]


def documented_fields(cls):
    """Names of a class's fields that have a string below them."""
    path = Path(sys.modules[cls.__module__].__file__)
    written = (
        node.body
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ClassDef) and node.name == cls.__name__
    )
    body = next(written, None)
    if body is None:  # made of a built-in rover's file
        return {name for name, a in cls.__annotations__.items() if a.__metadata__[-1].description}
    return {
        one.target.id
        for one, two in pairwise(body)
        if isinstance(one, ast.AnnAssign)
        and isinstance(two, ast.Expr)
        and isinstance(two.value, ast.Constant)
    }


def test_every_field_of_every_type_is_documented():
    for name in all_modules():
        import_module(name)
    types = [*records.TYPES.values(), *walk(Spec)]
    ours = [cls for cls in types if cls.__module__.startswith("terrain_forge")]
    assert len(ours) > 30
    for cls in ours:
        own = {f.name for f in fields(cls) if f.name in cls.__annotations__} - {"kind"}
        missing = own - documented_fields(cls)
        assert not missing, f"{cls.__module__}.{cls.__name__}: {missing}"
        parameters = cls.__dataclass_params__
        assert parameters.frozen


def walk(cls):
    for sub in cls.__subclasses__():
        yield sub
        yield from walk(sub)


def test_importing_pulls_in_no_simulator():
    """Nor what draws, until it is needed: what is loaded after each of some imports."""
    heavy = {"mujoco", "pxr", "matplotlib", "trimesh", "coacd", "embreex", "numba", "scipy"}
    imports = ["terrain_forge, terrain_forge.cli", "terrain_forge.pipeline",
               "terrain_forge.exporters.mjcf, terrain_forge.scene.preview"]  # fmt: skip
    script = "import sys\n" + "".join(f"import {names}\nprint(*sys.modules)\n" for names in imports)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    bare, core, more = (set(line.split()) for line in done.stdout.splitlines())
    assert not heavy & bare
    assert not {"mujoco", "pxr", "matplotlib", "trimesh", "coacd"} & core
    assert not {name for name in core if name.startswith("terrain_forge.exporters.")}
    assert not {"mujoco", "matplotlib"} & more


def test_public_names():
    for name in terrain_forge.__all__:
        assert getattr(terrain_forge, name) is not None
    with pytest.raises(AttributeError, match="nothing"):
        _ = terrain_forge.nothing


@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_a_record_takes_no_masked_values(dtype):
    z = np.ma.masked_equal(np.arange(4, dtype=dtype).reshape(2, 2), 7)
    ground = terrain_forge.Heightfield(elevation=z, spacing=1.0, origin=(0.0, 0.0))
    assert type(ground.elevation) is np.ndarray
    z[0, 1] = np.ma.masked
    with pytest.raises(ValueError, match=r"^Heightfield\.elevation: holds values that are masked$"):
        ground.replace(elevation=z)


def test_arrays_of_records_stay_read_only(small_world):
    with pytest.raises(ValueError, match="cannot set WRITEABLE flag"):
        small_world.ground.elevation.setflags(write=True)


@pytest.mark.slow
def test_wheel_holds_the_tree(tmp_path):
    import zipfile

    tree = tmp_path / "tree"  # setuptools leaves a folder `build` behind
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".*", "__pycache__", "build"))
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "-o", tmp_path, tree],
        check=True,
        capture_output=True,
    )
    names = set(zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist())
    homes = {"terrain_forge": "terrain_forge", "exporters": "terrain_forge/exporters"}
    homes |= {f: f"terrain_forge/{f}" for f in ("recipes", "dtm_samples")}
    for folder, home in homes.items():
        for path in (ROOT / folder).rglob("*"):
            kinds = (".py", ".yaml", ".xacro", ".xml", ".tif", ".css", ".js", ".three")
            wanted = path.suffix in kinds and "__pycache__" not in path.parts
            if wanted and path.name != "make_samples.py":
                assert f"{home}/{path.relative_to(ROOT / folder).as_posix()}" in names


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"spacing": -1.0}, "Heightfield: spacing must be a number above 0, found -1.0"),
        ({"spacing": "x"}, "Heightfield: spacing must be a number above 0, found 'x'"),
        ({"origin": 5}, "Heightfield: origin must be 2 values, each a number, found 5"),
        ({"elevation": np.zeros(3)}, "Heightfield.elevation: shape (3,), expected"),
        ({"elevation": "x"}, "Heightfield.elevation: must be numbers, in rows of one length"),
    ],
)
def test_a_record_made_wrongly_is_told_in_a_line(fields, words):
    right = {"elevation": np.zeros((2, 2)), "spacing": 1.0, "origin": (0.0, 0.0)}
    with pytest.raises(DataError) as error:
        Heightfield(**(right | fields))
    assert str(error.value).startswith(words)
    with pytest.raises(DataError):
        Heightfield(**right).replace(**fields)


def test_a_record_copies_no_array_that_another_has():
    elevation = np.zeros((3, 4), np.float32)
    ground = Heightfield(origin=(0.0, 0.0), spacing=1.0, elevation=elevation)
    elevation[1, 1] = 7.0
    assert ground.elevation[1, 1] == 0.0
    moved = ground.replace(origin=(1.0, 0.0))
    assert np.shares_memory(moved.elevation, ground.elevation)
    with pytest.raises(ValueError, match="read-only"):
        moved.elevation[0, 0] = 1.0
    with pytest.raises(DataError, match="shape"):
        ground.replace(elevation=ground.elevation[0])
    view = elevation.view()
    view.setflags(write=False)  # the base can still be written
    assert not np.shares_memory(ground.replace(elevation=view).elevation, elevation)
