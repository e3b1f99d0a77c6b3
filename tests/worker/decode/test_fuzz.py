"""Damaged files give a result or a refusal: no other exception, no crash, no hang."""

import contextlib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from tests.support import reader
from tests.support.data import data_file
from tests.worker.decode.dng_variants import Variant, black_level, make_dng, make_samples, opcode_list

VARIANTS = {
    "packed": Variant(bits=12, active_area=(2, 4, 38, 44), extra=black_level([4, 5, 6, 7], (2, 2))),
    "tiles": Variant(tile=(16, 32), order=">", extra={51009: opcode_list((9, bytes(40)), (3, bytes(60)))}),
    "ljpeg": Variant(compression="ljpeg", bits=14, tile=(16, 32), components=2, thumbnail=True),
    "ljpeg, two tables": Variant(compression="ljpeg", bits=12, components=2, tables=2),
    "table": Variant(bits=8, table=tuple(range(0, 2560, 10))),
}
FILES = {name: make_dng(make_samples(40, 48, each.bits), each) for name, each in VARIANTS.items()}
QUICK = settings(
    max_examples=75,
    deadline=5000,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
FLIPS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=6)


def _read_all(path):
    file = reader.open_reader(path)
    with contextlib.suppress(InputRejected):
        header = file.read_header()
        file.read_window(reader.Window(0, 0, header.height_px, header.width_px))
        file.inspect(64)


def _damage(content, flips, kept):
    damaged = bytearray(content[: max(1, round(len(content) * kept))])
    for place, value in flips:
        damaged[int(place * len(damaged))] = value
    return bytes(damaged)


def _content(name):
    return FILES[name] if name in FILES else data_file(f"dng/{name}").read_bytes()


@pytest.mark.parametrize("name", [*FILES, "one_pixel.dng", "truncated_libraw_reads_zeros.dng"])
@QUICK
@given(flips=FLIPS, kept=st.just(1.0) | st.floats(0, 1))
def test_damaged_files_are_read_or_refused(name, save, flips, kept):
    _read_all(save(_damage(_content(name), flips, kept)))


# the directories are the file's last part: there every byte means something, as in the head of a JPEG
JPEG = "ljpeg, two tables"
DENSE = [(name, len(content) - 421, 421) for name, content in FILES.items()]
DENSE.append((JPEG, FILES[JPEG].index(b"\xff\xd8\xff\xc3"), 121))


@pytest.mark.parametrize(("name", "start", "size"), DENSE)
@QUICK
@given(flips=FLIPS.filter(bool))
def test_damaged_directories_and_heads_are_read_or_refused(name, start, size, save, flips):
    damaged = bytearray(FILES[name])
    for place, value in flips:
        damaged[start + int(place * size)] = value
    _read_all(save(bytes(damaged)))


@settings(QUICK, max_examples=15)
@given(flips=st.lists(st.tuples(st.integers(0, 9200), st.integers(0, 255)), min_size=1, max_size=6))
def test_damaged_head_of_a_real_file_is_read_or_refused(real_files, save, flips):
    content = (real_files / "dng" / "blackmagic_bigendian_ljpeg_tiled.dng").read_bytes()
    damaged = bytearray(content)
    for place, value in flips:
        damaged[place] = value
    _read_all(save(bytes(damaged)))
