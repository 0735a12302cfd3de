"""Running a command line: interrupts, and the exit status and line of each error.

Exit status: 0 done; 1 built but a validation check failed; 2 the input is wrong; 3 the disk or
the system refused, code of another package failed, or an internal error; 130 interrupted.
"""

from __future__ import annotations

import ctypes
import errno
import gc
import io
import os
import signal
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
from click.exceptions import NoArgsIsHelpError

from terrain_forge.base import (
    FOREIGN_FAILURES,
    PluginError,
    SimulationError,
    StorageError,
    TerrainForgeError,
    listen_for_interrupts,
    plugin_at_fault,
)
from terrain_forge.terminal.lines import say

FAILED_CHECK, WRONG_INPUT, INTERNAL, INTERRUPTED = 1, 2, 3, 130
_STATUS = {
    SimulationError: FAILED_CHECK,
    StorageError: INTERNAL,
    PluginError: INTERNAL,
    TerrainForgeError: WRONG_INPUT,
    OSError: INTERNAL,
}
_NO_PATH = {errno.ENAMETOOLONG, errno.EISDIR, errno.ENOTDIR, errno.ELOOP}
"""What the system says of paths that cannot be what they should."""
_M_ARENA_MAX = -8


def run_command(command: click.Command, arguments: list[str]) -> int:
    """Run a command line; returns its exit status."""
    try:
        with listen_for_interrupts():
            # A build makes many objects and few cycles, the kernels' compiler above all.
            gc.set_threshold(100_000, 50, 50)
            _share_one_heap()
            status = command.main(arguments, prog_name="terrain-forge", standalone_mode=False)
            return int(status or 0)
    except NoArgsIsHelpError as error:
        error.show()
        return WRONG_INPUT
    except click.ClickException as error:
        message = " ".join(error.format_message().split())
        context = error.ctx if isinstance(error, click.UsageError) else None
        asked = context.command_path if context else "terrain-forge"
        say(f"terrain-forge: {message} (see {asked} --help)", err=True)
        return WRONG_INPUT
    except (click.Abort, KeyboardInterrupt) as error:
        why = str(error) or str(error.__cause__ or "")  # click's has what we raised as its cause
        say(f"interrupted, {why or 'nothing was left behind'}", err=True)
        return INTERRUPTED
    except UnicodeEncodeError as error:
        if "--debug" in arguments:
            traceback.print_exc()
        why = f"the locale's encoding, {sys.getfilesystemencoding()}, has no {error.object!r}"
        say(f"terrain-forge: {ascii(why)[1:-1]}: set PYTHONUTF8=1 or a UTF-8 locale", err=True)
        return INTERNAL
    except MemoryError as error:
        if "--debug" in arguments:
            traceback.print_exc()
        why = plugin_at_fault(error) or str(error) or "none is left"
        say(f"terrain-forge: the system gives no more memory: {why}", err=True)
        return INTERNAL
    except (TerrainForgeError, OSError) as error:
        if "--debug" in arguments:
            traceback.print_exc()
        if isinstance(error, OSError) and (told := plugin_at_fault(error)):
            say(f"terrain-forge: {told}; --debug shows all", err=True)
            return INTERNAL
        say(f"terrain-forge: {_told(error)}", err=True)
        if getattr(error, "errno", None) in _NO_PATH:
            return WRONG_INPUT
        return next((status for kind, status in _STATUS.items() if isinstance(error, kind)))
    except FOREIGN_FAILURES as error:
        if (told := plugin_at_fault(error)) and "--debug" not in arguments:
            say(f"terrain-forge: {told}; --debug shows all", err=True)
            return INTERNAL
        if isinstance(error, SystemExit):  # click's, when a shell has asked for completion
            return int(error.code or 0)
        traceback.print_exc()
        click.echo("terrain-forge: internal error, please report it with the lines above", err=True)
        return INTERNAL


def _told(error: Exception) -> str:
    """An error as a line; where the current folder was removed, the system names nothing."""
    if isinstance(error, FileNotFoundError) and error.filename is None:
        try:
            Path.cwd()
        except OSError:
            return "the current folder was removed: change to another"
    return str(error)


def run_process(command: click.Command) -> None:
    """Run the process's command line and end the process.

    It ends without taking the interpreter apart, which would take half a second after a build; and
    where an interrupt met an exec() (imports run some), CPython would end by the signal, although
    it was handled.
    """
    sys.unraisablehook, sys.excepthook = _tell_unraisable, _tell_uncaught
    _open_streams()
    with listen_for_interrupts():
        status = run_command(command, sys.argv[1:])
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # nobody reads it any more
                stream.flush()
        os._exit(status)


class _Stream(io.FileIO):
    """What is shown to somebody who may go: the rest is shown to nobody, and work goes on."""

    def write(self, content: Any, /) -> int:
        try:
            return super().write(content) or 0
        except OSError as error:
            if error.errno != errno.EPIPE and self.fileno() == 1:
                raise OSError(error.errno, error.strerror, "standard output") from None
            with Path(os.devnull).open("wb") as nobody:
                os.dup2(nobody.fileno(), self.fileno())
            return len(content)


def _open_streams() -> None:
    """Open the standard streams that were closed, let any name be shown, and readers go.

    Else the next files that are opened took their numbers, and what C libraries complain of.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        shown = getattr(sys, name)
        if shown is None:
            stream = Path(os.devnull).open("w" if number else "r", encoding="utf-8")
            with suppress(OSError):
                os.set_inheritable(number, stream.fileno() == number)
            setattr(sys, name, stream)
        elif number and isinstance(shown, io.TextIOWrapper):
            text = io.TextIOWrapper(
                io.BufferedWriter(_Stream(number, "w", closefd=False)),
                encoding=shown.encoding,
                errors="backslashreplace",
                line_buffering=shown.line_buffering,
                write_through=shown.write_through,
            )
            setattr(sys, name, text)


def _share_one_heap() -> None:
    """Let all threads take memory from one heap, where the C library is glibc (`mallopt`).

    It gives each thread a heap of its own, and what one frees the others cannot use: a tenth of a
    build's memory.
    """
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


_UNTOLD = KeyboardInterrupt, UnicodeDecodeError
"""Errors in C code that are not told: an interrupt, which a build asks for again; texts of GDAL's
that are no UTF-8, over which rasterio's logger stumbles: a file's reader tells of the file."""


def _tell_unraisable(unraisable: Any) -> None:
    if not issubclass(unraisable.exc_type, _UNTOLD):
        sys.__unraisablehook__(unraisable)


def _tell_uncaught(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    if not issubclass(kind, _UNTOLD):
        sys.__excepthook__(kind, error, trace)
