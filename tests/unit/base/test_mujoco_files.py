"""MuJoCo without a word of its own."""

import mujoco
import numpy as np
import pytest

from terrain_forge.base import silent_mujoco


def diverge():
    """MuJoCo's count of warnings after a step from a speed that is no number."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qvel[0] = np.nan
    mujoco.mj_step(model, data)
    return int(data.warning.number.sum())


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to stand in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_warnings_are_counted_and_nothing_is_written_or_said(here, capfd):
    with silent_mujoco():
        with silent_mujoco():
            assert diverge()
        assert diverge()
    assert list(here.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_afterwards_mujoco_speaks_again(here, capfd):
    with silent_mujoco():
        pass
    diverge()
    assert "unstable" in capfd.readouterr().err


def test_a_users_handler_stays(here):
    told = []
    mujoco.set_mju_user_warning(told.append)
    try:
        with silent_mujoco():
            diverge()
        diverge()
    finally:
        mujoco.set_mju_user_warning(None)
    assert len(told) == 2
