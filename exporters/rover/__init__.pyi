"""The rover alone, to drive in a simulator of your choice: URDF, MJCF, SDF and USD."""

from .options import Options as Options
from .options import prepare as prepare
from .readback import CONSUMERS as CONSUMERS
from .writing import export as export
from .writing import opening as opening
