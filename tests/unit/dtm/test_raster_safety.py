"""Reading a raster reaches neither the network nor files elsewhere."""

from __future__ import annotations

import os
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import numpy as np
import pytest
import rasterio
import scipy.io
from PIL import Image

from terrain_forge.base import DataError
from terrain_forge.dtm import open_dataset, read_image
from tests.helpers.command_line import run


@pytest.fixture(scope="module")
def server():
    """A server of this machine, and the requests that reached it."""
    asked: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_error(404)

        do_HEAD = do_POST = do_GET

        def log_message(self, *_):
            pass

    http = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=http.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{http.server_port}", asked
    http.shutdown()
    http.server_close()


VRT = """<VRTDataset rasterXSize="64" rasterYSize="64">
<VRTRasterBand dataType="Float32" band="1"><SimpleSource>
<SourceFilename relativeToVRT="0">NAME</SourceFilename><SourceBand>1</SourceBand>
</SimpleSource></VRTRasterBand></VRTDataset>"""
WMS = """<GDAL_WMS><Service name="TMS"><ServerUrl>HOST/${z}/${x}/${y}.png</ServerUrl></Service>
<DataWindow><UpperLeftX>-20037508</UpperLeftX><UpperLeftY>20037508</UpperLeftY>
<LowerRightX>20037508</LowerRightX><LowerRightY>-20037508</LowerRightY><TileLevel>3</TileLevel>
<TileCountX>1</TileCountX><TileCountY>1</TileCountY><YOrigin>top</YOrigin></DataWindow>
<BandsCount>1</BandsCount></GDAL_WMS>"""
ISIS = """Object = IsisCube
  Object = Core
    ^Core = "NAME"
    StartByte = 1
    Format = BandSequential
    Group = Dimensions
      Samples = 8
      Lines = 8
      Bands = 1
    End_Group
    Group = Pixels
      Type = UnsignedByte
      ByteOrder = Lsb
      Base = 0.0
      Multiplier = 1.0
    End_Group
  End_Object
End_Object
End
"""
PDS4 = """<Product_Observational xmlns="http://pds.nasa.gov/pds4/pds/v1">
<File_Area_Observational><File><file_name>NAME</file_name></File><Array_2D_Image>
<offset unit="byte">0</offset><axes>2</axes><axis_index_order>Last Index Fastest</axis_index_order>
<Element_Array><data_type>UnsignedByte</data_type></Element_Array>
<Axis_Array><axis_name>Line</axis_name><elements>8</elements><sequence_number>1</sequence_number>
</Axis_Array><Axis_Array><axis_name>Sample</axis_name><elements>8</elements>
<sequence_number>2</sequence_number></Axis_Array></Array_2D_Image></File_Area_Observational>
</Product_Observational>"""
PDS3 = """PDS_VERSION_ID = PDS3
^IMAGE = "NAME"
OBJECT = IMAGE
 LINES = 8
 LINE_SAMPLES = 8
 SAMPLE_TYPE = UNSIGNED_INTEGER
 SAMPLE_BITS = 8
END_OBJECT = IMAGE
END
"""


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.vrt", VRT), ("a.xml", WMS), ("a.cub", ISIS), ("a.xml", PDS4), ("a.lbl", PDS3)],
)
@pytest.mark.parametrize(
    "target", ["/vsicurl/HOST/a.img", "HOST/a.img", "../out.img", "ABSOLUTE", "beside.img"]
)
def test_no_request_and_no_file_elsewhere(tmp_path, server, name, text, target):
    host, asked = server
    folder = tmp_path / "in"
    folder.mkdir()
    for place in (tmp_path / "out.img", folder / "real.img"):
        place.write_bytes(bytes(range(64)))
    (folder / "beside.img").symlink_to(tmp_path / "out.img")
    target = target.replace("ABSOLUTE", str(tmp_path / "out.img"))
    path = folder / name
    path.write_text(text.replace("NAME", target).replace("HOST", host))
    with pytest.raises(DataError):
        read_image(name, folder, ("x",))
    recipe = folder / "r.yaml"
    recipe.write_text(
        f"schema: 1\nname: a\nbody: mars\n"
        f"dtm: {{source: {name}, size_m: [4, 4], extent_m: [8, 8]}}\n"
        "terrain: {spacing_m: 0.5}\nrocks: {library: {shapes: 1}, populations: []}\n"
    )
    for asked_for in (recipe, path):
        done = run("check", asked_for)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert asked == []


