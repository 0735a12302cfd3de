"""Terrain models by name and address, from a server on the loopback that misbehaves."""

from __future__ import annotations

import json
import signal
from contextlib import suppress

import numpy as np
import pytest
import requests

import terrain_forge as tf
from terrain_forge.base import DataError, RecipeError, StorageError, listen_for_interrupts
from terrain_forge.building import write_manifest
from terrain_forge.dtm import RasterDtm, download, expanded, fetch_product
from terrain_forge.dtm.download import CHUNK
from terrain_forge.dtm.places import places
from terrain_forge.dtm.products import find_product, table
from terrain_forge.report import Built
from terrain_forge.report.sections.summary import Summary
from tests.helpers import worlds
from tests.helpers.command_line import run
from tests.helpers.web import File, hirise

GALE = places()["gale"]
PATH = (
    "/ESP/ORB_023900_023999/ESP_023957_1755_ESP_024023_1755/DTEEC_023957_1755_024023_1755_U01.IMG"
)
DTM = hirise(GALE.product, lonlat=GALE.lonlat_deg)
RECIPE = """schema: 1
name: gale
body: mars
dtm: {place: gale, size_m: [24, 16], noise: keep}
terrain: {spacing_m: 0.5}
exports: []
"""


@pytest.mark.parametrize(
    ("name", "url"),
    [
        (
            "DTEEC_045994_1985_046060_1985_U01",
            "https://hirise-pds.lpl.arizona.edu/PDS/DTM/ESP/ORB_045900_045999/"
            "ESP_045994_1985_ESP_046060_1985/DTEEC_045994_1985_046060_1985_U01.IMG",
        ),
        (
            "DTEEC_001336_1560_001534_1560_U01",
            "https://hirise-pds.lpl.arizona.edu/PDS/DTM/PSP/ORB_001300_001399/"
            "PSP_001336_1560_PSP_001534_1560/DTEEC_001336_1560_001534_1560_U01.IMG",
        ),
        (
            "DTEEC_010228_1490_016320_1490_A01",
            "https://hirise-pds.lpl.arizona.edu/PDS/DTM/PSP/ORB_010200_010299/"
            "PSP_010228_1490_ESP_016320_1490/DTEEC_010228_1490_016320_1490_A01.IMG",
        ),
        (
            "DTEED_042328_1985_033150_1985_A01",
            "https://hirise-pds.lpl.arizona.edu/PDS/DTM/ESP/ORB_042300_042399/"
            "ESP_042328_1985_ESP_033150_1985/DTEED_042328_1985_033150_1985_A01.IMG",
        ),
        (
            "LOLA_5m_Site23",
            "https://pgda.gsfc.nasa.gov/data/LOLA_5mpp/Site23/Site23_final_adj_5mpp_surf.tif",
        ),
        (
            "NAC_DTM_APOLLO15",
            "https://pds.lroc.im-ldi.com/data/LRO-L-LROC-5-RDR-V1.0/LROLRC_2001/DATA/SDP/NAC_DTM/"
            "APOLLO15/NAC_DTM_APOLLO15.TIF",
        ),
    ],
)
def test_rules_give_addresses_of_the_archives(name, url):
    """As users of these archives write them down."""
    assert find_product(name).url == url


def test_names_that_nobody_has():
    with pytest.raises(RecipeError, match=r"did you mean .LOLA_5m_Haworth.\?"):
        find_product("LOLA_5m_Hawort")
    with pytest.raises(RecipeError, match=r"did you mean .jezero"):
        expanded(RasterDtm(place="jezzero", size_m=(10.0, 10.0)))
    with pytest.raises(RecipeError, match="one of source, product, place, url, found none"):
        expanded(RasterDtm(size_m=(10.0, 10.0)))
    with pytest.raises(RecipeError, match="found source and url"):
        expanded(RasterDtm(source="a", url="https://b/c", size_m=(10.0, 10.0)))


def test_no_two_products_have_one_file_in_the_cache():
    files = [product.url.rpartition("/")[2] for product in table().values()]
    assert len(files) == len(set(files))


