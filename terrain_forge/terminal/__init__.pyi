"""What a person meets on a terminal: lines, progress, statuses, what is installed, completion."""

from .completion import complete_exporters as complete_exporters
from .completion import complete_keys as complete_keys
from .completion import complete_recipes as complete_recipes
from .completion import complete_starters as complete_starters
from .completion import complete_terrain_models as complete_terrain_models
from .completion import completion_script as completion_script
from .display import Display as Display
from .display import watched as watched
from .doctor import doctor_lines as doctor_lines
from .lines import say as say
from .lines import show_log as show_log
from .mistaken import refuse_raster as refuse_raster
from .outcome import finish as finish
from .outcome import require_preview as require_preview
from .outcome import tell_build as tell_build
from .outcome import tell_exports as tell_exports
from .outcome import tell_preview as tell_preview
from .outcome import tell_recording as tell_recording
from .outcome import tell_validation as tell_validation
from .running import FAILED_CHECK as FAILED_CHECK
from .running import WRONG_INPUT as WRONG_INPUT
from .running import run_command as run_command
from .running import run_process as run_process
