"""A rover of the user's own: what the recipe says about a URDF, xacro or MJCF file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Interval, MinLen

from terrain_forge.base import Array, InputFile, Positive, Spec
from terrain_forge.model import Rover

JointName = Annotated[str, MinLen(1)]
Frame = tuple[str, Array]
"""A link of the rover, and a pose in its frame, shape [4, 4]."""


@dataclass(frozen=True, kw_only=True)
class FoundRover:
    """A rover and the files that it was read from."""

    rover: Rover
    """The rover."""
    files: tuple[Path, ...] = ()
    """All files that were read: the rover's own, those it includes, its meshes."""
    frames: Mapping[str, Frame] = field(default_factory=dict)
    """Where the frames of the file's links are, by name."""


@dataclass(frozen=True, kw_only=True)
class RoverSpec(Spec):
    """What a recipe may say about any rover."""

    step_limit_m: Positive | None = None
    """Highest step or rock that it goes over [m], at most its smallest wheel's diameter; by default
    the lower of its clearance and 0.8 of that diameter, an assumption (docs/rovers.md)."""


@dataclass(frozen=True, kw_only=True)
class CouplingSpec(Spec):
    """A gear that the rover's file does not name: joint = ratio * follows + offset."""

    joint: JointName
    """The joint that follows."""
    follows: JointName
    """The joint that it follows."""
    ratio: float = -1.0
    """Angle per angle; -1 for a differential between two rockers."""
    offset_deg: float = 0.0
    """Angle of the joint where the other's is 0 [degrees]."""


@dataclass(frozen=True, kw_only=True)
class FileRover(RoverSpec):
    """A rover of your own, from its URDF, xacro or MJCF (docs/rovers.md)."""

    kind: Literal["file"] = "file"
    """A rover from a file."""
    file: Annotated[str, MinLen(1), InputFile(kind="rover")]
    """The `.urdf`, `.xacro` or MJCF `.xml` file."""
    trust: bool = False
    """Whether a `.xacro` is expanded by the package `xacro`, which runs the file's expressions as
    Python, with all that Python can do. Without it they are arithmetic alone (docs/rovers.md)."""
    wheels: tuple[JointName, ...] = ()
    """Links or joints of the driven wheels; by default those that turn without end and have `wheel`
    in a name."""
    base: str | None = None
    """Link whose x axis points forward, y left and z up; by default `base_link` if there is one,
    else the root."""
    forward: Literal["x", "-x", "y", "-y"] = "x"
    """Axis of the base that points forward."""
    passive: tuple[JointName, ...] = ()
    """Joints that turn freely though the file drives them or they look like steering."""
    held: tuple[JointName, ...] = ()
    """Joints of the suspension that are held at rest."""
    couplings: tuple[CouplingSpec, ...] = ()
    """Gears between passive joints that the file does not name."""
    wheel_radius_m: Positive | None = None
    """Radius of the wheels [m]; by default that of their shapes."""
    packages: dict[str, Annotated[str, InputFile(kind="folder")]] = field(default_factory=dict)
    """Folders of the packages that the file's paths name, as `{package: folder}`; by default
    looked for above the file and beside it."""
    torque_limit_n_m: Positive | None = None
    """Largest torque of a wheel's motor [N m]; by default the file's, else enough for a slope of
    the steepest tilt."""
    speed_limit_m_s: Positive = 0.5
    """Largest speed over ground [m/s]."""
    tilt_limit_deg: Annotated[float, Interval(gt=0, lt=90)] = 25.0
    """Largest tilt in which it may be driven [degrees]."""
