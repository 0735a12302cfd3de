"""The report page of a built world."""

from .assessing import assess as assess
from .blocks import Block as Block
from .blocks import Cell as Cell
from .blocks import drawing as drawing
from .blocks import facts as facts
from .blocks import heading as heading
from .blocks import paragraph as paragraph
from .blocks import photograph as photograph
from .blocks import plot as plot
from .blocks import table as table
from .evaluated import MAP_STAGES as MAP_STAGES
from .evaluated import evaluate as evaluate
from .evaluated import evaluate_maps as evaluate_maps
from .evaluated import evaluate_stages as evaluate_stages
from .page import section_types as section_types
from .page import write_page as write_page
from .page import write_report_page as write_report_page
from .recorded.measures import picture_statistics as picture_statistics
from .renewal import renew_report_page as renew_report_page
from .section import Built as Built
from .section import Section as Section
