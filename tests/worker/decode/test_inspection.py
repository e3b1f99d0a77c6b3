"""The pass over a whole frame: what its file proves, and what is doubted."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected, files
from radiometry.frame.proof import PieceRun
from simulation.dng import BYTE
from tests.support import reader
from tests.worker.decode.dng_variants import Variant, black_level, make_dng, make_samples

ROWS, COLS = 300, 520
NEW, OLD = 51111, 50972


def _new_digest(samples, kind):
    """The SDK's, written down again: MD5 of the MD5 of every 256 x 256 tile, row by row."""
    tiles = hashlib.md5(usedforsecurity=False)
    for top in range(0, len(samples), 256):
        for left in range(0, samples.shape[1], 256):
            tile = samples[top : top + 256, left : left + 256].astype(kind)
            tiles.update(hashlib.md5(tile.tobytes(), usedforsecurity=False).digest())
    return tiles.digest()


def _old_digest(samples):
    return hashlib.md5(samples.astype("<u2").tobytes(), usedforsecurity=False).digest()


STORED = {
    "16 bit": Variant(),
    "big endian": Variant(order=">"),
    "12 bit packed": Variant(bits=12),
    "8 bit": Variant(bits=8),
    "borders": Variant(active_area=(6, 8, 290, 510)),
    "ljpeg tiles": Variant(compression="ljpeg", bits=12, tile=(96, 160)),
    "ljpeg, borders": Variant(compression="ljpeg", bits=12, tile=(96, 160), active_area=(100, 170, 290, 510)),
    "long table": Variant(bits=12, table=tuple(range(0, 4096 * 4, 4))),
    "short table": Variant(bits=16, table=tuple(range(0, 256 * 100, 100))),
}


def _samples(variant):
    return make_samples(ROWS, COLS, 8 if variant.table and len(variant.table) == 256 else variant.bits)


def _with(variant, tag, digest):
    return replace(variant, main={tag: (BYTE, digest)})


def _digests(variant, samples):
    bytewise = variant.bits == 8 or (variant.table and len(variant.table) <= 256)
    return {NEW: _new_digest(samples, np.uint8 if bytewise else "<u2"), OLD: _old_digest(samples)}


@pytest.mark.parametrize("tag", [NEW, OLD])
@pytest.mark.parametrize("name", STORED)
def test_digest_of_the_raw_image_is_checked(name, tag, save):
    variant = STORED[name]
    samples = _samples(variant)
    digest = _digests(variant, samples)[tag]
    proof = reader.prove(save(make_dng(samples, _with(variant, tag, digest))))
    assert proof.vouched_by == "digest"
    changed = samples.copy()
    changed[-1, -1] ^= 1
    with pytest.raises(InputRejected, match="own digest") as caught:
        reader.prove(save(make_dng(changed, _with(variant, tag, digest)), "changed.dng"))
    assert caught.value.code is files.INCOMPLETE_IMAGE


def test_digest_that_lightroom_spoilt_proves_with_its_rest(save):
    samples = make_samples(ROWS, COLS, 16)
    spoilt = b"\1\2\3\4" + _old_digest(samples)[4:]
    assert reader.prove(save(make_dng(samples, _with(Variant(), OLD, spoilt)))).vouched_by == "digest"


@pytest.mark.parametrize(
    ("variant", "run"),
    [
        (Variant(), PieceRun(pieces=1, stored_bytes=312_000, consumed_bytes=312_000, samples=156_000)),
        (
            Variant(tile=(160, 272)),
            PieceRun(pieces=4, stored_bytes=87_040, consumed_bytes=87_040, samples=43_520),
        ),
    ],
)
def test_uncompressed_pieces_are_accounted_for(variant, run, save):
    proof = reader.prove(save(make_dng(make_samples(ROWS, COLS, 16), variant)))
    assert (proof.vouched_by, proof.pieces, proof.wholeness.empty) == ("length", (run,), ())


def test_compressed_pieces_are_accounted_for(save):
    proof = reader.prove(save(make_dng(make_samples(ROWS, COLS, 12), STORED["ljpeg, borders"])))
    assert proof.vouched_by == "end"
    assert sum(run.pieces for run in proof.pieces) == 16
    assert {run.samples for run in proof.pieces} == {96 * 160}
    assert all(run.consumed_bytes == run.stored_bytes for run in proof.pieces)


@pytest.mark.parametrize("name", ["12 bit packed", "16 bit", "ljpeg tiles", "big endian"])
@pytest.mark.parametrize("black", [256, 0])
def test_lower_half_of_zeros_is_seen(name, black, save):
    rng = np.random.default_rng(4)
    samples = np.rint(rng.normal(900, 12, (ROWS, COLS))).astype(np.uint16)
    variant = replace(STORED[name], extra=black_level([black]))
    assert reader.prove(save(make_dng(samples, variant))).wholeness.empty == ()
    samples[ROWS // 2 :] = 0
    (block,) = reader.prove(save(make_dng(samples, variant), "cut.dng")).wholeness.empty
    assert (block.row0, block.rows, block.cols) == (ROWS // 2, ROWS // 2, COLS)


def test_damage_outside_the_region_is_found_by_the_pass_alone(save):
    samples = make_samples(ROWS, COLS, 12)
    content = bytearray(make_dng(samples, Variant(compression="ljpeg", bits=12, tile=(96, 160))))
    last = content.rindex(b"\xff\xd8\xff\xc3")
    content[last + 200 : last + 240] = bytes(40)
    path = save(bytes(content))
    np.testing.assert_array_equal(reader.read_window(path, 0, 0, 9, 9).samples_dn, samples[:9, :9])
    with pytest.raises(InputRejected):
        reader.prove(path)


def test_real_files_prove_themselves(real_files):
    for name, vouched_by in (
        ("dng/blackmagic_bigendian_ljpeg_tiled.dng", "end"),
        ("dng/canon_14bit_packed_activearea_zero_exif.dng", "length"),
        ("edge/Test_edge1.tif", "end"),
    ):
        proof = reader.prove(real_files / name)
        assert (proof.vouched_by, proof.wholeness.empty) == (vouched_by, ())
    for path in [*(real_files / "sequoia").glob("*.TIF"), *(real_files / "rededge").glob("*.tif")]:
        assert reader.prove(path).wholeness.empty == ()
