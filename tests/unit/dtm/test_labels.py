"""What labels of PDS3, VICAR and ISIS 2 say: units, and which way longitudes count."""

from __future__ import annotations

from dataclasses import replace
from shutil import copyfile

import numpy as np
import pytest
import rasterio

from terrain_forge.base import DataError
from terrain_forge.dtm import RasterDtm
from terrain_forge.dtm.spec import Centre
from terrain_forge.model import MOON
from tests.helpers.places import SAMPLES
from tests.helpers.rasters import plan, words


def test_pds3_sample_with_detached_label():
    spec = RasterDtm(
        source="lola_ldem16_tranquillitatis.LBL",
        size_m=(20000.0, 20000.0),
        noise="keep",
        centre=Centre(lonlat_deg=(23.47297, 0.67408)),
    )
    site, _ = plan(SAMPLES, spec, body=MOON, spacing=500.0)
    assert site.datum_height == pytest.approx(-1930.0, abs=30.0)  # Tranquillity Base, LOLA
    with pytest.raises(DataError, match=r"name lola_ldem16_tranquillitatis.LBL"):
        plan(SAMPLES, replace(spec, source="lola_ldem16_tranquillitatis.IMG"), body=MOON)


@pytest.mark.parametrize(
    ("changes", "values"),
    [
        (
            {},
            "radius: value × 0.5 + 1737400 m from the body's centre; heights are taken above 1737",
        ),
        (
            {"= 0.5": "= 0.0005", "= 1737400.": "= 1737.4", "= METER": "= KILOMETER"},
            "value × 0.5 +",
        ),
        ({"= METER": "= DEGREE"}, "'DEGREE'"),
        ({"= METER": "= 'N/A'"}, "the file declares no unit: metres are assumed"),
        (
            {
                "UNIT                  = METER": "NOTE = none",
                "\nEND\r": "\nOBJECT = COLUMN\r\nUNIT = DEGREE\r\nEND_OBJECT = COLUMN\r\nEND\r",
            },
            "the file declares no unit: metres are assumed",
        ),
    ],
)
def test_the_unit_of_a_pds3_label_counts(changes, values, tmp_path):
    name = "lola_ldem16_tranquillitatis"
    label = (SAMPLES / f"{name}.LBL").read_bytes().decode("latin-1")
    for old, new in changes.items():
        assert old in label
        label = label.replace(old, new)
    (tmp_path / f"{name}.LBL").write_bytes(label.encode("latin-1"))
    copyfile(SAMPLES / f"{name}.IMG", tmp_path / f"{name}.IMG")
    spec = RasterDtm(source=f"{name}.LBL", size_m=(1.0, 1.0))
    text = words(tmp_path, spec, body=MOON)
    assert values in text
    assert ("assumed" in text) == ("assumed" in values)


@pytest.mark.parametrize(
    ("direction", "longitude"), [('"EAST"', 33.5625), ('"WEST"', 13.5625), ("west", 13.5625)]
)
def test_longitudes_of_a_pds3_label_count_as_it_says(direction, longitude, tmp_path):
    name = "lola_ldem16_tranquillitatis"
    label = (SAMPLES / f"{name}.LBL").read_text("latin-1")
    assert '"EAST"' in label
    assert "= 180 <deg>" in label
    label = label.replace('"EAST"', direction).replace("= 180 <deg>", "= 190 <deg>")
    (tmp_path / f"{name}.LBL").write_text(label, "latin-1")
    copyfile(SAMPLES / f"{name}.IMG", tmp_path / f"{name}.IMG")
    spec = RasterDtm(source=f"{name}.LBL", size_m=(20000.0, 20000.0))
    site, _ = plan(tmp_path, spec, body=MOON, spacing=500.0)
    assert np.degrees(site.lonlat[0]) == pytest.approx(longitude, abs=1e-3)


def test_longitudes_of_a_vicar_label_count_as_it_says(tmp_path):
    crs = "+proj=eqc +lat_ts=0 +lon_0=77 +R=1737400"
    with rasterio.open(
        tmp_path / "dtm.vic", "w", driver="VICAR", width=64, height=64, count=1, dtype="float32",
        crs=crs, transform=rasterio.Affine(2.0, 0.0, -64.0, 0.0, -2.0, 64.0),
    ) as file:  # fmt: skip
        file.write(np.zeros((1, 64, 64), np.float32))
    spec = RasterDtm(source="dtm.vic", size_m=(40.0, 40.0))
    for direction, longitude in ((b"'EAST'", 77.0), (b"'WEST'", -77.0)):
        label = (tmp_path / "dtm.vic").read_bytes()
        (tmp_path / "dtm.vic").write_bytes(label.replace(b"'EAST'", direction))
        site, _ = plan(tmp_path, spec, body=MOON, spacing=0.5)
        assert np.degrees(site.lonlat[0]) == pytest.approx(longitude, abs=1e-6)


ISIS2 = """PDS_VERSION_ID=PDS3
RECORD_BYTES=512
LABEL_RECORDS=4
^QUBE=5
OBJECT=QUBE
 AXES=3
 AXIS_NAME=(SAMPLE,LINE,BAND)
 CORE_ITEMS=(64,64,1)
 CORE_ITEM_TYPE=PC_REAL
 CORE_ITEM_BYTES=4
 CORE_BASE=0.0
 CORE_MULTIPLIER=1.0
 SUFFIX_BYTES=4
 SUFFIX_ITEMS=(0,0,0)
 GROUP=IMAGE_MAP_PROJECTION
  MAP_PROJECTION_TYPE=SINUSOIDAL
  MAP_SCALE=0.002
  CENTER_LATITUDE=0.0
  CENTER_LONGITUDE=100.0
  LINE_PROJECTION_OFFSET=-31.5
  SAMPLE_PROJECTION_OFFSET=-31.5
  A_AXIS_RADIUS=1737.4
  B_AXIS_RADIUS=1737.4
  C_AXIS_RADIUS=1737.4
  POSITIVE_LONGITUDE_DIRECTION=EAST
  COORDINATE_SYSTEM_NAME=PLANETOCENTRIC
 END_GROUP=IMAGE_MAP_PROJECTION
END_OBJECT=QUBE
END
"""


@pytest.mark.parametrize(("direction", "longitude"), [("EAST", 100.0), ("WEST", -100.0)])
def test_longitudes_of_an_isis2_label_count_as_it_says(direction, longitude, tmp_path):
    label = ISIS2.replace("EAST", direction).encode().ljust(2048)
    (tmp_path / "dtm.cub").write_bytes(label + bytes(4 * 64 * 64))
    spec = RasterDtm(source="dtm.cub", size_m=(40.0, 40.0))
    site, _ = plan(tmp_path, spec, body=MOON, spacing=0.5)
    assert np.degrees(site.lonlat[0]) == pytest.approx(longitude, abs=1e-3)
