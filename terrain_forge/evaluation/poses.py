"""Poses with times, as systems write and evaluations read them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    Record,
    checked,
    matrix_from_quaternion,
    portable,
    quaternion_from_matrix,
    read_text,
    shaped,
)

MAX_FILE = 2**30
"""Bytes of a trajectory at most."""
_FARTHEST = 1e9
_UNIT = 1e-2
"""How far the length of a quaternion may be from 1: systems write few digits."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TimedPoses(Record):
    """Poses of one frame in another at ascending times."""

    name: str = "trajectory"
    """What tables call it."""
    time: Array = field(metadata=shaped("poses"))
    """Times [s], shape [poses]."""
    position: Array = field(metadata=shaped("poses", 3))
    """Origins [m], shape [poses, 3]."""
    quaternion: Array = field(metadata=shaped("poses", 4))
    """Rotations (w, x, y, z), shape [poses, 4]."""

    @property
    def rotation(self) -> Array:
        """Rotation matrices, shape [poses, 3, 3]."""
        return matrix_from_quaternion(self.quaternion)

    @property
    def stations(self) -> Array:
        """Length of the path up to each pose [m], shape [poses]."""
        steps = portable.norm(np.diff(self.position, axis=0))
        return np.concatenate([[0.0], np.cumsum(steps)])

    def select(self, rows: NDArray[np.intp]) -> TimedPoses:
        """The poses of some rows."""
        return self.replace(
            time=self.time[rows], position=self.position[rows], quaternion=self.quaternion[rows]
        )

    def moved(self, position: Array, rotation: Array) -> TimedPoses:
        """The poses of another frame that is fixed to this one.

        Args:
            position: Its origin in this frame [m], shape [3].
            rotation: From it to this frame, shape [3, 3].
        """
        quaternion = quaternion_from_matrix(portable.product(self.rotation, rotation))
        place = self.position + portable.product(self.rotation, position)
        return self.replace(position=place, quaternion=quaternion)

    def at(self, time: Array) -> TimedPoses:
        """The poses at times within these: places on straight lines, rotations on great arcs."""
        from scipy.spatial.transform import Rotation, Slerp

        time = np.clip(time, self.time[0], self.time[-1])
        place = np.stack([np.interp(time, self.time, x) for x in self.position.T], axis=-1)
        turns = Slerp(self.time.copy(), Rotation.from_quat(np.roll(self.quaternion, -1, axis=-1)))(
            time
        )
        quaternion = np.roll(turns.as_quat(), 1, axis=-1)
        return self.replace(time=time, position=place, quaternion=quaternion)


@checked
def read_poses(path: Path | str, *, name: str = "", euroc: bool | None = None) -> TimedPoses:
    """Read a trajectory in the TUM format, `time x y z qx qy qz qw` a line, or EuRoC's CSV.

    A CSV has nanoseconds, x, y, z and the quaternion as w, x, y, z; what follows is passed over.

    Args:
        path: The file.
        name: What tables call it; by default as the file.
        euroc: Whether it is EuRoC's; by default where its name ends in `.csv`.

    Raises:
        DataError: naming file and line: no numbers, NaN, times out of order, a quaternion that is
            not of length one, fewer than two poses.
    """
    path = Path(path)
    comma = path.suffix.lower() == ".csv" if euroc is None else euroc
    values, places = read_rows(path, 8, longer=comma)
    if comma:
        values[:, 0] /= 1e9
    time, position = values[:, 0], values[:, 1:4]
    quaternion = values[:, 4:8] if comma else np.roll(values[:, 4:8], 1, axis=-1)
    return checked_poses(time, position, quaternion, name=name or path.stem, places=places)


