"""A consumer that fails has read nothing: the export's check says why, and the rest goes on."""

from __future__ import annotations

import pytest

from terrain_forge.model import Export
from terrain_forge.validation import Consumer, NotRun
from terrain_forge.validation.sample import draw_sample
from terrain_forge.validation.suite import read
from tests.helpers import worlds


@pytest.fixture(scope="module")
def sample():
    return draw_sample(worlds.world(), points=3, quick=True)


def read_with(error, sample, folder):
    """What is told of an export whose consumer raises an error."""

    def fails(*_):
        raise error

    consumer = Consumer(name="theirs", read=fails, quick=True)
    export = Export(folder="xyz", kind="xyz", options={})
    (entry,), reading = read(sample, folder, export, consumer, None, folder)
    assert reading is None
    return entry.status, entry.note


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ValueError("a\nb"), ("fail", "cannot be read: a b")),
        (MemoryError(), ("fail", "cannot be read: MemoryError")),
        (
            SystemExit(3),
            ("fail", "cannot be read: it would end the process (SystemExit: 3)"),
        ),
        (NotRun("not here"), ("not run", "not here")),
    ],
)
def test_a_consumer_that_fails_fails_the_check(sample, tmp_path, error, told):
    assert read_with(error, sample, tmp_path) == told


def test_an_interrupt_is_the_user_s(sample, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        read_with(KeyboardInterrupt(), sample, tmp_path)
