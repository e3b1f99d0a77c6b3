"""The process that renders: whatever takes it over reaches nothing, and ends within its limits."""

import json
import os
import signal
import socket
import sys

import pytest

from service.documents import rendered as kept
from service.documents.rendered import RenderingFailed, render_apart, write_order
from store.sandbox import Restrictions
from tests.support.press import COMMAND

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux shuts processes in")


@pytest.fixture
def obey(monkeypatch):
    """Have an order obeyed that no press takes."""
    if Restrictions()._landlock == 0:
        pytest.skip("this kernel has no Landlock")
    monkeypatch.setattr(kept, "build_command", lambda _module: COMMAND)
    return lambda kind, **order: render_apart(json.dumps({"kind": kind} | order).encode(), require=True)


def test_a_press_that_was_taken_over_reaches_nothing(obey, tmp_path, monkeypatch):
    monkeypatch.setenv("STILB_KEY", "a secret")
    names = ("key", "database", "stored", "unix")
    for name in names[:3]:
        (tmp_path / name).write_bytes(b"a secret")
    with socket.create_server(("127.0.0.1", 0)) as tcp, socket.socket(socket.AF_UNIX) as unix:
        unix.bind(str(tmp_path / "unix"))
        unix.listen()
        world = {name: str(tmp_path / name) for name in names}
        world |= {"tcp": tcp.getsockname()[1], "worker": os.getpid(), "samples": os.urandom(32).hex()}
        assert json.loads(obey("probe", world=world)) == []


LINKED = """<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink'
    width='9' height='9'><image xlink:href='report.typ' width='9' height='9'/></svg>"""


@pytest.mark.parametrize("typst", ['#read("report.typ")', f'#image(bytes("{LINKED}"), format: "svg")'])
def test_typst_and_svg_open_no_file_not_even_beside_the_template(obey, typst):
    with pytest.raises(RenderingFailed, match="access denied"):
        obey("typst", typst=typst)


@pytest.mark.parametrize(
    ("kind", "typst", "ends"),
    [
        ("typst", "#let a = (0,) * 500000000", f"exit code {-signal.SIGABRT}"),
        (
            "typst",
            "#for a in range(9999) { for b in range(9999) { let c = a * b } }",
            f"exit code {-signal.SIGXCPU}",
        ),
        ("flood", "", "exit code -"),
    ],
)
def test_what_takes_too_much_is_ended(obey, kind, typst, ends):
    with pytest.raises(RenderingFailed, match=ends):
        obey(kind, typst=typst)


def test_less_than_the_whole_sandbox_will_do_unless_it_is_required(monkeypatch):
    code = "from service.documents import rendering as press\n"
    code += "press.Restrictions._restrict_files = lambda _: False\n"
    code += "press.render = lambda order: order\n"
    code += "press.os.nice = lambda _: 0\n"
    code += "press.main()"
    monkeypatch.setattr(kept, "build_command", lambda _module: [sys.executable, "-c", code])
    assert render_apart(write_order("any")) == b'{"kind": "any"}'
    with pytest.raises(RenderingFailed, match="gives no landlock_files"):
        render_apart(b"{}", require=True)
