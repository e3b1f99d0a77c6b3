"""Input of every method's measuring, and the products that it leaves."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.multispectral import Multispectral
from store import codec, software
from store.blobs import Blobs
from store.measuring.record import Products
from store.queries.frame_times import read_header
from store.tables import Calibration, FrameRow
from worker.decode.pool import DecoderPool, Readable
from worker.maps.making import Made

_COPY_BYTES = 1 << 20


@dataclass(frozen=True, kw_only=True)
class Task:
    """A frame, its file and its plan; the verifier measures with one too, without a database."""

    decoders: DecoderPool
    blobs: Blobs
    lend: Callable[[str], AbstractContextManager[tuple[FrameRow, Readable]]]
    frame: FrameRow
    file: Readable
    calibration: Calibration
    parameters: dict[str, Any]
    report: Callable[[float], None]

    @cached_property
    def header(self) -> FrameHeader:
        """The file's header, with the zone that the plan states for its clock."""
        return read_header(self.frame, self.parameters.get("time_zone"))

    @property
    def band(self) -> Multispectral:
        assert self.header.multispectral is not None  # noqa: S101  the plan refused files without one
        return self.header.multispectral

    @property
    def exposure(self) -> Exposure:
        return codec.decode_exposure(self.frame.exposure or {})

    @property
    def wants_map(self) -> bool:
        return "map" in self.parameters["products"]

    @property
    def wants_bands(self) -> bool:
        return "bands" in self.parameters["products"]

    def open_repeats(self) -> Iterator[Readable]:
        """Return the files of further frames with which the frame is averaged, one open at a time."""
        for repeat in self.parameters.get("repeats", []):
            with self.lend(repeat["frame_id"]) as (_, file), self.decoders.hold(file):
                yield file

    def caption(self, more: str = "") -> str:
        return f"{self.frame.filename}{more}, calibration version {self.calibration.version}"

    def make_products(self, write: Callable[[Path], Made]) -> tuple[Made, Products]:
        """Keep the file that is written, and its picture."""
        with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
            target = Path(folder) / "map.tif"
            made = write(target)
            with target.open("rb") as file:
                tif = self.blobs.keep(iter(partial(file.read, _COPY_BYTES), b""))
            return made, Products(tif=tif, png=self.blobs.keep([made.picture]))

    def describe(self, **more: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return ImageDescription, so that a map that has left its place still names what it is."""
        calibration, exposure = self.calibration, self.frame.exposure or {}
        return {
            **more,
            "calibration": {
                "id": calibration.id,
                "version": calibration.version,
                "content_sha256": calibration.content_sha256,
            },
            **{name: self.parameters[name] for name in ("repeats",) if name in self.parameters},
            "frame": {"id": self.frame.id, "sha256": self.frame.sha256, "filename": self.frame.filename},
            "exposure": {
                name: exposure[name] for name in ("exposure_time_s", "f_number", "iso") if name in exposure
            },
            "software": {"stilb": software.read_version(), "measurer": software.MEASURER},
        }
