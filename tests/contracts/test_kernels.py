"""The list of kernels that a first build compiles ahead is that of the code."""

import json
import os
import subprocess
import sys
from importlib import import_module
from inspect import signature

import pytest
from numba.types import NamedTuple

from terrain_forge.base.compiling import LISTED, is_kept, kernel, numba_types, plain_types
from terrain_forge.scene.embree import load_library
from tests.helpers.places import ROOT

KERNELS = {
    name: types for room in json.loads(LISTED.read_text()).values() for name, types in room.items()
}


@pytest.mark.parametrize("name", KERNELS)
def test_a_listed_kernel_takes_what_the_list_says(name):
    types = numba_types(KERNELS[name])
    for members in (one for one in types if isinstance(one, NamedTuple)):
        assert len(members.types) == len(members.fields), members.instance_class
    assert plain_types(types) == KERNELS[name]
    for record in (found for found in types if hasattr(found, "instance_class")):
        assert len(record) == len(record.instance_class._fields)
    assert len(types) == len(signature(kernel(name).py_func).parameters)


@pytest.mark.parametrize("name", KERNELS)
def test_a_kernel_that_traces_rays_has_them_ready_before_it_compiles(name):
    """Without them LLVM ends the process."""
    home = import_module(name.split(":")[0])
    if {"intersect8", "occluded8"} & vars(home).keys():
        assert home.before_compiling is load_library


def test_the_cache_is_asked_for_what_it_holds():
    name = "terrain_forge.base.seeds:uniforms"
    kernel(name).compile(numba_types(KERNELS[name]))
    assert is_kept(name, KERNELS[name])
    assert not is_kept(name, ["uint64", "float32"])


@pytest.mark.slow
def test_all_listed_kernels_are_compiled_ahead(tmp_path):
    code = (
        "from terrain_forge.base import compile_ahead; compile_ahead(print); compile_ahead(print)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "2"},
    )  # fmt: skip
    count = len(KERNELS)
    assert done.stdout == f"compiling {count} of {count} kernels in 2 processes, once\n"
