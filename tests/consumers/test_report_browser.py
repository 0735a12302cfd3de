"""The report page in a real browser: it draws, says nothing on its console, fits a phone."""

import json
import re
import shutil
import subprocess
from base64 import b64encode
from hashlib import sha256

import numpy as np
import pytest
from PIL import Image

from tests.helpers import worlds
from tests.helpers.recordings import write_recording
from tests.unit.report.test_report_model import boxy_rover
from tests.unit.report.test_report_page import CHECKS

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = [
    "--headless", "--no-sandbox", "--hide-scrollbars", "--no-first-run", "--disable-quic",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--enable-logging=stderr",
]  # fmt: skip
BUDGETS = 100_000, 1_000_000, 10_000_000
"""How long a page has in the browser's own time [ms], which on a busy machine runs ahead of what
the page unpacks beside it."""
# A frame, since a headless window is never narrower than 500 pixels.
FRAME = """<iframe src="%s" style="width: %dpx; height: 800px; border: 0"></iframe>
<script>onmessage = (event) => { document.title = event.data; };</script>
"""
NAME = 64 * "w"
LONG = f"""<section><p>From above <span class="key">path {NAME}</span></p>
<dl class="facts"><div><dt>Path {NAME}: largest tilt</dt><dd>12.25°</dd></div></dl>
<div class="wide"><table><tr><td id="named">{NAME}</td><td class="num">12.25 m</td></tr>
</table></div></section>
"""
"""A path of the longest name, where pages have one."""
PROBE = """
addEventListener("load", () => setTimeout(() => {
  const wide = document.documentElement.scrollWidth;
  const small = [...document.querySelectorAll("body *")].filter((part) => part.innerText &&
    parseFloat(getComputedStyle(part).fontSize) < 12).length;
  const named = document.getElementById("named").getBoundingClientRect().width;
  parent.postMessage(JSON.stringify({wide, window: innerWidth, small, named}), "*");
}, 3000));
"""

pytestmark = [
    pytest.mark.consumer,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    from terrain_forge.report import write_report_page
    from terrain_forge.writers import write_png

    folder = tmp_path_factory.mktemp("OUT")
    (folder / "validation").mkdir()
    (folder / "validation" / "report.json").write_text(json.dumps({"checks": CHECKS}))
    write_png(folder / "validation" / "drive.png", np.zeros((300, 600, 3), np.uint8))
    write_recording(folder / "dataset", extras=True)
    return write_report_page(worlds.world(rover=boxy_rover()), folder)


def browse(page, profile, *flags, budget=BUDGETS[0]):
    """What the browser writes, and what pages have said on its console."""
    own = f"--virtual-time-budget={budget}", f"--user-data-dir={profile}"
    command = [BROWSER, *FLAGS, *own, *flags, page.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    return run.stdout, [line for line in run.stderr.splitlines() if "CONSOLE" in line]


def changed(page, old, new):
    """The page beside itself with something else in it."""
    text = page.read_text(encoding="utf-8")
    assert old in text
    other = page.with_name(f"other_{abs(hash(new)) % 10**8}.html")
    other.write_text(text.replace(old, new, 1), encoding="utf-8")
    return other


def test_the_view_is_drawn_in_silence(page, tmp_path):
    drawn = re.compile(r'<figure id="view"[^>]* class="drawn"')
    for budget in BUDGETS:
        shown, said = browse(page, tmp_path, "--dump-dom", budget=budget)
        assert said == []
        if drawn.search(shown):
            return
    pytest.fail("nothing is drawn")


def test_the_view_has_a_world_in_it(page, tmp_path):
    alone = "<style>body > :not(#in-3-d) { display: none !important; }</style></head>"
    picture = tmp_path / "view.png"
    flags = ["--window-size=900,760", f"--screenshot={picture}"]
    browse(changed(page, "</head>", alone), tmp_path / "profile", *flags)
    with Image.open(picture) as image:
        middle = np.asarray(image.convert("RGB"))[200:500, 250:650].astype(int)
    ground = np.array((166, 110, 74))
    assert middle.std(axis=(0, 1)).min() > 5.0
    # The ground's colour, which is more red than blue, is what most of it shows.
    assert np.median(middle[..., 0] - middle[..., 2]) > 0.4 * (ground[0] - ground[2])


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_window_or_too_small_to_read(page, tmp_path, width):
    page = changed(page, "</footer>", f"</footer>{LONG}")
    allowed = f"script-src 'sha256-{b64encode(sha256(PROBE.encode()).digest()).decode()}' "
    probed = changed(page, "script-src ", allowed)
    probed = changed(probed, "</head>", f"<script>{PROBE}</script></head>")
    frame = tmp_path / "frame.html"
    frame.write_text(FRAME % (probed.as_uri(), width), encoding="utf-8")
    shown, said = browse(frame, tmp_path / "profile", "--window-size=1400,900", "--dump-dom")
    assert said == []
    found = json.loads(re.search(r"<title>(.*?)</title>", shown)[1])
    assert found["window"] == width
    assert found["wide"] <= width
    assert found["small"] == 0
    assert found["named"] < 0.8 * width  # of a table, what stands beside a name is seen


def test_a_foreign_picture_is_refused_and_seen_on_the_console(page, tmp_path):
    """So silence means that nothing was asked of a network."""
    foreign = '<body><img src="https://example.org/picture.png" alt="">'
    _, said = browse(changed(page, "<body>", foreign), tmp_path, "--dump-dom")
    assert len(said) == 1
    assert "Content Security Policy" in said[0]


def test_without_webgl_the_page_says_so(page, tmp_path):
    shown, said = browse(page, tmp_path, "--dump-dom", "--disable-3d-apis")
    assert said == []
    assert "This browser does not draw in 3-D" in shown
    assert 'class="drawn"' not in shown
