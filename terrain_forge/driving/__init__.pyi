"""Driving a rover over a world in MuJoCo."""

from .checks import Driven as Driven
from .checks import drive_json as drive_json
from .checks import drive_path as drive_path
from .checks import drive_starts as drive_starts
from .checks import rover_mass_check as rover_mass_check
from .checks import starts_json as starts_json
from .checks import write_drives as write_drives
from .controller import eased as eased
from .result import DriveResult as DriveResult
from .simulation import drive as drive
from .simulation import load_scene as load_scene
from .vehicle import Vehicle as Vehicle