PAM = """<PAMDataset><Metadata domain="OVERVIEWS"><MDI key="OVERVIEW&#95;FILE">NAME</MDI></Metadata>
</PAMDataset>"""


@pytest.mark.parametrize(
    ("beside", "text", "complaint"),
    [
        ("a.tif.aux.xml", PAM, "as its overviews: remove OVERVIEW_FILE"),
        ("", "", "as its overviews: remove OVERVIEW_FILE"),
        ("a.tif.ovr", VRT, "a.tif.ovr beside a.tif is no TIFF: move it away"),
        ("A.TIF.OVR", WMS, "A.TIF.OVR beside a.tif is no TIFF: move it away"),
        ("a.tif.msk", VRT, "a.tif.msk beside a.tif is no TIFF: move it away"),
    ],
)
@pytest.mark.parametrize("target", ["/vsicurl/HOST/a.tif", "HOST/a.tif"])
def test_overviews_and_masks_reach_no_network(tmp_path, server, beside, text, complaint, target):
    host, asked = server
    target = target.replace("HOST", host)
    path = tmp_path / "a.tif"
    with rasterio.open(
        *(path, "w"), driver="GTiff", height=64, width=64, count=1, dtype="float32",
        crs="+proj=eqc +R=3396190 +units=m", transform=rasterio.Affine(1, 0, 8, 0, -1, 8),
    ) as file:  # fmt: skip
        file.write(np.zeros((1, 64, 64), np.float32))
        if not beside:
            file.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=target)
    if beside:
        (tmp_path / beside).write_text(text.replace("NAME", target).replace("HOST", host))
    done = run("check", path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert complaint in done.stderr
    with pytest.raises(DataError):
        read_image("a.tif", tmp_path, ("x",))
    assert asked == []


@pytest.mark.parametrize("kind", ["complex64", "complex128", "complex_int16"])
def test_complex_numbers_are_refused(tmp_path, kind):
    with rasterio.open(
        *(tmp_path / "a.tif", "w"), driver="GTiff", height=4, width=4, count=1, dtype=kind,
        transform=rasterio.Affine(1, 0, 8, 0, -1, 8),
    ):  # fmt: skip
        pass
    done = run("check", tmp_path / "a.tif")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "a.tif holds complex numbers" in done.stderr
    recipe = tmp_path / "r.yaml"
    recipe.write_text(
        "name: a\nbody: mars\ndtm: {source: a.tif, size_m: [4, 4]}\nterrain: {spacing_m: 0.5}\n"
    )
    done = run("check", recipe)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"{recipe}:3: dtm.source: a.tif holds complex numbers" in done.stderr


def test_a_raster_with_overviews_and_a_mask_beside_it_is_read(tmp_path):
    path = tmp_path / "a.tif"
    with rasterio.open(
        *(path, "w"), driver="GTiff", height=64, width=64, count=1, dtype="uint8",
        transform=rasterio.Affine(1, 0, 8, 0, -1, 8),
    ) as file:  # fmt: skip
        file.write(np.full((1, 64, 64), 255, np.uint8))
    with (
        rasterio.Env(TIFF_USE_OVR=True, GDAL_TIFF_INTERNAL_MASK=False),
        rasterio.open(path, "r+") as file,
    ):
        file.write_mask(np.full((64, 64), 255, np.uint8))
        file.build_overviews([2])
    assert {p.suffix for p in tmp_path.iterdir()} >= {".ovr", ".msk"}
    assert np.array_equal(read_image("a.tif", tmp_path, ("x",)), np.ones((64, 64)))


@pytest.mark.parametrize(("name", "text"), [("a.cub", ISIS), ("a.lbl", PDS3)])
def test_a_label_s_own_image_is_read(tmp_path, name, text):
    (tmp_path / "real.img").write_bytes(bytes(range(1, 65)))  # 0 is ISIS's null
    (tmp_path / name).write_text(text.replace("NAME", "real.img"))
    values = read_image(name, tmp_path, ("x",))
    assert np.array_equal(values[::-1].ravel() * 255, np.arange(1, 65))


def test_a_linked_raster_is_read(tmp_path):
    (tmp_path / "real").mkdir()
    Image.new("L", (2, 2), 255).save(tmp_path / "real" / "a.png")
    (tmp_path / "b.png").symlink_to(tmp_path / "real" / "a.png")
    assert np.array_equal(read_image("b.png", tmp_path, ("x",)), np.ones((2, 2)))


def test_what_names_files_by_links_of_its_own_is_not_opened(tmp_path):
    (tmp_path / "dem.tif").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 600)
    with pytest.raises(DataError, match=r"dem.tif is HDF5 \(or netCDF-4\), which can name any"):
        read_image("dem.tif", tmp_path, ("terrain",))


