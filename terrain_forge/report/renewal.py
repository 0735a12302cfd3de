"""The page of a built world, written anew alone: a recording has something to show."""

from __future__ import annotations

import logging
from pathlib import Path

from terrain_forge.building import (
    altered_files,
    exports_in,
    foreign_files,
    read_manifest,
    require_listed,
    updating,
    write_manifest,
)
from terrain_forge.model import World
from terrain_forge.recording import dataset_folder
from terrain_forge.report.page import write_report_page

_log = logging.getLogger(__name__)


def renew_report_page(world: World, out: Path, *, force: bool = False) -> None:
    """Write `out`/report.html anew, and nothing else of the world but its manifest.

    What is amiss with page or folder is no reason to lose a recording: it is told in a line, and
    the older page stays; so does one that was edited, unless by force.
    """
    try:
        manifest = read_manifest(out)
        foreign, altered = foreign_files(out, manifest), altered_files(out, manifest)
        require_listed(out, manifest, also=("report.html",), force=force)
        altered.pop("report.html", None)
        exports = exports_in(manifest)
        with updating(out, foreign=foreign) as fresh:
            write_report_page(world, fresh, exports=exports, dataset=dataset_folder(out))
            write_manifest(world.site, fresh, exports=exports, known=altered, foreign=foreign)
    except Exception as error:
        why = " ".join(str(error).split())[:300] or type(error).__name__
        _log.warning("recorded, but the report page is not written anew: %s", why)
