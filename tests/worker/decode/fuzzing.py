"""Damaged files through the decoder, as the product reads them: `python -m tests.worker.decode.fuzzing`.

What happens to a variant is one of these:

refused        with a reason that the service knows
same           accepted, and every sample is the seed's
flagged        accepted as an image of which a part is empty
another file   its header was changed, and it describes another image, or finds it elsewhere: a valid file
not provable   only its pixel data was changed, accepted with other samples, and its format has nothing to
               prove them with: no digest, no checksum, and as many samples as belong there
FINDING        accepted with other samples although only pixel data was changed and the file has a digest or
               checksum, or although rows of it were zeroed; decoded to something else the second time;
               crashed; or took longer than the limit
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radiometry.findings import InputRejected
from tests.worker.decode.fuzz_seeds import Seed, find_real_seeds, make_seeds
from worker.decode.pool import DecoderCrashed, DecoderPool

MOST_SECONDS = 20.0
REAL_SHARE = 0.1
# Fewer zeroed rows may be a sensor's own, or lie across the rows.
ZEROED_ROWS = 12
PROVING = frozenset({"digest", "checksum"})
OUTCOMES = ("refused", "same", "flagged", "another file", "not provable", "FINDING")


@dataclass(frozen=True)
class Variant:
    """``header_changed`` : bytes outside of pixel data; ``zeroed_rows`` : of an uncompressed image."""

    number: int
    seed: Seed
    content: bytes
    change: str
    header_changed: bool
    zeroed_rows: int = 0


@dataclass(frozen=True)
class Decoded:
    header: object
    samples: bytes
    flagged: bool
    vouched_by: str


def make_variant(number: int, seeds: list[Seed], real: list[Seed]) -> Variant:
    random = np.random.default_rng(number)
    pool = real if real and random.random() < REAL_SHARE else seeds
    seed = pool[random.integers(len(pool))]
    change = CHANGES[random.integers(len(CHANGES))]
    return change(number, seed, random)


def _flip_header(number: int, seed: Seed, random: np.random.Generator) -> Variant:
    content = bytearray(seed.content)
    outside = np.ones(len(content), bool)
    for start, end in seed.body:
        outside[start:end] = False
    for place in random.choice(np.flatnonzero(outside), random.integers(1, 5)):
        content[place] = random.integers(256)
    return Variant(number, seed, bytes(content), "header bytes", header_changed=True)


def _flip_body(number: int, seed: Seed, random: np.random.Generator) -> Variant:
    content = bytearray(seed.content)
    start, end = _pick_piece(seed, random)
    for place in random.integers(start, end, random.integers(1, 9)):
        content[place] = random.integers(256)
    return Variant(number, seed, bytes(content), "pixel bytes", header_changed=False)


def _overwrite_body(number: int, seed: Seed, random: np.random.Generator) -> Variant:
    """A block of zeros, of ones, of noise, or of another place of the same file."""
    start, end = seed.body[0][0], seed.body[-1][1]
    first = int(random.integers(start, end))
    size = int(min(end - first, 2 ** random.uniform(2, 1 + np.log2(end - start))))
    kind = random.integers(4)
    other = int(random.integers(0, len(seed.content) - size + 1))
    block = (bytes(size), b"\xff" * size, random.bytes(size), seed.content[other : other + size])[kind]
    content = bytearray(seed.content)
    zeroed = 0
    inside = False
    for piece_start, piece_end in seed.body:
        low, high = max(first, piece_start), min(first + size, piece_end)
        if low < high:
            inside = True
            content[low:high] = block[low - first : high - first]
            zeroed += (high - low) // seed.row_bytes if seed.row_bytes and kind == 0 else 0
    name = ("zeros", "ones", "noise", "another place")[kind]
    return Variant(number, seed, bytes(content), f"block of {name}", not inside, zeroed)


def _cut(number: int, seed: Seed, random: np.random.Generator) -> Variant:
    kept = int(random.integers(1, len(seed.content)))
    return Variant(number, seed, seed.content[:kept], "cut short", header_changed=True)


def _cut_and_fill(number: int, seed: Seed, random: np.random.Generator) -> Variant:
    """Of full length: what was written before the card was pulled, then zeros up to the next piece's end."""
    start, end = seed.body[0][0], seed.body[-1][1]
    first = int(random.integers(start, end))
    content, zeroed = bytearray(seed.content), 0
    for piece_start, piece_end in seed.body:
        low = max(first, piece_start)
        if low < piece_end:
            content[low:piece_end] = bytes(piece_end - low)
            zeroed += (piece_end - low) // seed.row_bytes if seed.row_bytes else 0
    return Variant(number, seed, bytes(content), "ends in zeros", False, zeroed)


def _shift_body(number: int, seed: Seed, random: np.random.Generator) -> Variant:
    """A few bytes of pixel data are lost, and what follows moves up."""
    start, end = _pick_piece(seed, random)
    first, lost = int(random.integers(start, end)), int(random.integers(1, 5))
    moved = seed.content[first + lost : end] + bytes(min(lost, end - first))
    return Variant(
        number,
        seed,
        seed.content[:first] + moved + seed.content[end:],
        "pixel bytes lost",
        header_changed=False,
    )


