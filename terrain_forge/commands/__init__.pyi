"""Commands of the command line that take more than a few lines."""

from .evaluating import evaluate as evaluate
from .studying import study as study
