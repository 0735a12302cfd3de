"""Systems that localise: how a program is told what to read, run under watch, and read back."""

from __future__ import annotations

import re
import shlex
import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval, MinLen

from terrain_forge.base import DataError, FileName, Record, Spec, read_text
from terrain_forge.datasets import checked_options
from terrain_forge.evaluation.loops import Loops, read_loops
from terrain_forge.evaluation.poses import MAX_FILE, TimedPoses, read_kitti_poses, read_poses
from terrain_forge.evaluation.program import Program, end_of

Need = Literal["mono", "stereo", "rgbd", "lidar", "imu", "odometry"]
OutputFormat = Literal["tum", "euroc", "kitti"]
SENSOR_PLACES = {
    "left": "stereo", "right": "stereo", "lidar": "lidar",
}  # fmt: skip
"""Places that stand for the folder of a sensor in a recording, and the need that has it."""
_PLACEHOLDER = re.compile(r"\{(\w+)\}")
_KEPT = 2**24
"""Bytes of what a program printed or wrote that are kept."""
LOG = "output.txt"
"""Name of the file of what a program printed."""
MAP = "map"
"""Name of a map that is kept, without its ending."""
_OWN = "own_s.txt"
"""Where a driver tells its own processor time."""
_TOLD = 4
"""Names of files that a message has at most."""


@dataclass(frozen=True, kw_only=True)
class Adapter(Spec):
    """A program that localises: what it needs, reads and writes.

    The command is words, not a shell's line: `{input}` stands for the folder or file of the
    recording in the `input` format, `{output}` for the file that the program shall write its
    trajectory to, `{recording}` for the recording's own folder, `{calibration}` for the folder of
    its calibration files, `{left}` and `{right}` for the folders' names of the recorded stereo pair
    such as `cam0`, `{lidar}` for that of the first recorded lidar, `{folder}` for the temporary
    folder that it runs in, `{binary}` for the program that the user named, `{vocabulary}` for a
    vocabulary of ORB features, `{python}` for the interpreter of the environment that
    `install_system` made, `{driver}` for the folder of our small drivers.

    A driver around a system may write into its folder, as `own_s.txt`, the processor time [s] that
    is its own: the system's is told without it.
    """

    name: FileName
    """What tables call it."""
    needs: tuple[Need, ...] = ()
    """Kinds of sensors that the recording must hold."""
    input: FileName = "euroc"
    """Format of recordings that it reads, as `terrain-forge record --formats` calls it."""
    input_options: dict[str, str | int | float | bool | tuple[str, ...]] = field(
        default_factory=dict
    )
    """Options of that format, as `dataset: {formats: …}` has them in recipes."""
    command: Annotated[str, MinLen(1)]
    """Program and arguments."""
    output: Annotated[str, MinLen(1)] = "{output}"
    """The trajectory's file, where the program itself chooses its name: relative to the temporary
    folder, `*` for any characters; it must name one file."""
    format: OutputFormat = "tum"
    """Format of the trajectory."""
    stamps: str = ""
    """Of `kitti`, where not each frame has a pose: the file that tells of which they are, a number
    a line, as `output` names one; without it there must be as many poses as frames."""
    stamps_in: Literal["seconds", "frames"] = "seconds"
    """What these numbers are: seconds from the first frame on, as in KITTI's times.txt, or the
    recording's own; or numbers of frames, from 0."""
    frames: Literal["each", "found", "last"] = "each"
    """Of `kitti` without `stamps`, which frames have its poses: `each`; those it `found`: there is
    a pose for each, and one that repeats the one before is of a frame in which it was lost; or
    the `last` ones, as many as there are poses, without all that are alike, as ORB-SLAM2 has it:
    in the first frame of a loss it tells what it expected, then that again."""
    loops: str = ""
    """The file of its loop closures, where it writes one, as `output` names one: two times a line,
    of the two ends, and perhaps x, y, z of the second in the frame of the first [m]."""
    loops_in: Literal["seconds", "frames"] = "seconds"
    """What these times are, as of `stamps_in`."""
    map: str = ""
    """The map that it made, where it writes one, as `output` names one: a file as `--map` takes,
    in the frame of its trajectory."""
    frame: FileName = "base_link"
    """Whose motion the trajectory is: `base_link`, a sensor's folder such as `cam0` or `imu0`, one
    of `{left}`, `{right}`, `{lidar}` as in the command, or `body`: that of the first IMU, or
    base_link where none was recorded."""
    timeout_s: Annotated[float, Interval(ge=1, le=1e6)] = 3600.0
    """When it is killed [s]."""
    environment: dict[str, str] = field(default_factory=dict)
    """Variables that it gets beside those of the caller."""
    packages: tuple[str, ...] = ()
    """What `terrain-forge evaluate --install` puts into an environment of its own for it."""
    modules: tuple[Annotated[str, MinLen(1)], ...] = ()
    """Modules that our own Python must have, for one without packages."""
    loose: bool = False
    """Whether the first package is installed without what it asks for."""
    environment_of: FileName | None = None
    """Another name for its environment, which systems of the same packages share."""
    binary: str = ""
    """What `{binary}` stands for in the command: a program that the user has."""
    about: str = ""
    """What it is, and under which licence."""

    PLACES: ClassVar[tuple[str, ...]] = (
        "input", "output", "recording", "calibration", "folder", "python", "driver", "binary",
        "vocabulary", *SENSOR_PLACES,
    )  # fmt: skip

    @property
    def needs_binary(self) -> bool:
        """Whether it runs a program that the user must name."""
        return "{binary}" in self.command and not self.binary

    @property
    def needs_vocabulary(self) -> bool:
        """Whether it is given a vocabulary of ORB features."""
        return "{vocabulary}" in self.command

    def require_sound(self) -> None:
        """Refuse what no recording could be read with: an unknown place, an input that is none.

        Raises:
            DataError, RecipeError: names the key.
        """
        places = dict.fromkeys(self.PLACES, "")
        self.words(places)
        for key in ("output", "stamps", "loops", "map"):
            self._filled(key, getattr(self, key), places)
        self.frame_of(dict.fromkeys(SENSOR_PLACES, ""))
        if self.input != "euroc":
            checked_options(self.input, self.input_options)

    def words(self, places: Mapping[str, str]) -> list[str]:
        """The command with its places filled in.

        Raises:
            DataError: for an unknown place, or a quote without its end.
        """
        try:
            words = shlex.split(self.command)
        except ValueError as error:
            raise DataError(f"{self.name}: command: {str(error).lower()}") from None
        return [self._filled("command", word, places) for word in words]

    def frame_of(self, places: Mapping[str, str]) -> str:
        """The folder, or `base_link` or `body`, whose motion the trajectory is.

        Raises:
            DataError: for an unknown place.
        """
        return self._filled("frame", self.frame, places)

    def sensor_places(self) -> list[str]:
        """Which places of sensors the command or the frame has."""
        words = set(_PLACEHOLDER.findall(f"{self.command} {self.frame}"))
        return [name for name in SENSOR_PLACES if name in words]

    def _filled(self, key: str, text: str, places: Mapping[str, str]) -> str:
        """A text of a key with its places filled in."""

        def place(found: re.Match[str]) -> str:
            if found[1] not in places:
                known = ", ".join(f"{{{name}}}" for name in self.PLACES if name in places)
                raise DataError(f"{self.name}: {key} has {found[0]}, known: {known}")
            return places[found[1]]

        return _PLACEHOLDER.sub(place, text)


