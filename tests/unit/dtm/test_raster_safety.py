"""Reading a raster reaches neither the network nor files elsewhere."""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
import pytest
from PIL import Image

from terrain_forge.base import DataError
from terrain_forge.dtm import read_image
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


@pytest.mark.parametrize(("name", "text"), [("a.cub", ISIS), ("a.lbl", PDS3)])
def test_a_label_s_own_image_is_read(tmp_path, name, text):
    (tmp_path / "real.img").write_bytes(bytes(range(64)))
    (tmp_path / name).write_text(text.replace("NAME", "real.img"))
    values = read_image(name, tmp_path, ("x",))
    assert np.array_equal(values[::-1].ravel() * 255, np.arange(64))


def test_a_linked_raster_is_read(tmp_path):
    (tmp_path / "real").mkdir()
    Image.new("L", (2, 2), 255).save(tmp_path / "real" / "a.png")
    (tmp_path / "b.png").symlink_to(tmp_path / "real" / "a.png")
    assert np.array_equal(read_image("b.png", tmp_path, ("x",)), np.ones((2, 2)))
