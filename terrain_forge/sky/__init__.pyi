"""Where Sun and Earth stand by date, and what the sky looks like."""

from .above import Above as Above
from .above import highest_declination as highest_declination
from .above import look_up as look_up
from .above import planetographic as planetographic
from .above import true_solar_time as true_solar_time
from .moments import day_of as day_of
from .moments import days_of as days_of
from .moments import read_time as read_time
from .moments import utc_text as utc_text
from .seeking import moment_of as moment_of
from .spec import SunSpec as SunSpec