@dataclass(frozen=True, kw_only=True, eq=False)
class Run(Record):
    """One run of a system, whatever came of it."""

    system: str
    """Its name."""
    status: str
    """`done`; `failed` where it ended wrongly or could not be started; `lost` where it told no
    trajectory or too little of one; `timeout` where it was killed."""
    why: str = ""
    """What was wrong."""
    estimate: TimedPoses | None = None
    """The trajectory, in the system's own frame and clock."""
    loops: Loops | None = None
    """Its loop closures, in its own clock; None where it tells none."""
    seconds: float
    """How long it ran [s]."""
    map: Path | None = None
    """The map that it made; None where it tells none."""
    processor_s: float
    """Processor time of it and of what it started and waited for [s], without a driver's own."""
    memory: float
    """The largest memory of it or of one that it started [bytes]; 0 where it had to be killed."""
    log: str
    """Last lines of what it printed."""


def run_system(adapter: Adapter, places: Mapping[str, str], *, keep: Path | None = None) -> Run:
    """Run a system in a temporary folder and process group of its own, and read its trajectory.

    Args:
        adapter: The system.
        places: What stands in the command for `{input}`, `{calibration}`, `{python}`, `{driver}`.
        keep: A folder that its output and trajectory are copied to.

    Raises:
        DataError: for a command that cannot be filled in; whatever the program does is a result.
    """
    with tempfile.TemporaryDirectory(prefix="terrain-forge-") as name:
        folder = Path(name)
        output = folder / f"{adapter.name}.{adapter.format}"
        told = {**places, "folder": str(folder), "output": str(output)}
        words = adapter.words(told)
        pattern, stamps, closures, chart = (
            _PLACEHOLDER.sub(lambda found: told.get(found[1], found[0]), text)
            for text in (adapter.output, adapter.stamps, adapter.loops, adapter.map)
        )
        status, why, used = _watched(words, folder, adapter)
        estimate, loops, made, wrong = None, None, None, ""
        if status == "done":
            estimate, wrong = _estimate(folder, pattern, stamps, adapter)
            status, why = ("done", "") if estimate is not None else ("lost", wrong)
            if closures and estimate:
                loops, why = _closures(folder, closures)
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            (keep / LOG).unlink(missing_ok=True)
            (keep / LOG).write_bytes(end_of(folder / LOG, _KEPT))
            trajectory = keep / f"{adapter.name}.{adapter.format}"
            trajectory.unlink(missing_ok=True)  # an earlier run's
            files = _found(folder, pattern)
            if len(files) == 1 and files[0].stat().st_size <= MAX_FILE:
                shutil.copyfile(files[0], trajectory)
            made, wrong = _kept_map(folder, chart, keep)
            why = why or (wrong if status == "done" else "")
        used = _without_own(folder, used)
        last = end_of(folder / LOG, 4000).decode(errors="replace")
    seconds, processor, memory = used
    return Run(
        system=adapter.name, status=status, why=why, estimate=estimate, seconds=seconds,
        processor_s=processor, memory=memory, log=last, loops=loops, map=made,
    )  # fmt: skip