def test_every_place_is_shown_by_a_product_of_its_body():
    for name in (*(one.product for one in places().values()), *table()):
        product = find_product(name)
        assert product.body in ("mars", "moon")
        assert product.url.startswith("https://")
        assert product.licence
        assert product.citation
    told = run("sites")
    assert told.returncode == 0
    assert all(f"{name} " in told.stdout for name in (*places(), *table()))


def test_a_place_is_fetched_once_and_cited(web, tmp_path, caplog):
    web.put(PATH, DTM)
    (tmp_path / "gale.yaml").write_text(RECIPE)
    site = tf.plan(tmp_path / "gale.yaml")
    assert "362 kB from 127.0.0.1; public domain" in caplog.text
    assert np.degrees(site.lonlat) == pytest.approx(GALE.lonlat_deg)
    manifest = json.loads(write_manifest(site, tmp_path, exports=()).read_text())
    assert manifest["origins"][GALE.product]["url"] == web.address + PATH
    record = json.loads((tmp_path / "cache" / "dtm" / f"{GALE.product}.IMG.json").read_text())
    assert manifest["inputs"] == {GALE.product: record["sha256"]}
    summary = Summary().blocks(Built(worlds.world().replace(site=site), tmp_path))[0]
    for cited in (manifest["origins"][GALE.product]["citation"], repr(summary)):
        assert "doi:10.1029/2007JE003000" in cited

    dtm = manifest["recipe"]["dtm"]
    assert (dtm["product"], dtm["source"], dtm["place"]) == (GALE.product, None, None)
    asked = len(web.asked)
    assert tf.plan(site.recipe) == site  # as saved, from the cache alone
    assert len(web.asked) == asked


def test_check_asks_no_server(web, tmp_path):
    (tmp_path / "gale.yaml").write_text(RECIPE)
    told = run("check", tmp_path / "gale.yaml")
    assert told.returncode == 0
    assert (
        "a build would download 0.04 to 1 GB, which its server tells, from 127.0.0.1" in told.stdout
    )
    assert "citation" in told.stdout
    path = tmp_path / "moon.yaml"
    path.write_text(RECIPE.replace("mars", "moon").replace("gale, s", "oxia_planum, s"))
    told = run("check", path)
    assert (told.returncode, told.stderr) == (
        2,
        f"terrain-forge: {path}:3: body: HRSC_MOLA_200m is of body: mars\n",
    )
    path.write_text(RECIPE.replace("gale, s", "oxia_planum, s"))
    assert "the site's part of 11.4 GB from planetarymaps.usgs.gov" in run("check", path).stdout
    assert web.asked == []


def test_fetch_by_name_and_by_recipe(web, tmp_path, monkeypatch):
    web.put(PATH, DTM)
    (tmp_path / "gale.yaml").write_text(RECIPE)
    monkeypatch.setenv("TERRAIN_FORGE_OFFLINE", "1")
    told = run("build", tmp_path / "gale.yaml", "-o", tmp_path / "world")
    assert told.returncode == 2
    assert f"terrain-forge fetch {GALE.product}" in told.stderr
    assert told.stderr.count("\n") == 1
    assert web.asked == []
    monkeypatch.delenv("TERRAIN_FORGE_OFFLINE")
    assert "all 11.4 GB" in run("fetch", "oxia_planum").stderr
    told = run("fetch", "gale", tmp_path / "gale.yaml")
    assert told.returncode == 0, told.stderr
    kept = tmp_path / "cache" / "dtm" / f"{GALE.product}.IMG"
    assert told.stdout == f"gale: {kept}\n{tmp_path / 'gale.yaml'}: {kept}\n"
    assert kept.read_bytes() == DTM
    monkeypatch.setenv("TERRAIN_FORGE_OFFLINE", "1")
    assert run("check", tmp_path / "gale.yaml").returncode == 0


