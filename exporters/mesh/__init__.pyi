"""Plain meshes: the world as PLY, STL or OBJ, for ray casters and for programs of any kind."""

from .options import Options as Options
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .writing import check_capacity as check_capacity
from .writing import export as export
