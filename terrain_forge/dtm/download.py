"""Files from web servers: fetched once into the cache, a broken transfer taken up again, verified.

Beside each file lies its record: address, size, SHA-256 as it was first seen. What is found later,
in the cache or at the server, must be the same.
"""

from __future__ import annotations

import fcntl
import json
import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from shlex import quote
from typing import Any
from urllib.parse import urlsplit

from terrain_forge.base import (
    DataError,
    Progress,
    StorageError,
    ask_for_interrupt,
    cache_folder,
    read_text,
    size_text,
    telling_interrupts,
)

TIMEOUT = (15.0, 60.0)
"""How long a server may take to be reached, and to send something [s]."""
MOST = 64 * 2**30
"""Bytes of a file."""
OFFLINE = "TERRAIN_FORGE_OFFLINE"
"""Environment variable that, if set, forbids the network."""
TRIES = 3
"""Breaks of a transfer in a row, without a byte between them, after which it is given up."""
CHUNK = 2**16
"""Bytes that are written at once; what came of the next ones is lost where a transfer breaks."""
_MOST_RECORD = 2**20
_KEY = ("dtm",)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a server says of a file."""

    url: str
    """Where it lies, redirections followed."""
    size: int
    """Bytes."""
    tag: str
    """What changes with its content: an ETag or a date; empty if the server tells none."""
    in_pieces: bool
    """Whether it sends pieces."""


def place_in_cache(name: str) -> Path:
    """Where a file of that name is kept.

    Raises:
        DataError: if the user keeps no cache.
    """
    folder = cache_folder()
    if folder is None:
        raise DataError("TERRAIN_FORGE_CACHE leaves no folder to keep terrain models in", key=_KEY)
    return folder / "dtm" / name


def kept(path: Path, wish: str) -> dict[str, Any] | None:
    """The record of a file that is in the cache and as it was; None where it is not there.

    Args:
        path: The file.
        wish: What `terrain-forge fetch` must be told to have it again.

    Raises:
        DataError: if the file is not what it was when it was first seen.
    """
    record = read_record(path)
    if not path.is_file() or not record:
        return None
    found = file_hash(path)
    if found != record.get("sha256"):
        raise DataError(
            f"{path} is not as it was fetched (SHA-256 {found[:12]}…, was "
            f"{str(record.get('sha256'))[:12]}…): delete it, then "
            f"terrain-forge fetch {quote(wish)}",
            key=_KEY,
        )
    return record


def file_hash(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    import pooch

    return str(pooch.file_hash(str(path)))


def read_record(path: Path) -> dict[str, Any]:
    """The record beside a file; empty where there is none."""
    file = _record(path)
    if not file.is_file():
        return {}
    try:
        return dict(json.loads(read_text(file, str(file), most=_MOST_RECORD)))
    except (ValueError, TypeError):
        raise DataError(f"{file} is damaged: delete it", key=_KEY) from None


def write_record(path: Path, **facts: Any) -> dict[str, Any]:
    """Keep what a file is, beside it."""
    record = {**facts, "bytes": path.stat().st_size, "sha256": file_hash(path)}
    new = _record(path).with_suffix(".new")
    new.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    new.replace(_record(path))
    return record


def _record(path: Path) -> Path:
    return path.with_name(f"{path.name}.json")


def ask(url: str, name: str, *, wish: str) -> Answer:
    """Ask a server for a file's size and tag, by the first of its bytes.

    Args:
        url: Its address.
        name: What the user calls it.
        wish: What `terrain-forge fetch` must be told to have it.

    Raises:
        DataError: if it cannot be reached, has no such file, or does not tell its size; or if the
            user forbids the network.
    """
    if os.environ.get(OFFLINE, "0") not in ("", "0"):
        raise DataError(
            f"{name} is not in the cache and {OFFLINE} is set: without it, terrain-forge fetch "
            f"{quote(wish)}",
            key=_KEY,
        )
    ask_for_interrupt()  # one that came in an import may have been dropped there
    with _get(url, name, {"Range": "bytes=0-0"}) as answer:
        in_pieces = answer.status_code == 206
        size = answer.headers.get("Content-Length", "")
        if in_pieces:
            size = answer.headers.get("Content-Range", "").rpartition("/")[2]
        if not (size.isdecimal() and len(size) < 20 and 0 < int(size) <= MOST):
            host = urlsplit(answer.url).hostname
            told = f"{size[:40]} bytes" if size not in ("", "*") else "nothing"
            raise DataError(
                f"{host} tells {told} as the size of {name}, must be 1 B to {MOST // 2**30} GiB",
                key=_KEY,
            )
        return Answer(url=answer.url, size=int(size), tag=_tag(answer.headers), in_pieces=in_pieces)


def download(
    url: str,
    path: Path,
    name: str,
    *,
    licence: str,
    check: Callable[[Path], None],
    progress: Progress,
) -> None:
    """Fetch a whole file into the cache, where it appears when it is complete and checked.

    A file that the user has put there is only checked.

    Args:
        url: Its address.
        path: Where it is to lie.
        name: What the user calls it.
        licence: On what terms it may be used.
        check: Raises a DataError if the file is not what it should be.
        progress: Called with the share that is there.

    Raises:
        DataError: if it cannot be had, or is not what it was when it was first seen.
        StorageError: if the disk does not take it.
    """
    import pooch

    if path.is_file() and not read_record(path):  # put there by hand
        check(path)
        write_record(path, url=url, tag="")
        return
    answer = ask(url, name, wish=name)
    path.parent.mkdir(parents=True, exist_ok=True)
    known = read_record(path).get("sha256")
    told = f"{size_text(answer.size)} from {urlsplit(answer.url).hostname}; {licence}"
    _log.warning("downloading %s: %s", name, told)

    def fetch(_url: str, output_file: str, _pooch: object) -> None:
        with _part(path, answer.tag) as part:
            with telling_interrupts(partial(_told, answer, part, name)):
                _receive(answer, part, name, progress)
            try:
                check(part)
            except DataError:
                part.unlink()
                raise
            part.replace(output_file)

    pooch.get_logger().setLevel("WARNING")
    try:
        pooch.retrieve(url, known, fname=path.name, path=path.parent, downloader=fetch)
    except ValueError as error:
        raise DataError(
            f"{name} is another file at {urlsplit(url).hostname} than it was when it was first "
            f"fetched; to take the new one, delete {_record(path)}",
            key=_KEY,
        ) from error
    write_record(path, url=url, tag=answer.tag)


@contextmanager
def _part(path: Path, tag: str) -> Iterator[Path]:
    """The file that takes what arrives; one process at a time, for one state of the content."""
    mark = sha256(tag.encode()).hexdigest()[:12]
    part = path.with_name(f"{path.name}.{mark}.part")
    for old in path.parent.glob(f"{path.name}.*.part"):
        if old != part or not tag:
            old.unlink()
    with part.open("ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DataError(f"{path.name} is being fetched by another process", key=_KEY) from None
        yield part


def _told(answer: Answer, part: Path, name: str) -> str:
    """What an interrupt leaves."""
    came = f"{size_text(part.stat().st_size)} of {size_text(answer.size)} of {name} came"
    goes_on = "goes on from there" if answer.tag and answer.in_pieces else "begins anew"
    return f"{came}: terrain-forge fetch {quote(name)} {goes_on}"


def _receive(answer: Answer, part: Path, name: str, progress: Progress) -> None:
    """Fill the part up to the whole, from where it ends."""
    import requests

    if shutil.disk_usage(part.parent).free < answer.size - part.stat().st_size:
        raise StorageError(f"{part.parent} has no room for the {size_text(answer.size)} of {name}")
    broken = 0
    while (have := part.stat().st_size) != answer.size:
        if have > answer.size or not (answer.tag and answer.in_pieces):
            os.truncate(part, have := 0)
        piece = {"Range": f"bytes={have}-", "If-Range": answer.tag} if have else {}
        try:
            with _get(answer.url, name, piece) as response:
                _append(response, answer, part, have, name, progress)
            why = f"{part.stat().st_size:,} of {answer.size:,} bytes came"
        except requests.RequestException as error:
            why = _reason(error)
        broken = 0 if part.stat().st_size > have else broken + 1
        if part.stat().st_size != answer.size and (broken == TRIES or not answer.in_pieces):
            raise DataError(
                f"{name} broke off at {urlsplit(answer.url).hostname}: {why}; what is there is "
                f"kept, terrain-forge fetch {quote(name)} goes on",
                key=_KEY,
            )


def _append(
    response: Any, answer: Answer, part: Path, have: int, name: str, progress: Progress
) -> None:
    """Write what a response holds behind what is there."""
    begun = response.headers.get("Content-Range", "").startswith(f"bytes {have}-")
    if _tag(response.headers) != answer.tag or (response.status_code == 206) != begun:
        raise DataError(f"{name} changed at its server while it was fetched: try again", key=_KEY)
    with part.open("r+b") as file:
        file.seek(have if begun else 0)
        file.truncate()
        for chunk in response.iter_content(CHUNK):
            if file.tell() + len(chunk) > answer.size:
                raise DataError(f"{name} is larger than its server says: not kept", key=_KEY)
            file.write(chunk)
            had = f"{size_text(file.tell())} of {size_text(answer.size)}"
            progress(f"download: {had}", file.tell() / answer.size)


@contextmanager
def _get(url: str, name: str, headers: dict[str, str]) -> Iterator[Any]:
    """A server's answer, of which the body is not read yet.

    Raises:
        DataError: if there is none, or it says no.
    """
    import requests

    own = {"Accept-Encoding": "identity", "User-Agent": "terrain-forge", **headers}
    host = urlsplit(url).hostname
    with requests.Session() as session:
        session.max_redirects = 5
        try:
            response = session.get(url, headers=own, stream=True, timeout=TIMEOUT)
        except requests.RequestException as error:
            if isinstance(error, requests.ConnectionError) and not _has_answered(error):
                raise DataError(
                    f"{name} cannot be had: {host} is not reached ({_reason(error)}). Offline, "
                    f"fetch it on another machine and copy that one's cache to {cache_folder()}",
                    key=_KEY,
                ) from None
            why = _reason(error)
            raise DataError(f"{name} cannot be had from {host}: {why}", key=_KEY) from None
        with response:
            if not response.ok:
                said = f"{response.status_code} {response.reason}".strip()
                raise DataError(f"{name} cannot be had: {host} says {said} ({url})", key=_KEY)
            if url.startswith("https:") and not response.url.startswith("https:"):
                raise DataError(f"{host} leads {name} to an unsafe address", key=_KEY)
            yield response


def _tag(headers: Any) -> str:
    tag = str(headers.get("ETag", ""))
    return str(headers.get("Last-Modified", "")) if not tag or tag.startswith("W/") else tag


def _has_answered(error: Exception) -> bool:
    """Whether somebody is there, who says what is no HTTP or hangs up."""
    from urllib3.exceptions import ProtocolError

    return bool(error.args) and isinstance(error.args[0], ProtocolError)


def _reason(error: Exception) -> str:
    """The innermost cause of an error of `requests`, in a line."""
    text = str(error)
    while isinstance(error.args[0] if error.args else None, Exception):
        error = error.args[0]
        text = str(getattr(error, "reason", "") or error)
    return " ".join(text.split())[:200] or type(error).__name__
