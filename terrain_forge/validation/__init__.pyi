"""Checking what was written with the programs that read it."""

from .checks import validate as validate
from .conformance.table import report_text as report_text
from .conformance.table import table_rows as table_rows
from .dynamic import MOST_WATCHED as MOST_WATCHED
