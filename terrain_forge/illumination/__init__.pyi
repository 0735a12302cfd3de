"""Where the Sun shines and the Earth is seen: horizons, shadows, hours of light over a period."""

from .horizon import Relief as Relief
from .horizon import horizon as horizon
from .land import Land as Land
from .land import Source as Source
from .land import find_land as find_land
from .period import Light as Light
from .period import light_over as light_over
from .period import moments_of as moments_of
from .period import seen_part as seen_part
from .period import solar_day as solar_day
from .survey import Wish as Wish
from .survey import illuminate as illuminate
