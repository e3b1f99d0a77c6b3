"""Where nobody watches a terminal, progress is lines that a log can hold."""

import io

from rich.console import Console

from demo import display
from demo.display import Display


def shown(console_file, **console):
    return Display(Console(file=console_file, width=80, **console))


def test_plain_lines_outside_a_terminal(monkeypatch):
    monkeypatch.setattr(display, "_LINE_EVERY_S", 0.0)
    text = io.StringIO()
    with shown(text, force_terminal=False).stage("sending") as advance:
        advance(0.5)
    first, last = text.getvalue().splitlines()
    assert first == "sending: 50%"
    assert last.startswith("sending: done in 0.")


def test_a_quick_stage_is_one_line():
    text = io.StringIO()
    with shown(text, force_terminal=False).stage("sending") as advance:
        for share in range(100):
            advance(share / 100)
    assert len(text.getvalue().splitlines()) == 1


def test_a_bar_in_a_terminal():
    text = io.StringIO()
    with shown(text, force_terminal=True).stage("sending") as advance:
        advance(0.5)
    assert "sending" in text.getvalue()
    assert "100%" in text.getvalue()


def test_addresses_are_printed_whole():
    text = io.StringIO()
    shown(text, force_terminal=False).say("key [red]" + "k" * 200)
    assert "k" * 200 in text.getvalue()
