"""Hostile requests: what every operation must refuse, or bear, at little cost."""

import gzip
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count, islice

JSON = "application/json"
TABLE = "text/csv"


@dataclass(frozen=True, kw_only=True)
class Body:
    """A request: its body, the type that it claims to have, how it comes, and what stands before it.

    ``missing_bytes`` : announced, and never sent. ``every_s`` : the pause between two bytes, of which the
    first are sent at once.
    """

    content: bytes
    kind: str = JSON
    encoding: str = "identity"
    missing_bytes: int = 0
    every_s: float = 0.0
    headers: dict[str, str] = field(default_factory=dict)
    unit: str = ""
    """Again and again the value of each parameter that the operation has in its query, and an x."""

    def query(self, names: Iterable[str], size: int = 60_000) -> str:
        """Return the query of an operation with these parameters."""
        names = list(names)
        value = self.unit * (size // (len(self.unit) * len(names))) + "x" if self.unit and names else ""
        return "&".join(f"{name}={value}" for name in names if value)


HELD = Body(content=b'{"a": 1', missing_bytes=100, every_s=3600.0)
DRIPPED = Body(content=b'{"a": 1' + b" " * 1000, every_s=0.5)


def make_bodies(size: int) -> dict[str, Body]:
    """Return one of each kind, of about this size, or as much as a bomb of it would become."""
    wall = b"{%b}" % b",".join(b'"%d":1' % number for number in range(900))
    nulls = b"{%b}" % b",".join(b'"%d":null' % number for number in range(900))
    deep, closed = b'{"a":' * 900 + b"1" + b"}" * 900, b"[" * 900 + b"]" * 900
    texts = {
        "no document": b'{"a": ',
        "one name twice": b"{%b}" % _join(size - 9, (b'"%d":1' % n for n in count()), b'"0":1'),
        "a wall of names": b"{%b}" % _join(size, (b'"%d":1' % n for n in count())),
        "long names": b"{%b}" % _join(size, (b'"%b%d":1' % (b"x" * 4000, n) for n in count())),
        "many walls of names": _list(wall, size),
        "many walls of null": _list(nulls, size),
        "open lists": b"[" * size,
        "closed lists": _list(closed, size),
        "objects in objects": _list(deep, size),
        "empty objects": _list(b"{}", size),
        "pairs of texts": _list(b'["a","b"]', size),
        "a long text": b'{"a":"%b"}' % (b"x" * size),
        "half characters": b'{"a":"%b"}' % (rb"\ud800" * (size // 6)),
        "long numbers": _list(b"1" * 10_000, size),
        "one long number": b'{"a":%b}' % (b"1" * size),
        "a long fraction": b'{"a":1.%b}' % (b"1" * size),
        "hard fractions": _list(b"1.23456789012345678e-305", size),
        "whole numbers": _list(b"1", size),
        "no numbers": _list(b"NaN", size),
        "no UTF-8": b'{"\xff":"%b"}' % (b"\xfe" * size),
        "UTF-32": _list(b"1", size // 4).decode().encode("utf-32"),
        "spaces": b" " * size,
    }
    tables = {
        "a wide table": b"a;" * (size // 2),
        "an empty table": b";\n" * (size // 2),
        "blank lines": b"a\n" + b"\n" * size,
        "a table without an end": b'a\n"' + b"x" * size,
        "wrong readings": b"scene;quantity;value;unit\n" + b"a;b;c;d\n" * (size // 8),
        "a row without an end": b"scene;quantity;value;unit\n" + b"a;" * (size // 2),
    }
    bomb = gzip.compress(bytes(100 << 20))
    part = b'--b\r\nContent-Disposition: form-data; name="a"\r\n\r\n\r\n'
    return {
        **{name: Body(content=content) for name, content in texts.items()},
        **{name: Body(content=content, kind=TABLE) for name, content in tables.items()},
        "a packed bomb": Body(content=bomb[:size], encoding="gzip"),
        "a hidden bomb": Body(content=bomb[:size]),
        "many parts": Body(content=part * (size // len(part)), kind="multipart/form-data; boundary=b"),
        "less than announced": Body(content=b"{" * (size // 2), missing_bytes=size // 2),
    }


def make_heads(size: int) -> dict[str, Body]:
    """Return requests whose headers or parameters have about this size."""
    headers = {
        "Accept": "a/b;q=0." + "0" * size,
        "Accept-Encoding": "gzip" + " " * size + ";q=0.0",
        "Repr-Digest": "sha-256" + " " * size,
        "Content-Encoding": "," * size,
        "Content-Type": "multipart/form-data; " + 'a="' * (size // 3),
        "Cookie": "a=b; " * (size // 5),
        "Idempotency-Key": "x" * size,
        "If-None-Match": '"a",' * (size // 4),
        "If-Match": '"a",' * (size // 4),
        "Prefer": "wait=1" * (size // 6),
        "Range": "bytes=" + "0" * size,
        "Upload-Checksum": "sha256 " + "A" * size,
        "Upload-Length": "1" * size,
        "Upload-Metadata": "a YQ==," * (size // 7),
        "X-Content-SHA256": "a" * size,
    }
    nothing = Body(content=b"")
    units = {"digits": "1", "points": "1.", "gaps": "+", "calls": "makePolygon()++++++++", "lists": "["}
    return {
        **{name: replace(nothing, headers={name: text}) for name, text in headers.items()},
        **{f"{name} in the query": replace(nothing, unit=unit) for name, unit in units.items()},
    }


def _list(item: bytes, size: int) -> bytes:
    return b"[%b]" % b",".join([item] * max(1, size // (len(item) + 1)))


def _join(size: int, items: Iterator[bytes], *last: bytes) -> bytes:
    each = len(next(items)) + 6
    return b",".join([*islice(items, size // each), *last])


def make_own() -> dict[tuple[str, str], Body]:
    """Return bodies whose names an operation knows, by method and path, with all the faults that fit."""
    pairs = b'{"polygon":[%b]}' % b",".join([b'["a","b"]'] * 1000)
    regions = b'{"regions":[%b]}' % b",".join([pairs] * 100)
    file = b'{"name":1,"size_bytes":"x"}'
    files = b'{"files":[%b],"others":[%b]}' % ((b",".join([file] * 20_000),) * 2)
    frame = b'{"name":1,"taken_s":"x","exposure_time_s":0,"f_number":0,"iso":0,"band":1,"signal_share":"x"}'
    left_out = b'{"exclude":[%b]}' % b",".join([b'{"frame_id":1,"reason":2}'] * 10_000)
    return {
        ("PUT", "/v1/campaigns/{campaign_id}/roi"): Body(content=regions),
        ("PUT", "/v1/frames/{frame_id}/roi"): Body(content=regions),
        ("POST", "/v1/campaigns/{campaign_id}/manifest"): Body(content=files),
        ("POST", "/v1/campaigns/{campaign_id}/calibrations"): Body(content=left_out),
        ("POST", "/v1/proposals"): Body(content=b'{"frames":[%b]}' % b",".join([frame] * 10_000)),
        ("POST", "/v1/campaigns/{campaign_id}/readings"): Body(
            content=b"[%b]" % b",".join([b'{"scene":1,"quantity":2,"value":"x","unit":3}'] * 10_000)
        ),
        ("POST", "/v1/tools/exposure"): Body(
            content=b'{"rows":[%b]}' % b",".join([b'{"exposure_time_s":"x","iso":0}'] * 10_000)
        ),
        ("POST", "/v1/measurements"): Body(content=b'{"roi":%b}' % regions),
    }
