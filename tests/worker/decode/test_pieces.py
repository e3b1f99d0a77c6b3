"""Pieces on two threads: all of them, each once, and the same failure as on one thread."""

import os
import threading
from types import SimpleNamespace

import pytest

from worker.decode import pieces

needs_two = pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one processor"
)


@pytest.fixture
def second(monkeypatch):
    monkeypatch.setattr(pieces, "_second", [])
    pieces.start_second_thread()
    yield
    pieces._second[0]._executor.shutdown()


@needs_two
@pytest.mark.usefixtures("second")
def test_two_threads_share_the_pieces_and_each_is_decoded_once():
    seen = []
    before = os.sched_getaffinity(0)
    pieces.decode_all(lambda piece: seen.append((piece, threading.get_ident())), range(7))
    assert sorted(piece for piece, _ in seen) == list(range(7))
    assert len({thread for _, thread in seen}) == 2
    assert os.sched_getaffinity(0) == before


@needs_two
@pytest.mark.usefixtures("second")
@pytest.mark.parametrize("bad", [{3, 4}, {2, 5}, {6}, {1}])
def test_the_failure_of_the_earliest_piece_is_raised_after_both_threads_have_ended(bad):
    def decode(piece):
        if piece in bad:
            raise ValueError(piece)

    with pytest.raises(ValueError, match=f"^{min(bad)}$"):
        pieces.decode_all(decode, range(8))
    again = []
    pieces.decode_all(again.append, range(8))
    assert sorted(again) == list(range(8))


@needs_two
@pytest.mark.usefixtures("second")
def test_processors_that_have_been_taken_away_are_no_fault_of_a_file(monkeypatch):
    def refuse(_pid, _cpus):
        raise OSError(22, "Invalid argument")

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    seen = []
    pieces.decode_all(seen.append, range(4))
    assert sorted(seen) == [0, 1, 2, 3]


def test_on_one_processor_one_thread_decodes_all(monkeypatch):
    monkeypatch.setattr(pieces, "_second", [])
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {0}, raising=False)
    pieces.start_second_thread()
    seen = []
    pieces.decode_all(lambda piece: seen.append((piece, threading.get_ident())), range(3))
    assert seen == [(piece, threading.get_ident()) for piece in range(3)]


@needs_two
def test_where_no_thread_can_be_started_one_decodes_all(monkeypatch):
    def refuse(_thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(pieces, "_second", [])
    monkeypatch.setattr(threading.Thread, "start", refuse)
    pieces.start_second_thread()
    seen = []
    pieces.decode_all(seen.append, range(3))
    assert seen == [0, 1, 2]


def test_a_c_library_without_mallopt_stops_no_start(monkeypatch):
    """As musl: how memory is kept is a question of speed."""
    monkeypatch.setattr(pieces.ctypes, "CDLL", lambda _: SimpleNamespace())
    pieces.share_one_arena()
    pieces.keep_memory()
