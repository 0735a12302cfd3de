"""A web server on the loopback that misbehaves as told, and products in miniature."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import ceil

import numpy as np

METRES_PER_DEGREE = np.pi / 180.0 * 3396190.0

LABEL = """PDS_VERSION_ID            = PDS3
RECORD_TYPE               = FIXED_LENGTH
RECORD_BYTES              = {record}
FILE_RECORDS              = {records}
^IMAGE                    = {image}
DATA_SET_ID               = "MRO-M-HIRISE-5-DTM-V1.0"
PRODUCT_ID                = "{name}"
INSTRUMENT_ID             = "HIRISE"
TARGET_NAME               = MARS
OBJECT = IMAGE
  LINES            = {lines}
  LINE_SAMPLES     = {samples}
  BANDS            = 1
  OFFSET           = 0.0
  SCALING_FACTOR   = 1.0
  SAMPLE_BITS      = 32
  SAMPLE_BIT_MASK  = 2#11111111111111111111111111111111#
  SAMPLE_TYPE      = PC_REAL
  MISSING_CONSTANT = 16#FF7FFFFB#
END_OBJECT = IMAGE
OBJECT = IMAGE_MAP_PROJECTION
  ^DATA_SET_MAP_PROJECTION     = "DSMAP.CAT"
  MAP_PROJECTION_TYPE          = "EQUIRECTANGULAR"
  PROJECTION_LATITUDE_TYPE     = PLANETOCENTRIC
  A_AXIS_RADIUS                = 3396.19 <KM>
  B_AXIS_RADIUS                = 3396.19 <KM>
  C_AXIS_RADIUS                = 3396.19 <KM>
  COORDINATE_SYSTEM_NAME       = PLANETOCENTRIC
  POSITIVE_LONGITUDE_DIRECTION = EAST
  KEYWORD_LATITUDE_TYPE        = PLANETOCENTRIC
  CENTER_LATITUDE              = 0.0 <DEG>
  CENTER_LONGITUDE             = 137.49 <DEG>
  LINE_FIRST_PIXEL             = 1
  LINE_LAST_PIXEL              = {lines}
  SAMPLE_FIRST_PIXEL           = 1
  SAMPLE_LAST_PIXEL            = {samples}
  MAP_PROJECTION_ROTATION      = 0.0 <DEG>
  MAP_RESOLUTION               = 58585.55467457 <PIX/DEG>
  MAP_SCALE                    = 1.0117630165416 <METERS/PIXEL>
  LINE_PROJECTION_OFFSET       = {down} <PIXEL>
  SAMPLE_PROJECTION_OFFSET     = {across} <PIXEL>
END_OBJECT = IMAGE_MAP_PROJECTION
END
"""
"""Label of DTEEC_023957_1755_024023_1755_U01, less what nobody reads."""


def hirise(name: str, *, lonlat: tuple[float, float], shape: tuple[int, int] = (320, 280)) -> bytes:
    """A HiRISE DTM in miniature around a place: an attached label, then heights [m]."""
    lines, samples = shape
    step = 1.0117630165416
    across = (137.49 - lonlat[0]) * METRES_PER_DEGREE / step + samples / 2
    down = lonlat[1] * METRES_PER_DEGREE / step + lines / 2
    record = 4 * samples
    begin = ceil(2 * len(LABEL) / record)
    label = LABEL.format(
        name=name,
        record=record,
        records=begin + lines,
        image=begin + 1,
        lines=lines,
        samples=samples,
        across=round(across) + 0.5,
        down=round(down) + 0.5,
    )
    rng = np.random.default_rng(4)
    rough = np.cumsum(np.cumsum(rng.normal(0.0, 0.002, shape), axis=0), axis=1)
    heights = (rough - 4500.0).astype("<f4")
    return label.replace("\n", "\r\n").encode().ljust(begin * record) + heights.tobytes()


@dataclass
class File:
    """What lies at an address, and how the server serves it."""

    data: bytes = b""
    status: int = 200
    tag: str = '"one"'
    ranges: bool = True
    breaks_after: int | None = None
    """Bytes of a body after which the connection ends, once."""
    hangs: bool = False
    moved_to: str = ""
    claims: int | str | None = None
    """Size that it tells instead of the real one."""
    lasts: int | None = None
    """Requests after which another file is there."""
    then: File | None = None
    """That file."""


@dataclass
class Site:
    """A running server."""

    address: str
    files: dict[str, File] = field(default_factory=dict)
    asked: list[tuple[str, str]] = field(default_factory=list)
    """Path and range of each request."""
    released: threading.Event = field(default_factory=threading.Event)

    def put(self, path: str, file: File | bytes) -> str:
        """Serve a file; returns its address."""
        self.files[path] = File(data=file) if isinstance(file, bytes) else file
        return f"{self.address}{path}"


@contextmanager
def served() -> Iterator[Site]:
    """A server on a free port of the loopback, until the end of the block."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_HEAD(self) -> None:
            self._answer(body=False)

        def do_GET(self) -> None:
            self._answer(body=True)

        def _answer(self, *, body: bool) -> None:
            wanted = self.headers.get("Range", "")
            site.asked.append((self.path, wanted))
            file = site.files.get(self.path, File(status=404))
            if file.lasts == 0 and file.then:
                file = site.files[self.path] = file.then
            if file.lasts:
                file.lasts -= 1
            if file.hangs:
                site.released.wait(10.0)
                self.close_connection = True
                return
            status, data = file.status, file.data if file.status == 200 else b"no"
            headers = {"ETag": file.tag} if file.tag else {}
            if file.moved_to:
                status, data, headers = 302, b"", {"Location": file.moved_to}
            same = self.headers.get("If-Range", file.tag) == file.tag
            if status == 200 and wanted and file.ranges and same:
                first, _, last = wanted.removeprefix("bytes=").partition("-")
                whole = len(data)
                end = min(int(last or whole - 1), whole - 1)
                headers["Content-Range"] = f"bytes {first}-{end}/{file.claims or whole}"
                status, data = 206, data[int(first) : end + 1]
                size = len(data)
            else:
                size = file.claims or len(data)
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(size))
            self.end_headers()
            if not body:
                return
            if file.breaks_after is not None and len(data) > file.breaks_after:
                data, file.breaks_after = data[: file.breaks_after], None
                self.close_connection = True
            self.close_connection |= file.claims is not None
            self.wfile.write(data)

        def log_message(self, *_: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: object) -> None:
            """A client that hangs up is no error here."""

    server = Server(("127.0.0.1", 0), Handler)
    site = Site(address=f"http://127.0.0.1:{server.server_port}")
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield site
    finally:
        site.released.set()
        server.shutdown()
        server.server_close()
        thread.join()
