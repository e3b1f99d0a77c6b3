"""What a stranger can do at every door, in the order in which it is done."""

import io
import os
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pypdf import PdfReader

from tests.journeys.plan import Corners, Figure, File, Plan
from tests.support.compose import ROOT


class Door(ABC):
    """One way to the service at ``url`` with ``key``; ``folder`` is where it keeps what it writes itself.

    A door may put off a step until a later one needs it, as the pages register a camera with its card.
    A version is named by its id.
    """

    def __init__(self, url: str, key: str, folder: Path):
        self.url, self.key, self.folder = url, key, folder

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    @abstractmethod
    def register(self, plan: Plan) -> None:
        """Register camera, meters and panel; what is registered already stays as it is."""

    @abstractmethod
    def begin(self, plan: Plan) -> None:
        """Begin the campaign."""

    @abstractmethod
    def send(self, plan: Plan) -> None:
        """Send every file of the plan, and wait until each is read. Those that are refused stop none."""

    @abstractmethod
    def set_region(self, plan: Plan) -> None:
        """Set the region, or the regions by their names."""

    @abstractmethod
    def type_readings(self, plan: Plan) -> None: ...

    @abstractmethod
    def fit(self, plan: Plan) -> str:
        """Fit, wait for it, and return the draft."""

    @abstractmethod
    def publish(self, version: str, *, valid_from: str, valid_to: str | None = None, reason: str) -> None:
        """Put a version in force from a day, until another one or for good. Days are 2026-05-01."""

    @abstractmethod
    def look_up(self, plan: Plan, name: str, *, at: str | None = None, **where: float | str) -> Figure:
        """Return the one coefficient in force of that name; ``where``: iso, f_number, band, channel ..."""

    @abstractmethod
    def measure(self, plan: Plan, file: File, region: Corners) -> Figure:
        """Measure a frame that was sent with the plan, and return its mean."""

    @abstractmethod
    def judge_fleet(self, method: str, serials: Sequence[str], *, tolerance: float) -> dict[str, str]:
        """Return the verdict on each parameter: shared, per_camera or cannot_tell."""

    @abstractmethod
    def find_motion_px(self, plan: Plan, file: File, **flight: float) -> float:
        """Return the forward motion in a frame that was sent with the plan.

        ``flight`` : focal_length_mm, pixel_pitch_um, ground_speed_m_s, distance_m
        """

    @abstractmethod
    def take_certificate(self, version: str) -> "Certificate":
        """Return the certificate, and where `make verify` finds what it was made from."""


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """The PDF as a file's content; ``place`` and ``data`` are CERT and DATA of `make verify`."""

    pdf: bytes
    place: str | Path
    data: str | Path


def conclude(door: Door, version: str) -> None:
    """End a journey: the certificate opens, and everything on it is what comes out again."""
    certificate = door.take_certificate(version)
    pages = PdfReader(io.BytesIO(certificate.pdf)).pages
    assert version in "".join(page.extract_text() for page in pages)
    # as `make verify` calls it
    again = subprocess.run(
        [sys.executable, "-m", "verify", certificate.place, "--data", certificate.data],
        cwd=ROOT,
        env=os.environ | {"STILB_KEY": door.key, "COLUMNS": "200"},
        check=False,
        capture_output=True,
        text=True,
    )
    assert again.returncode == 0, again.stdout + again.stderr
