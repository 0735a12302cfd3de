import gc
import os
import signal
import sys
from dataclasses import replace
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads wait busily

import pytest

from terrain_forge.rocks import find_library
from tests.helpers import pictures, worlds
from tests.helpers.gazebo import compile_program


@pytest.fixture(scope="session")
def small_world():
    return worlds.world()


@pytest.fixture(scope="session")
def build(tmp_path_factory):
    """Compiles one of the small programs of tests/consumers, or skips the test."""
    return partial(compile_program, tmp_path_factory.mktemp("consumers"))


@pytest.fixture
def few_shapes(monkeypatch):
    """Plans judge by two shapes how rocks are packed: a recipe's own take 0.1 s each."""

    def found(spec, **more):
        return find_library(replace(spec, shapes=2), **more)

    monkeypatch.setattr("terrain_forge.making.planning.find_library", found)


@pytest.fixture
def use_threads(monkeypatch):
    """Lets kernels run on so many threads."""
    return partial(monkeypatch.setattr, "numba.config.NUMBA_NUM_THREADS")


@pytest.fixture(scope="session", autouse=True)
def _interrupts():
    """Who runs the tests in the background may have them ignore interrupts, which some raise."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory):
    """Tests share rock libraries among themselves and their processes, not with the user.

    They reach no network; those of downloads allow their own server.
    """
    with pytest.MonkeyPatch.context() as patch:
        root = tmp_path_factory.getbasetemp()
        shared = root.parent if "PYTEST_XDIST_WORKER" in os.environ else root
        patch.setenv("TERRAIN_FORGE_CACHE", str(shared / "cache"))
        patch.setenv("TERRAIN_FORGE_OFFLINE", "1")
        yield


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    """To start threads for small things costs more than it saves; some tests ask for several."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("numba.config.NUMBA_NUM_THREADS", 1)
        yield


@pytest.fixture(scope="session", autouse=True)
def _small_pictures():
    """Most of what building a small world costs is its pictures."""
    with pytest.MonkeyPatch.context() as patch:
        pictures.make_small(patch)
        yield


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems():
    """Hypothesis would read the literals of all our files: ten seconds in a new clone."""
    providers = "hypothesis.internal.conjecture.providers"
    known = getattr(sys.modules.get(providers), "_local_constants", None)
    if known is not None:
        pytest.MonkeyPatch().setattr(f"{providers}._get_local_constants", lambda: known)


def pytest_collection_finish():
    """Tests make many objects and few cycles: do not look through all that was imported."""
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure():
    """Pytest has just looked for garbage, and would look through everything once more."""
    gc.freeze()