@pytest.mark.parametrize("command", ["build", "preview"])
def test_what_cannot_be_fetched_is_told_before_kernels_are_compiled(
    web, tmp_path, monkeypatch, command
):
    (tmp_path / "gale.yaml").write_text(RECIPE)
    monkeypatch.setenv("TERRAIN_FORGE_OFFLINE", "1")
    for place in ("terrain_forge.base.compile_ahead", "terrain_forge.pipeline.compile_ahead"):
        monkeypatch.setattr(place, lambda progress: pytest.fail("kernels were compiled"))
    told = run(command, tmp_path / "gale.yaml", "-o", tmp_path / "out.png")
    assert told.returncode == 2
    assert f"terrain-forge fetch {GALE.product}" in told.stderr


def test_a_broken_transfer_goes_on(web):
    file = File(data=DTM, breaks_after=100_000)
    web.put(PATH, file)
    shares = []
    path = fetch_product(GALE.product, progress=lambda stage, share: shares.append(share))
    assert path.read_bytes() == DTM
    assert [asked for _, asked in web.asked] == ["bytes=0-0", "", f"bytes={CHUNK}-"]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert [one.name for one in path.parent.iterdir() if one.suffix == ".part"] == []


def test_a_part_is_kept_for_the_next_run_and_only_for_the_same_content(web, monkeypatch):
    monkeypatch.setattr("terrain_forge.dtm.download.TRIES", 1)
    web.put(PATH, File(data=DTM, claims=len(DTM) + 5))
    with pytest.raises(DataError, match=r"broke off .* what is there is kept"):
        fetch_product(GALE.product)
    web.put(PATH, File(data=DTM + b"\r\n\r\n ", claims=None))
    path = fetch_product(GALE.product)
    assert web.asked[-1] == (PATH, f"bytes={len(DTM)}-")
    assert path.read_bytes() == DTM + b"\r\n\r\n "


@pytest.mark.parametrize(("file", "next_one"), [({}, "goes on"), ({"tag": ""}, "begins anew")])
def test_an_interrupt_tells_what_is_kept(web, file, next_one):
    def interrupt(stage, share):
        raise KeyboardInterrupt

    web.put(PATH, File(data=DTM, **file))
    told = f"^65.5 kB of 36. kB of {GALE.product} came: .* {next_one}"
    with pytest.raises(KeyboardInterrupt, match=told):
        fetch_product(GALE.product, progress=interrupt)
    assert fetch_product(GALE.product).read_bytes() == DTM
    assert web.asked[-1][1] == (f"bytes={CHUNK}-" if next_one == "goes on" else "")


def test_an_interrupt_that_an_import_dropped_is_told_before_a_server_is_asked(web):
    url = web.put("/dem.tif", File(data=DTM))
    with listen_for_interrupts():
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            download.ask(url, "dem", wish="dem")
    assert web.asked == []


def test_a_server_without_pieces_or_tags(web):
    web.put(PATH, File(data=DTM, ranges=False, tag=""))
    assert fetch_product(GALE.product).read_bytes() == DTM


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (File(status=404), "127.0.0.1 says 404 Not Found"),
        (File(status=500), "127.0.0.1 says 500 Internal Server Error"),
        (File(hangs=True), "cannot be had from 127.0.0.1: .*timed? ?out"),
        (File(moved_to="file:///etc/passwd"), "cannot be had .*file:///etc/passwd"),
        (File(data=b"<!DOCTYPE html>" * 9), "is no raster, it begins b'<!DOCTYPE html>"),
        (File(data=DTM[:-2000]), r"has 359,\d+ bytes, its label counts 36\d,\d+"),
        (File(data=DTM.replace(b"_U01", b"_U02")), "calls itself DTEEC_.*_U02 in its label"),
        (
            File(data=DTM, claims=2**40),
            "tells 1099511627776 bytes as the size of .*, must be 1 B to",
        ),
        (File(data=DTM.replace(b"3396.19", b"1737.40")), "lies on a body of 1737 km radius"),
    ],
    ids=["404", "500", "hang", "file", "page", "short", "label", "huge", "body"],
)
def test_what_is_not_the_product_is_not_kept(web, tmp_path, monkeypatch, file, message):
    if file.hangs:
        monkeypatch.setattr("terrain_forge.dtm.download.TIMEOUT", (0.2, 0.2))
    web.put(PATH, file)
    with pytest.raises(DataError, match=message) as caught:
        fetch_product(GALE.product)
    assert "\n" not in str(caught.value)
    assert [one.name for one in (tmp_path / "cache").rglob("*") if one.is_file()] == []


