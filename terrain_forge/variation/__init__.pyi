"""Many worlds of one recipe: what is drawn for each, how hard it is, and making them all."""

from .drawing import Drawn as Drawn
from .drawing import draw as draw
from .drawing import require_drawable as require_drawable
from .drawing import variation_line as variation_line
from .grid import make_grid as make_grid
from .series import ORDER as ORDER
from .series import Worlds as Worlds
from .series import name_of as name_of
from .series import worlds as worlds
from .series import worlds_in as worlds_in
from .summary import read_summary as read_summary