def _kept_map(folder: Path, pattern: str, keep: Path) -> tuple[Path | None, str]:
    """A copy of the map that a program made, and what is wrong with it; an earlier run's goes."""
    for older in keep.glob(f"{MAP}.*"):
        older.unlink()
    if not pattern:
        return None, ""
    try:
        path = _one_file(folder, pattern, "map")
    except DataError as error:
        return None, str(error)
    return Path(shutil.copyfile(path, keep / f"{MAP}{path.suffix}")), ""


def _without_own(folder: Path, used: tuple[float, float, float]) -> tuple[float, float, float]:
    """What a system used, without the processor time that its driver says is its own."""
    seconds, processor, memory = used
    try:
        own = float(read_text(folder / _OWN, _OWN, most=_KEPT))
    except (DataError, ValueError):
        own = 0.0
    return seconds, processor - own if 0.0 < own < processor else processor, memory


def _closures(folder: Path, pattern: str) -> tuple[Loops | None, str]:
    """The loop closures that a program wrote, or what is wrong with them."""
    try:
        path = _one_file(folder, pattern, "loop closures")
    except DataError as error:
        return None, f"{error} in its folder"
    try:
        return read_loops(path), ""
    except DataError as error:
        return None, f"loop closures: {str(error).replace(f'{path.parent}/', '')}"


def _watched(
    words: list[str], folder: Path, adapter: Adapter
) -> tuple[str, str, tuple[float, float, float]]:
    """Status, what was wrong, and seconds, processor time and memory of a program."""
    begin = time.monotonic()
    program = Program(words, folder=folder, log=folder / LOG, environment=adapter.environment)
    with program:
        late = not program.ended(adapter.timeout_s)
    told = program.used
    if isinstance(told, str):
        return "failed", told, (0.0, 0.0, 0.0)
    used = (time.monotonic() - begin, *told)
    if late:
        return "timeout", f"killed after {adapter.timeout_s:g} s", used
    if program.status:
        return "failed", program.ending, used
    return "done", "", used


def _found(folder: Path, pattern: str) -> list[Path]:
    """Files of its own folder that a pattern names; no link leads out of it."""
    inside = folder.resolve()
    path = Path(pattern)
    named = [path] if path.is_absolute() else sorted(folder.glob(pattern))
    found = {p.resolve(): p for p in named if p.is_file()}  # a link to another one is no second
    return [path for place, path in found.items() if place.is_relative_to(inside)]


def _one_file(folder: Path, pattern: str, what: str) -> Path:
    """The file of its own folder that a pattern names.

    Raises:
        DataError: if there is none, or more than one.
    """
    found = _found(folder, pattern)
    if len(found) > 1:
        names = ", ".join(str(path.relative_to(folder)) for path in found[:_TOLD])
        raise DataError(f"wrote {len(found)} files of its {what} ({pattern}): {names}")
    if not found:
        raise DataError(f"wrote no {what} ({Path(pattern).name})")
    return found[0]


def _estimate(
    folder: Path, pattern: str, stamps: str, adapter: Adapter
) -> tuple[TimedPoses | None, str]:
    """The trajectory that a program wrote, or what is wrong with it."""
    try:
        path = _one_file(folder, pattern, "trajectory")
        times = _one_file(folder, stamps, "stamps") if stamps else None
        if adapter.format == "kitti":
            return read_kitti_poses(path, name=adapter.name, stamps=times), ""
        return read_poses(path, name=adapter.name, euroc=adapter.format == "euroc"), ""
    except DataError as error:
        return None, str(error).replace(f"{folder}/", "")
