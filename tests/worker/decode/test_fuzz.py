"""Damaged files give their image, another valid one or a refusal: no other error, and nothing made up."""

from tests.support import reader
from tests.worker.decode.fuzz_seeds import make_seeds
from tests.worker.decode.fuzzing import Fuzzer

VARIANTS = 900


class InThisProcess:
    """Answers as the pool does; an error that is no refusal ends the test."""

    def read_header(self, path):
        return reader.read_header(path)

    def inspect(self, path, longest_side_px):
        return reader.open_reader(path).inspect(longest_side_px)

    def read_window(self, path, window):
        return reader.read_window(path, *window)


def test_damaged_files_are_read_or_refused(tmp_path):
    """`make fuzz` goes on with more of them and with real files."""
    fuzzer = Fuzzer(InThisProcess(), tmp_path, make_seeds(), [])
    for number in range(VARIANTS):
        fuzzer.try_one(number)
    assert fuzzer.findings == []
    assert fuzzer.counts.total() == VARIANTS
    assert {outcome for _, outcome in fuzzer.counts} >= {"refused", "same", "flagged", "another file"}
