"""What the record knows of a campaign: all that the checklist's rules look at."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FrameFacts:
    """One frame that was read.

    ``role`` : "light" | "dark"; ``scene`` : the light level's name
    ``manual`` : whether the exposure was set by hand, as the file says; None where it says nothing
    ``typed_in`` : the exposure values that the file lacks and somebody typed in
    ``extracted`` : its statistics in its present region exist
    """

    name: str
    role: str
    scene: str | None
    container: str
    rendered: bool
    manual: bool | None
    exposure_time_s: float
    f_number: float
    iso: float
    typed_in: tuple[str, ...]
    extracted: bool


@dataclass(frozen=True, kw_only=True)
class IsoFacts:
    """What a version found for one ISO value. ``dark_frames`` : how many its dark signal is the median of."""

    iso: float
    model: str
    luminance_k: float
    luminance_k_standard_uncertainty: float
    luminance_k_unit: str
    dark_signal_dn: float
    dark_frames: int
    points: int


@dataclass(frozen=True, kw_only=True)
class VersionFacts:
    """A calibration version of the campaign. ``plot`` : where its plot is."""

    version: int
    plot: str
    isos: tuple[IsoFacts, ...]


@dataclass(frozen=True, kw_only=True)
class Facts:
    """A campaign.

    ``frames`` : light and dark, in the order of their names; ``unread`` : names of those that wait
    ``readings`` : scene -> luminance readings [cd/m2] that stand
    ``region`` : the corners [x, y] that hold for the campaign; empty where none was drawn
    ``version`` : the newest that was not revoked
    """

    project_number: str | None
    started_on: str | None
    started_at: str | None
    recorder: str | None
    frames: tuple[FrameFacts, ...]
    unread: tuple[str, ...]
    readings: Mapping[str, tuple[float, ...]]
    region: tuple[tuple[float, float], ...]
    version: VersionFacts | None
