"""A site that reaches beyond its raster: which key is told, and what fits."""

from __future__ import annotations

import re

import pytest
from rasterio.transform import Affine

from terrain_forge.base import DataError
from terrain_forge.dtm import RasterDtm, survey
from terrain_forge.dtm.spec import Centre
from terrain_forge.model import MARS
from tests.unit.dtm.test_dtm import write_raster


@pytest.fixture(scope="module", params=["north up", "turned"])
def raster(request, tmp_path_factory):
    """A file of 400 × 300 m."""
    where = Affine(1.0, 0.0, 5000.0, 0.0, -1.0, -272000.0)
    if request.param == "turned":
        where @= Affine.rotation(30.0)
    return write_raster(tmp_path_factory.mktemp("size") / "dtm.tif", transform=where)


def refused(raster, size, offset):
    """The key that is told, and the size that is said to fit [m]."""
    with pytest.raises(DataError) as error:
        look(raster, size, offset)
    told = re.search(r"; ([\d.]+) × ([\d.]+) m fit there$", str(error.value))
    return error.value.key, tuple(map(float, told.groups())) if told else None


def look(raster, size, offset):
    spec = RasterDtm(source=raster.name, size_m=size, centre=Centre(offset_m=offset), noise="keep")
    return survey(spec, body=MARS, folder=raster.parent, heights=None)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (50.0, -30.0)])
@pytest.mark.parametrize("size", [(4000.0, 4000.0), (4000.0, 40.0), (30.0, 800.0)])
def test_a_size_that_no_centre_holds_is_told_with_one_that_fits(raster, size, offset):
    key, fits = refused(raster, size, offset)
    assert key == ("dtm", "size_m")
    look(raster, fits, offset)
    with pytest.raises(DataError):
        look(raster, (fits[0] * 1.03, fits[1] * 1.03), offset)


def test_a_centre_too_near_to_the_edge_is_told_with_the_size_that_fits(raster):
    key, fits = refused(raster, (100.0, 100.0), (155.0, 60.0))
    assert key == ("dtm", "centre")
    look(raster, fits, (155.0, 60.0))


def test_a_centre_beyond_the_raster_has_no_size_that_fits(raster):
    assert refused(raster, (10.0, 10.0), (1000.0, 0.0)) == (("dtm", "centre"), None)


def test_what_fits_a_raster_of_few_metres(tmp_path):
    raster = write_raster(tmp_path / "dtm.tif", transform=Affine(0.01, 0, 0, 0, -0.01, 0))
    _, fits = refused(raster, (9.0, 9.0), (0.0, 0.0))
    assert fits == pytest.approx((4.0, 3.0), rel=0.01)
