"""How rocks rest, judged over a sample of them."""

from types import SimpleNamespace

import numpy as np

from terrain_forge.validation.checks.rocks import Resting
from tests.helpers import worlds

UP = np.array([0.0, 0.0, 3.0])


def resting_checks(world):
    return Resting().checks(SimpleNamespace(world=world))


def test_of_many_rocks_a_sample_is_looked_at():
    many = worlds.world(rocks=6000)
    checks = resting_checks(many)
    counted = {int(check.note.split(",")[0].removeprefix("of ")) for check in checks[:1]}
    assert 1000 < counted.pop() < 6000
    assert resting_checks(many) == checks
    raised = many.replace(field=many.field.replace(position=many.field.position + UP))
    assert not resting_checks(raised)[0].passed
    sunk = many.replace(field=many.field.replace(position=many.field.position - UP))
    assert not resting_checks(sunk)[1].passed
