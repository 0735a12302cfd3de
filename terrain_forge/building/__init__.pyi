"""The output folder: written whole, re-exported, with its manifest."""

from .checking import check_raster as check_raster
from .checking import dtm_lines as dtm_lines
from .checking import fetch_lines as fetch_lines
from .checking import site_lines as site_lines
from .cost import pace as pace
from .cost import stage_seconds as stage_seconds
from .manifest import FolderState as FolderState
from .manifest import blaming as blaming
from .manifest import exports_in as exports_in
from .manifest import folder_state as folder_state
from .manifest import read_manifest as read_manifest
from .manifest import write_manifest as write_manifest
from .re_export import chosen_exports as chosen_exports
from .re_export import re_export_orders as re_export_orders
from .re_export import require_readable_recipe as require_readable_recipe
from .staging import finish as finish
from .staging import holding as holding
from .staging import replacing as replacing
from .staging import require_apart as require_apart
from .staging import require_listed as require_listed
from .staging import require_ours as require_ours
from .staging import updating as updating
from .writing import BuildResult as BuildResult
from .writing import write_export as write_export
from .writing import write_files as write_files
