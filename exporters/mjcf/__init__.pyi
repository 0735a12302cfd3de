"""MJCF: the world and the scene for MuJoCo, and for what else reads its XML."""

from .capacity import check_capacity as check_capacity
from .options import Options as Options
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .writing import export as export
