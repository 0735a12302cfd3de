"""From a recipe to a Site, from a Site to a World."""

from .lighting import light_at as light_at
from .lighting import light_of as light_of
from .lighting import place_of as place_of
from .planning import draft as draft
from .planning import plan as plan
from .planning import plan_draft as plan_draft
from .planning import with_fetched as with_fetched
from .realising import horizon_around as horizon_around
from .realising import make_ground as make_ground
from .realising import make_horizon as make_horizon
from .realising import make_world as make_world
