"""The report page of a built world."""

from .page import write_report_page as write_report_page
from .section import take_map as take_map
