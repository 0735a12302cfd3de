"""Driving a rover over a world in MuJoCo."""

from .controller import TURN_RATE as TURN_RATE
from .controller import eased as eased
from .controller import wheel_rates as wheel_rates
from .files import stem as stem
from .files import write_figure as write_figure
from .files import write_starts_figure as write_starts_figure
from .files import write_starts_table as write_starts_table
from .files import write_tables as write_tables
from .film import write_end as write_end
from .film import write_film as write_film
from .log import DriveLog as DriveLog
from .log import Logger as Logger
from .result import DriveResult as DriveResult
from .simulation import ARRIVAL as ARRIVAL
from .simulation import drive as drive
from .simulation import load_scene as load_scene
from .starts import StartsResult as StartsResult
from .starts import drive_from_many_starts as drive_from_many_starts
from .vehicle import Vehicle as Vehicle