def test_classic_netcdf_is_read(tmp_path):
    with scipy.io.netcdf_file(tmp_path / "dem.nc", "w") as file:
        for name in ("y", "x"):
            file.createDimension(name, 8)
            file.createVariable(name, "f8", (name,))[:] = np.arange(8.0)
        file.createVariable("z", "f4", ("y", "x"))[:] = 7.0
    assert (read_image("dem.nc", tmp_path, ("terrain",)) == 7.0).all()


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="there is no such file here")
def test_a_file_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / "dem.tif").symlink_to("/proc/self/mem")
    with pytest.raises(DataError, match=r"^dem\.tif cannot be read: .*Input/output"):
        open_dataset(tmp_path / "dem.tif")


@pytest.mark.parametrize("name", ["a.prj", "a_metadata.txt", "METADATA.DIM", "a_RPC.TXT"])
def test_a_pipe_that_gdal_may_look_into_is_refused(tmp_path, name):
    Image.new("L", (2, 2)).save(tmp_path / "a.tif")
    os.mkfifo(tmp_path / name)
    with pytest.raises(DataError, match=f"^{name} beside a.tif is no regular file"):
        open_dataset(tmp_path / "a.tif")


def test_absurd_blocks_are_refused(tmp_path):
    path = tmp_path / "a.tif"
    rasterio.open(
        *(path, "w"), driver="GTiff", height=16384, width=16384, count=1, dtype="float32",
        tiled=True, blockxsize=16384, blockysize=16384, sparse_ok=True,
        transform=rasterio.Affine(1, 0, 8, 0, -1, 8),
    ).close()  # fmt: skip
    with pytest.raises(DataError, match="has blocks of 1,024 MiB, at most 256 MiB: cut it into"):
        open_dataset(path)


def test_absurd_sides_are_refused(tmp_path):
    (tmp_path / "a.xyz").write_text(
        "".join(f"{x} {y} 1\n" for y in (0, 1, 2000000) for x in (0, 1))
    )
    with pytest.raises(DataError, match=r"has 2 × 2,000,001 samples, at most 2,000,000 a side"):
        open_dataset(tmp_path / "a.xyz")


def _cut(path, part: float) -> None:
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])


@pytest.mark.parametrize("part", [0.98, 0.5])
@pytest.mark.parametrize("name", ["a.png", "a.tga"])
def test_a_picture_that_is_cut_off_is_refused(tmp_path, name, part):
    """Of a PNG of 8 bits GDAL would return what memory held."""
    values = np.random.default_rng(1).integers(0, 256, (64, 64), np.uint8)
    Image.fromarray(values).save(tmp_path / name)
    assert np.array_equal(read_image(name, tmp_path, ("x",))[::-1] * 255, values)
    _cut(tmp_path / name, part)
    with pytest.raises(DataError, match=f"^{name} (cannot be read|is cut off)"):
        read_image(name, tmp_path, ("x",))


@pytest.mark.parametrize("part", [0.999, 0.5])
def test_a_model_that_is_cut_off_is_refused(tmp_path, part):
    """GDAL would return zeros."""
    with rasterio.open(
        *(tmp_path / "a.img", "w"), driver="ENVI", height=64, width=64, count=1, dtype="float32",
        transform=rasterio.Affine(1, 0, 8, 0, -1, 8),
    ) as file:  # fmt: skip
        file.write(np.ones((1, 64, 64), np.float32))
    with scipy.io.netcdf_file(tmp_path / "a.nc", "w") as file:
        for name in ("y", "x"):
            file.createDimension(name, 64)
            file.createVariable(name, "f8", (name,))[:] = np.arange(64.0)
        file.createVariable("z", "f4", ("y", "x"))[:] = 7.0
    for name in ("a.img", "a.nc"):
        open_dataset(tmp_path / name).close()
        _cut(tmp_path / name, part)
        with pytest.raises(DataError, match=f"^{name} is cut off: it ends before its last sample"):
            open_dataset(tmp_path / name)