def _pick_piece(seed: Seed, random: np.random.Generator) -> tuple[int, int]:
    return seed.body[random.integers(len(seed.body))]


CHANGES: tuple[Callable[[int, Seed, np.random.Generator], Variant], ...] = (
    _flip_header,
    _flip_body,
    _overwrite_body,
    _cut_and_fill,
    _shift_body,
    _cut,
)


class Fuzzer:
    def __init__(self, pool: DecoderPool, folder: Path, seeds: list[Seed], real: list[Seed]) -> None:
        self._pool, self._folder = pool, folder
        self._seeds, self._real = seeds, real
        self._read = 0
        self.counts: Counter[tuple[str, str]] = Counter()
        self.findings: list[str] = []
        self._originals = {seed.name: self._decode(seed.content) for seed in (*seeds, *real)}

    def try_one(self, number: int) -> str:
        variant = make_variant(number, self._seeds, self._real)
        began = time.monotonic()
        try:
            outcome = self._judge(variant)
        except DecoderCrashed as crash:
            outcome = f"FINDING: {crash}"
        if time.monotonic() - began > MOST_SECONDS:
            outcome = f"FINDING: it took {time.monotonic() - began:.0f} s"
        if outcome.startswith("FINDING"):
            self.findings.append(f"{number} ({variant.seed.name}, {variant.change}): {outcome[9:]}")
            outcome = "FINDING"
        self.counts[variant.seed.name, outcome] += 1
        return outcome

    def _judge(self, variant: Variant) -> str:
        try:
            found = self._decode(variant.content)
        except InputRejected:
            return "refused"
        original = self._originals[variant.seed.name]
        if found.samples == original.samples and found.header == original.header:
            return "same"
        return self._find_change(variant.content, found) or _sort(variant, found, original)

    def _find_change(self, content: bytes, found: Decoded) -> str:
        """Read it again: what a decoder makes of memory that it never wrote differs from time to time."""
        try:
            again = self._decode(content)
        except InputRejected as refusal:
            return f"FINDING: the second time it was refused: {refusal.message}"
        return "" if again == found else "FINDING: the second time it was another image"

    def _decode(self, content: bytes) -> Decoded:
        self._read += 1
        path = self._folder / str(self._read)
        path.write_bytes(content)
        try:
            header = self._pool.read_header(path)
            _, proof = self._pool.inspect(path, 64)
            frame = self._pool.read_window(path, (0, 0, header.height_px, header.width_px))
        finally:
            path.unlink()
        return Decoded(header, frame.samples_dn.tobytes(), bool(proof.wholeness.empty), proof.vouched_by)


def _sort(variant: Variant, found: Decoded, original: Decoded) -> str:
    if found.flagged:
        return "flagged"
    if found.samples == original.samples or variant.header_changed:
        return "another file"
    if found.vouched_by in PROVING:
        return f"FINDING: accepted against its own {found.vouched_by}"
    if variant.zeroed_rows >= ZEROED_ROWS:
        return f"FINDING: {variant.zeroed_rows} empty rows were not seen"
    return "not provable"


def run(*, seconds: float, variants: int, first: int = 0) -> Fuzzer:
    seeds, real = make_seeds(), find_real_seeds()
    with tempfile.TemporaryDirectory(prefix="stilb-fuzz-") as folder, DecoderPool() as pool:
        fuzzer = Fuzzer(pool, Path(folder), seeds, real)
        end = time.monotonic() + seconds
        for number in range(first, first + variants):
            if time.monotonic() > end:
                break
            fuzzer.try_one(number)
    return fuzzer


def describe(fuzzer: Fuzzer) -> str:
    names = list(dict.fromkeys(name for name, _ in fuzzer.counts))
    lines = [f"{'seed':<52}" + "".join(f"{outcome:>14}" for outcome in OUTCOMES)]
    for name in [*sorted(names), ""]:
        counted = [
            sum(n for (seed, outcome), n in fuzzer.counts.items() if outcome == each and name in ("", seed))
            for each in OUTCOMES
        ]
        lines.append(f"{name or 'together':<52}" + "".join(f"{count:>14}" for count in counted))
    return "\n".join([*lines, f"{sum(fuzzer.counts.values())} variants", *fuzzer.findings])


def main() -> int:
    parser = argparse.ArgumentParser(description="Read damaged files until the time is over.")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--variants", type=int, default=sys.maxsize)
    parser.add_argument("--first", type=int, default=0, help="number of the first variant")
    told = parser.parse_args()
    fuzzer = run(seconds=told.seconds, variants=told.variants, first=told.first)
    print(describe(fuzzer))  # noqa: T201
    return 1 if fuzzer.findings else 0


if __name__ == "__main__":
    sys.exit(main())
