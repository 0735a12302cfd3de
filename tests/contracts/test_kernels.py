"""The list of kernels that a first build compiles ahead is that of the code."""

import os
import platform
import subprocess
import sys
from importlib import import_module
from inspect import signature

import pytest
from numba.types import NamedTuple

from terrain_forge.base.listed import is_kept, kernel, numba_types, plain_types, signatures
from tests.helpers.places import ROOT

KERNELS = signatures()


@pytest.mark.parametrize("name", KERNELS)
def test_a_listed_kernel_takes_what_the_list_says(name):
    types = numba_types(KERNELS[name])
    for members in (one for one in types if isinstance(one, NamedTuple)):
        assert len(members.types) == len(members.fields), members.instance_class
    assert plain_types(types) == KERNELS[name]
    for record in (found for found in types if hasattr(found, "instance_class")):
        assert len(record) == len(record.instance_class._fields)
    assert len(types) == len(signature(kernel(name).py_func).parameters)


def test_kernels_that_trace_rays_lie_in_the_room_that_readies_them():
    """Without them LLVM ends the process."""
    tracing = {
        name.split(":")[0]
        for name in KERNELS
        if {"intersect8", "occluded8"} & vars(import_module(name.split(":")[0])).keys()
    }
    assert {home.rpartition(".")[0] for home in tracing} == {"terrain_forge.scene"}
    assert callable(import_module("terrain_forge.scene").before_compiling)


def test_the_cache_is_asked_for_what_it_holds():
    name = "terrain_forge.base.seeds:uniforms"
    kernel(name).compile(numba_types(KERNELS[name]))
    assert is_kept(name, KERNELS[name])
    assert not is_kept(name, ["uint64", "float32"])


AHEAD = """
from terrain_forge.base import compile_ahead, compiling
from terrain_forge.base.listed import listed

rooms = [room for room in listed("build").items() if len(room[1]) > 2][:4]
few = {name: dict(list(kernels.items())[-3:]) for name, kernels in rooms}  # the quickest
compiling.listed, compiling.unpack = lambda purpose: few, lambda: False
told = []
compile_ahead(lambda *one: told.append(one))
compile_ahead(print)
print(told[-1][0], told[0][1] < 0.5 < told[-1][1] <= 1.0)
"""


@pytest.mark.slow
def test_what_the_cache_lacks_is_compiled_ahead_once_and_told(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", AHEAD],
        capture_output=True, text=True, check=True, cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "2"},
    )  # fmt: skip
    assert done.stdout == "compile: 12 of 12 kernels, once True\n"


UNPACKED = """
import sys
from numba.core import event
import terrain_forge as tf
from terrain_forge.base import compile_ahead
from terrain_forge.base.listed import kernel, listed, signatures

class Told(event.Listener):
    def on_start(self, event):
        dispatcher = event.data["dispatcher"]
        if dispatcher.targetoptions.get("nogil") and not dispatcher._cache_hits:
            print(dispatcher.py_func)
    def on_end(self, event):
        pass

event.register("numba:compile", Told())
compile_ahead(print)
file = tf.load_recipe("recipes/hello.yaml", changes=("validate=null",))
tf.build(file.recipe, sys.argv[1], folder=file.folder)
mine = {name for room in listed("build").values() for name in room}
print(*(name for name in signatures() if kernel(name).signatures and name not in mine), end="")
compile_ahead(print, purpose="record")
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="made for x86-64-v3")
def test_a_build_takes_the_kernels_that_were_brought_along_and_compiles_none(tmp_path):
    """Nor does it load any that the list of a build does not have."""
    subprocess.run([sys.executable, "-m", "terrain_forge.base.shipped"], check=True, cwd=ROOT)
    done = subprocess.run(
        [sys.executable, "-c", UNPACKED, str(tmp_path / "world")],
        capture_output=True, text=True, check=True, cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    assert done.stdout == ""