def test_content_that_changes_while_it_is_fetched(web):
    then = File(data=DTM, tag='"two"')
    web.put(PATH, File(data=DTM, breaks_after=100_000, lasts=2, then=then))
    with pytest.raises(DataError, match="changed at its server while it was fetched"):
        fetch_product(GALE.product)
    assert fetch_product(GALE.product).read_bytes() == DTM
    assert web.asked[-1] == (PATH, "")  # from its beginning


def test_the_hash_of_first_sight_holds(web):
    web.put(PATH, DTM)
    path = fetch_product(GALE.product)
    with path.open("r+b") as file:
        file.seek(-1, 2)
        file.write(b"\x7f")
    with pytest.raises(DataError, match=f"{path} is not as it was fetched.*terrain-forge fetch"):
        fetch_product(GALE.product)
    path.unlink()
    web.put(PATH, File(data=DTM[:-1] + b"\x7f", tag='"two"'))
    with pytest.raises(
        DataError, match=r"another file at 127\.0\.0\.1 than it was when it was first"
    ):
        fetch_product(GALE.product)
    assert not path.exists()


def test_a_file_that_the_user_puts_into_the_cache(web, tmp_path):
    path = tmp_path / "cache" / "dtm" / f"{GALE.product}.IMG"
    path.parent.mkdir(parents=True)
    path.write_bytes(DTM)
    assert fetch_product(GALE.product) == path
    assert web.asked == []


def test_no_room(web, monkeypatch):
    web.put(PATH, DTM)
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Disk", (), {"free": 10}))
    with pytest.raises(StorageError, match=r"no room for the 362 kB of DTEEC"):
        fetch_product(GALE.product)


@pytest.mark.parametrize(
    "url",
    ["file:///etc/passwd", "ftp://a/b", "https://me:word@a/b", "/vsicurl/http://a", "http://"],
)
def test_addresses_that_are_none(tmp_path, url):
    (tmp_path / "a.yaml").write_text(RECIPE.replace("place: gale", f"url: '{url}'"))
    with pytest.raises(RecipeError, match=r"a.yaml:4: dtm.url"):
        tf.load_recipe(tmp_path / "a.yaml")


def test_a_server_that_is_not_reached_may_mean_offline(monkeypatch):
    def unreachable(*_, **__):
        raise requests.ConnectionError("Failed to resolve")

    monkeypatch.delenv(download.OFFLINE, raising=False)
    monkeypatch.setattr(requests.Session, "get", unreachable)
    with pytest.raises(DataError, match=r"dem cannot be had: x.org is not reached.*Offline.*copy"):
        download.ask("https://x.org/dem.tif", "dem", wish="dem")


def test_a_server_that_hangs_up_is_not_called_out_of_reach(web, monkeypatch):
    monkeypatch.delenv(download.OFFLINE, raising=False)
    web.released.set()
    url = web.put("/dem.tif", File(hangs=True))
    with pytest.raises(DataError, match=r"^dem cannot be had from 127.0.0.1: .*closed connection"):
        download.ask(url, "dem", wish="dem")


@pytest.mark.parametrize(
    ("size", "told"), [("*", "nothing"), ("-1", "-1 bytes"), ("9" * 5000, "9{40} bytes")]
)
def test_a_size_that_is_none_is_told(web, monkeypatch, size, told):
    monkeypatch.delenv(download.OFFLINE, raising=False)
    url = web.put("/dem.tif", File(data=DTM, claims=size))
    with pytest.raises(DataError, match=f"tells {told} as the size of dem, must be 1 B to 64 GiB$"):
        download.ask(url, "dem", wish="dem")
