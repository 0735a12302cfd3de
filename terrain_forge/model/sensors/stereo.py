"""A stereo pair of cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import Fraction, matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.model.sensor import Topic
from terrain_forge.model.sensors.camera import CameraSensor

_BASELINES = {"navcam": 0.42}
_BASELINE = 0.12


@dataclass(frozen=True, kw_only=True, eq=False)
class StereoSensor(CameraSensor):
    """Two cameras side by side that take their images at once; its place is between them.

    Formats and recordings know them as two cameras, `NAME_left` and `NAME_right`. Their axes are
    parallel, so rectified pictures need no turning. The left one meters for both.
    """

    title: ClassVar[str] = "stereo camera"
    topics: ClassVar[tuple[Topic, ...]] = ()
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        name: {**preset, "baseline_m": _BASELINES.get(name, _BASELINE)}
        for name, preset in CameraSensor.PRESETS.items()
    }

    kind: Literal["stereo"] = "stereo"  # type: ignore[assignment]
    """A stereo pair."""
    baseline_m: Annotated[float, Interval(ge=0.001, le=10)] = _BASELINE
    """Distance of the two cameras [m]."""
    gain_mismatch: Fraction = 0.0
    """By what part the right camera is more sensitive than the left one."""

    @property
    def simple(self) -> tuple[CameraSensor, ...]:
        """The left and the right camera."""
        shared = {f.name: getattr(self, f.name) for f in fields(CameraSensor)}
        shared["channels"] = tuple(name for name in self.channels if name != "disparity")
        left = matrix_from_quaternion(quaternion_from_rpy(self.rpy))[:, 1]
        places = (self.position + side * 0.5 * self.baseline_m * left for side in (1.0, -1.0))
        return tuple(
            CameraSensor(
                **shared | {
                    "name": f"{self.name}_{side}", "kind": "camera", "preset": "",
                    "position_m": tuple(place.tolist()),
                }
            )
            for side, place in zip(("left", "right"), places, strict=True)
        )  # fmt: skip
