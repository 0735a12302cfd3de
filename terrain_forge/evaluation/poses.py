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
    matrix_from_quaternion,
    portable,
    read_text,
    shaped,
)

_MAX_FILE = 2**30
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
        from scipy.spatial.transform import Rotation

        turned = portable.product(self.rotation, rotation)
        quaternion = np.roll(Rotation.from_matrix(turned).as_quat(), 1, axis=-1)
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


def read_poses(path: Path | str, *, name: str = "") -> TimedPoses:
    """Read a trajectory in the TUM format, `time x y z qx qy qz qw` a line, or EuRoC's CSV.

    A CSV has nanoseconds, x, y, z and the quaternion as w, x, y, z; what follows is passed over.

    Raises:
        DataError: naming file and line: no numbers, NaN, times out of order, a quaternion that is
            not of length one, fewer than two poses.
    """
    path = Path(path)
    rows, where = [], []
    text = read_text(path, str(path), most=_MAX_FILE)
    comma = path.suffix.lower() == ".csv"
    for number, line in enumerate(text.splitlines(), 1):
        plain = line.strip()
        if not plain or plain.startswith("#"):
            continue
        words = plain.replace(",", " ").split()
        try:
            rows.append([float(word) for word in words[:8]])
        except ValueError:
            raise DataError(f"{path}:{number}: {plain[:60]!r}, must be 8 numbers") from None
        if len(rows[-1]) < 8 or (len(words) > 8 and not comma):
            raise DataError(f"{path}:{number}: {len(words)} numbers, must be 8")
        where.append(number)
    if len(rows) < 2:
        raise DataError(f"{path}: {len(rows)} poses, at least 2 are needed")
    values = np.array(rows)
    if comma:
        values[:, 0] *= 1e-9
    time, position = values[:, 0], values[:, 1:4]
    quaternion = values[:, 4:8] if comma else np.roll(values[:, 4:8], 1, axis=-1)
    return checked_poses(
        time, position, quaternion, name=name or path.stem, places=[f"{path}:{n}" for n in where]
    )


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
    length = portable.norm(quaternion)
    refuse(np.abs(length - 1.0) > _UNIT, "its quaternion is not of length one")
    return TimedPoses(
        name=name, time=time, position=position, quaternion=quaternion / length[:, None]
    )
