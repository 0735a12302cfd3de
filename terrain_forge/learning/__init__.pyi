"""Learning to drive: an environment of Gymnasium, batched queries, ground for other engines."""

from .adapters import GroundMaker as GroundMaker
from .adapters import add_to_spec as add_to_spec
from .adapters import trimeshes as trimeshes
from .drive import DriveEnv as DriveEnv
from .queries import Grounds as Grounds
from .registration import DRIVE as DRIVE
from .registration import register_environments as register_environments
