"""Where Sun and Earth stand by date, and what the sky looks like."""

from .above import Above as Above
from .above import highest_declination as highest_declination
from .above import look_up as look_up
from .above import planetographic as planetographic
from .above import true_solar_time as true_solar_time
from .above import widest_sun as widest_sun
from .dust import SKY_STEPS as SKY_STEPS
from .dust import Daylight as Daylight
from .dust import beam as beam
from .dust import daylight as daylight
from .heavens import Disc as Disc
from .heavens import earth_disc as earth_disc
from .heavens import sky_points as sky_points
from .moments import day_of as day_of
from .moments import days_of as days_of
from .moments import read_time as read_time
from .moments import utc_text as utc_text
from .seeking import moment_of as moment_of
from .spec import SkySpec as SkySpec
from .spec import SunSpec as SunSpec