def read_kitti_poses(
    path: Path | str, *, name: str = "", stamps: Path | str | None = None
) -> TimedPoses:
    """Read a trajectory in KITTI's format, the 12 numbers of a 3 × 4 matrix a line.

    It has no times: they are the numbers of the lines, from 0, unless a file tells them.

    Args:
        path: The file.
        name: What tables call it.
        stamps: File with a number for each pose, a line each, ascending.

    Raises:
        DataError: as `read_poses`; also for a matrix that is no rotation, or other than one stamp
            for each pose.
    """
    from scipy.spatial.transform import Rotation

    path = Path(path)
    values, places = read_rows(path, 12)
    matrices = values.reshape(-1, 3, 4)
    turns = matrices[:, :, :3]
    finite = np.asarray(np.isfinite(turns).all(axis=(1, 2)))
    square = portable.product(np.swapaxes(turns, -1, -2), turns)
    off = np.abs(square - np.eye(3)).max(axis=(1, 2)) > _UNIT
    mirrored = np.linalg.det(turns) < 0.0
    for row in np.flatnonzero((off | mirrored) & finite)[:1]:
        raise DataError(f"{places[row]}: its matrix is no rotation")
    whole = np.where(finite[:, None, None], turns, np.eye(3))
    quaternion = np.roll(Rotation.from_matrix(whole).as_quat(), 1, axis=-1)
    quaternion[~finite] = np.nan
    time = np.arange(len(values), dtype=np.float64)
    if stamps is not None:
        told, places = read_rows(Path(stamps), 1)
        if len(told) != len(values):
            raise DataError(f"{stamps}: {len(told)} stamps for the {len(values)} poses of {path}")
        time = told[:, 0]
    return checked_poses(time, matrices[:, :, 3], quaternion, name=name or path.stem, places=places)


def is_kitti(path: Path) -> bool:
    """Whether the first line of a file that is no comment has 12 words, as in KITTI's format."""
    lines = read_text(path, str(path), most=MAX_FILE).splitlines()
    plain = (line.replace(",", " ").split() for line in lines if not line.strip().startswith("#"))
    return len(next(filter(None, plain), [])) == 12


def read_rows(
    path: Path, count: int, *, longer: bool = False, least: int = 2, most: int = 0
) -> tuple[Array, list[str]]:
    """The first numbers of each line, and the places of the lines; comments are passed over.

    Args:
        path: The file.
        count: Numbers that a line must have.
        longer: Whether it may have more.
        least: Lines that there must be.
        most: Numbers that are read where there are so many, NaN where there are fewer; `count` by
            default.

    Raises:
        DataError: naming file and line.
    """
    rows, places = [], []
    text = read_text(path, str(path), most=MAX_FILE)
    most = max(most, count)
    for number, line in enumerate(text.splitlines(), 1):
        plain = line.strip()
        if not plain or plain.startswith("#"):
            continue
        words = plain.replace(",", " ").split()
        try:
            row = [float(word) for word in words[:most]]
        except ValueError:
            raise DataError(f"{path}:{number}: {plain[:60]!r}, must be {count} numbers") from None
        if len(row) < count or (len(words) > count and not longer):
            kitti = " (KITTI's form needs --stamps)" if (len(words), count) == (12, 8) else ""
            raise DataError(f"{path}:{number}: {len(words)} numbers, must be {count}{kitti}")
        rows.append(row + [np.nan] * (most - len(row)))
        places.append(f"{path}:{number}")
    if len(rows) < least:
        raise DataError(f"{path}: a trajectory has at least {least} poses, found {len(rows)}")
    return np.array(rows).reshape(-1, most), places


def checked_poses(
    time: Array, position: Array, quaternion: Array, *, name: str, places: list[str] | None = None
) -> TimedPoses:
    """Poses that were checked; quaternions are brought to length one exactly.

    Raises:
        DataError: naming the first pose that is wrong.
    """

    def refuse(wrong: NDArray[np.bool_], what: str) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            place = places[row] if places else f"{name}: pose {row}"
            raise DataError(f"{place}: {what.format(row=row)}")

    values = np.column_stack([time, position, quaternion])
    refuse(np.asarray(~np.isfinite(values).all(axis=1)), "a value is not a finite number")
    refuse(np.concatenate([[False], np.diff(time) <= 0.0]), "its time is not after the one before")
    refuse(np.asarray(np.abs(position).max(axis=1) > _FARTHEST), "it is farther than 1e9 m away")
    length = portable.norm(quaternion)
    refuse(np.abs(length - 1.0) > _UNIT, "its quaternion is not of length one")
    return TimedPoses(
        name=name, time=time, position=position, quaternion=quaternion / length[:, None]
    )
