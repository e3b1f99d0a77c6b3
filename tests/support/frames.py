"""Small DNG files as the simulated camera writes them, with a given signal."""

import io
import struct
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import tifffile

from radiometry.frame.exposure import Settings
from simulation.camera import Camera, change
from simulation.dng import write_dng

BLACK, WHITE = 256, 4095
_TAKEN_AT = datetime(2026, 5, 1, 20, 0, tzinfo=UTC)


def write_frame(
    path: Path,
    *,
    signal_dn: float = 1000.0,
    noise_dn: float = 4.0,
    exposure_time_s: float = 0.01,
    f_number: float = 4.0,
    iso: int = 3200,
    serial: str = "0K1XE8",
    seed: int = 1,
    shape: tuple[int, int] = (64, 96),
    taken_at: datetime = _TAKEN_AT,
    **changes,
) -> Path:
    """A mosaic of black + signal with normal noise, rounded and clipped as a converter does."""
    noise = np.random.default_rng(seed).normal(BLACK + signal_dn, noise_dn, shape)
    mosaic = np.clip(np.rint(noise), 0, WHITE).astype(np.uint16)
    exposure = {"exposure_time_s": exposure_time_s, "f_number": f_number, "iso": iso}
    return write_raw(path, mosaic, **exposure, serial=serial, taken_at=taken_at, **changes)


def write_raw(
    path: Path,
    samples,
    *,
    exposure_time_s: float = 0.01,
    f_number: float = 4.0,
    iso: int = 100,
    serial: str = "0K1XE8",
    compression: str = "none",
    taken_at: datetime = _TAKEN_AT,
    **changes,
) -> Path:
    """Samples as a file of a camera, which ``changes`` describe further."""
    camera = change(Camera(), **{"serial": serial, "lens_serial": "L1"} | changes)
    settings = Settings(exposure_time_s=exposure_time_s, f_number=f_number, iso=iso)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_dng(path, samples, camera=camera, settings=settings, taken_at=taken_at, compression=compression)
    return path


def place_frame(
    content: bytes, *, latitude_deg: float, longitude_deg: float, altitude_m: float, **dji: str
) -> bytes:
    """The same file with a GPS directory, DJI's XMP, and a first directory that points to them at its end."""
    place = len(content) + len(content) % 2
    entries = [
        struct.pack("<HHI4s", 1, 2, 2, b"S" if latitude_deg < 0 else b"N"),
        struct.pack("<HHII", 2, 5, 3, place + 100),
        struct.pack("<HHI4s", 3, 2, 2, b"W" if longitude_deg < 0 else b"E"),
        struct.pack("<HHII", 4, 5, 3, place + 124),
        struct.pack("<HHII", 5, 1, 1, altitude_m < 0),
        struct.pack("<HHII", 6, 5, 1, place + 148),
    ]
    gps = (struct.pack("<H", len(entries)) + b"".join(entries) + bytes(4)).ljust(100, b"\0")
    for degrees in (latitude_deg, longitude_deg):
        gps += struct.pack("<IIIIII", round(abs(degrees) * 1e6), 10**6, 0, 1, 0, 1)
    gps += struct.pack("<II", round(abs(altitude_m) * 1000), 1000)
    stated = "".join(f' drone-dji:{name}="{value}"' for name, value in dji.items())
    xmp = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"{stated}/></rdf:RDF></x:xmpmeta>'
    ).encode()
    xmp += b" " * (len(xmp) % 2)
    packet = [struct.pack("<HHII", 700, 1, len(xmp), place + len(gps))] if dji else []
    gps += xmp
    (first,) = struct.unpack_from("<I", content, 4)
    (count,) = struct.unpack_from("<H", content, first)
    old = [content[first + 2 + 12 * n : first + 14 + 12 * n] for n in range(count)]
    pointers = [struct.pack("<HHII", 34853, 4, 1, place), *packet]
    new = sorted([*old, *pointers], key=lambda e: struct.unpack("<H", e[:2]))
    directory = struct.pack("<H", len(new)) + b"".join(new) + bytes(4)
    moved = content[:4] + struct.pack("<I", place + len(gps)) + content[8:].ljust(place - 8, b"\0")
    return moved + gps + directory


def empty_lower_half(content: bytes) -> bytes:
    """As a card that was pulled leaves a file whose length had been set before."""
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        start, size = file.pages[0].dataoffsets[0], sum(file.pages[0].databytecounts)
    half = start + size // 2
    return content[:half] + bytes(start + size - half) + content[start + size :]


def forget_time(content: bytes, *, zone_only: bool = False) -> bytes:
    """The same file without the offset of its time, or without the time: the tags become unknown ones."""
    hidden = {36881: 7} if zone_only else {36881: 7, 36867: 20}
    for tag, length in hidden.items():
        entry = struct.pack("<HHI", tag, 2, length)
        assert content.count(entry) == 1
        content = content.replace(entry, struct.pack("<HHI", tag + 20_000, 2, length))
    return content
