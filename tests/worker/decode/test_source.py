"""A source gives the bytes that were uploaded, or says that they are not: MiB by MiB."""

from pathlib import Path

import numpy as np
import pytest

from store.blobs.proof import PIECE_BYTES, PieceDigester
from worker.decode.limits import allow_all
from worker.decode.reader import open_source
from worker.decode.tiff import Source, SourceDamagedError

SIZE = 2 * PIECE_BYTES + 5
CONTENT = bytes(np.random.default_rng(1).integers(0, 256, SIZE, np.uint8))


def digest(content: bytes, *, step: int = 700_001) -> bytes:
    digester = PieceDigester()
    for start in range(0, len(content), step):
        digester.update(content[start : start + step])
    return digester.digests()


def flip(content: bytes, place: int) -> bytes:
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


@pytest.mark.parametrize("size", [0, 1, PIECE_BYTES - 1, PIECE_BYTES, PIECE_BYTES + 1, SIZE])
def test_digests_do_not_depend_on_how_a_file_arrives(size: int) -> None:
    content = CONTENT[:size]
    assert digest(content) == digest(content, step=PIECE_BYTES) == digest(content, step=max(1, size))
    source = Source(content, digest(content))
    assert source[:] == content


def test_only_what_is_read_is_proven(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(flip(CONTENT, PIECE_BYTES + 77))
    source = Source(path.read_bytes(), digest(CONTENT))
    assert len(source) == SIZE
    assert source[0] == CONTENT[0]
    assert source[PIECE_BYTES - 9 : PIECE_BYTES] == CONTENT[PIECE_BYTES - 9 : PIECE_BYTES]
    assert bytes(source.array(2 * PIECE_BYTES, 5)) == CONTENT[-5:]
    with pytest.raises(SourceDamagedError, match="MiB 1 "):
        source[PIECE_BYTES - 9 : PIECE_BYTES + 1]
    with pytest.raises(SourceDamagedError, match="MiB 1 "):
        source.array(2 * PIECE_BYTES - 1, 2)
    with pytest.raises(SourceDamagedError, match="MiB 1 "):
        source[:]


@pytest.mark.parametrize("damaged", [CONTENT[:-1], CONTENT[:PIECE_BYTES], b"", CONTENT + b"x"])
def test_another_size_is_damage(damaged: bytes) -> None:
    with pytest.raises(SourceDamagedError):
        Source(damaged, digest(CONTENT))[:]


def test_a_damaged_header_is_no_refusal_of_the_frame(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(bytes(SIZE))
    source = Source(path.read_bytes(), digest(CONTENT))
    with pytest.raises(SourceDamagedError):
        open_source(source, allow_all)
