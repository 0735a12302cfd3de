"""Progress: lines without control characters where there is no terminal, one that ticks where there
is; the time left."""

import io
import re
import signal

import pytest

from terrain_forge.base import hold_interrupts
from terrain_forge.terminal import Display, display, say

STAGES = "plan", "ground", "rocks", "writing"


class Stream(io.StringIO):
    """An error stream that is a terminal or not."""

    def __init__(self, terminal):
        super().__init__()
        self._terminal = terminal

    def isatty(self):
        return self._terminal


@pytest.fixture
def shown(monkeypatch):
    """What a display writes to a terminal or none, in an environment."""

    def shown(*, terminal, **environment):
        stream = Stream(terminal)
        monkeypatch.setattr("sys.stderr", stream)
        for name in ("TERM", "NO_COLOR", "FORCE_COLOR", "COLORTERM"):
            monkeypatch.delenv(name, raising=False)
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        with Display(STAGES) as progress:
            progress("plan")
            progress.expect({"rocks": 40.0, "writing": 30.0})
            progress("rocks: settling", 0.2)
            progress("rocks: settling", 0.4)
            progress("writing: preview, usd", 0.5)
        return stream.getvalue()

    return shown


@pytest.mark.parametrize("environment", [{}, {"TERM": "xterm", "FORCE_COLOR": "1"}])
def test_no_terminal_has_a_line_for_each_stage(shown, environment):
    lines = [f"terrain-forge: 0:00 {stage}" for stage in ("plan", "rocks", "writing")]
    assert shown(terminal=False, **environment).splitlines() == lines
    assert shown(terminal=True, TERM="dumb").splitlines() == lines


def test_a_terminal_has_one_line_that_goes(shown):
    text = shown(terminal=True, TERM="xterm-256color", COLUMNS="80")
    assert "writing: preview, usd" in text
    assert re.search(r"0:00, 0:1[45] left", text)
    assert re.search(r"\x1b\[[\d;]*m", text)  # colours
    assert text.endswith(("\x1b[2K", "\x1b[?25h", "\x1b[1A\x1b[2K"))  # the line is gone
    plain = shown(terminal=True, TERM="xterm-256color", COLUMNS="80", NO_COLOR="1")
    assert not re.search(r"\x1b\[[\d;]*3\d", plain)


def test_work_that_is_refused_in_its_first_stage_is_told_by_its_error_alone(capsys):
    with Display(STAGES) as progress:
        progress("plan")
    assert capsys.readouterr().err == ""


def test_the_time_left_goes_from_what_was_expected_to_the_pace(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(display.time, "monotonic", lambda: now[0])
    progress = Display(STAGES)
    progress("plan")
    assert progress.left is None
    progress.expect({"ground": 10.0, "rocks": 20.0, "writing": 30.0})
    progress("ground")
    assert progress.left == 60.0
    now[0] = 4.0
    assert progress.left == 56.0  # it ticks between reports
    progress("rocks: scattering")
    assert progress.left == 50.0
    now[0] = 34.0
    progress("rocks: scattering", 0.5)  # half in 30 s: 30 s more, of which half is believed
    assert progress.left == 15.0 + 30.0
    now[0] = 64.0
    progress("rocks: settling", 0.0)  # another part has a pace of its own
    assert progress.left == 30.0
    now[0] = 100.0
    progress("writing")
    now[0] = 190.0
    assert progress.left == 0.0


def test_an_interrupt_that_waits_is_raised_at_the_next_report():
    reached = []

    def work() -> None:
        with hold_interrupts(), Display(STAGES) as progress:
            progress("plan")
            signal.raise_signal(signal.SIGINT)
            reached.append("plan")
            progress("ground")
            reached.append("ground")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["plan"]


def test_a_stage_that_was_not_expected_does_not_fill_the_bar():
    progress = Display(STAGES)
    progress("plan")
    progress("surprise: 12 of 12", 1.0)
    assert progress.done <= 0.25
    progress.follow(("surprise", "rocks"))
    progress("surprise", 1.0)
    assert progress.done == 0.5


def test_figures_that_change_do_not_begin_the_pace_anew(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(display.time, "monotonic", lambda: now[0])
    progress = Display(("load", "recording"))
    progress("load")
    progress("recording: 0 of 300", 0.0)
    assert progress.left is None
    now[0] = 30.0
    progress("recording: 100 of 300, 3.33 a second", 0.25)
    assert progress.left == 90.0  # of the last stage, though nothing was expected
    assert progress.done == 0.625


def test_stages_of_which_no_time_is_known_keep_their_part_of_the_bar(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(display.time, "monotonic", lambda: now[0])
    progress = Display(("load", "recording", "tables", "page"))
    progress("load")
    progress.expect({"recording": 10.0})
    progress("recording")
    now[0] = 10.0
    progress("recording", 1.0)
    assert progress.done == 0.5
    progress("page")
    assert progress.done == 0.75


def test_what_was_there_before_has_no_pace(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(display.time, "monotonic", lambda: now[0])
    progress = Display(("download",))
    progress("download: 50 MB of 100 MB", 0.5)
    assert progress.left is None
    now[0] = 10.0
    progress("download: 60 MB of 100 MB", 0.6)
    assert progress.left == pytest.approx(40.0)


def test_a_line_beside_a_bar_is_given_to_it(monkeypatch):
    """Not to the stream beneath, where the bar would stay as it stands."""

    class Proxy(io.StringIO):
        buffer = io.BytesIO()
        encoding = "ascii"

    monkeypatch.setattr("sys.stderr", proxy := Proxy())
    say("a warning", err=True)
    assert (proxy.getvalue(), proxy.buffer.getvalue()) == ("a warning\n", b"")
