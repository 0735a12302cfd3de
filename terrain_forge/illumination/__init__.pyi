"""Where the Sun shines and the Earth is seen: horizons, shadows, hours of light over a period."""

from .horizon import Relief as Relief
from .horizon import horizon_slopes as horizon_slopes
from .land import Land as Land
from .land import Source as Source
from .period import Light as Light
from .period import seen_part as seen_part
from .period import solar_day as solar_day
from .survey import Wish as Wish
from .survey import illuminate as illuminate
