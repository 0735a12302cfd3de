"""The list of kernels that a first build compiles ahead is that of the code."""

import json
from inspect import signature

import pytest

from terrain_forge.base.compiling import LISTED, kernel, numba_types, plain_types

KERNELS = {
    name: types for room in json.loads(LISTED.read_text()).values() for name, types in room.items()
}


@pytest.mark.parametrize("name", KERNELS)
def test_a_listed_kernel_takes_what_the_list_says(name):
    types = numba_types(KERNELS[name])
    assert plain_types(types) == KERNELS[name]
    assert len(types) == len(signature(kernel(name).py_func).parameters)
