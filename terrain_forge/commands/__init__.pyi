"""Commands of the command line that take more than a few lines."""

from .cutting import cut as cut
from .evaluating import evaluate as evaluate
from .illuminating import illumination as illumination
from .studying import study as study
from .varying import make_worlds as make_worlds
