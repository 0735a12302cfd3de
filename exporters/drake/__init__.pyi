"""Drake: an SDF that Drake's parser loads whole, whose ground collides as it is."""

from .options import Options as Options
from .options import check_capacity as check_capacity
from .readback import CONSUMERS as CONSUMERS
from .readback import opening as opening
from .writing import export as export
