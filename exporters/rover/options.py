"""What can be chosen for the rover's own files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import MinLen

from terrain_forge.base import Idle, Positive, Spec, refuse_twice

Format = Literal["urdf", "mjcf", "sdf", "usd"]


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the rover export."""

    bytes_each: ClassVar[tuple[float, float]] = (0, 0)
    """About how many bytes it writes for each node of the ground and each rock."""
    kind: Literal["rover"] = "rover"
    """The exporter, where the export's folder has another name."""
    formats: Annotated[tuple[Format, ...], MinLen(1)] = ("urdf", "mjcf", "sdf", "usd")
    """What to write."""
    friction: Positive = 1.0
    """Coulomb friction of the rover's parts, where a format tells it with the rover. With 1 the
    ground has the say in Gazebo, which takes the smaller of two."""
    mesh_prefix: str = ""
    """What the URDF's paths of meshes begin with, such as `package://my_rover/`; by default they
    are relative to the file, as simulators read them and RViz does not."""
    release: Literal["fortress", "harmonic"] = "fortress"
    """The oldest gz-sim that shall read the SDF: `fortress` writes SDF 1.9, `harmonic` SDF 1.11,
    which knows joints that follow others."""

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        for name, one in (("mesh_prefix", "urdf"), ("release", "sdf")):
            if one not in self.formats:
                yield Idle(name, f"{one} is none of the formats", refused=True)

    def __post_init__(self) -> None:
        refuse_twice(self.formats, ("formats",))
        self.refuse_idle()


def prepare(options: Options) -> None:
    """Load OpenUSD, before other threads run."""
    if "usd" in options.formats:
        from pxr import Usd  # noqa: F401
