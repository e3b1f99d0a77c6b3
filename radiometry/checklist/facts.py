"""Facts of a campaign that the rules of the checklist evaluate."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FrameFacts:
    """One frame that was read.

    Attributes
    ----------
    name : str
        Name of the frame.
    role : str
        "light" or "dark".
    scene : str or None
        Name of the light level.
    container : str
        File format, as in `FrameHeader`.
    rendered : bool
        True if the frame is a converted image.
    manual : bool or None
        True if the file states manual exposure; None if it does not state the mode.
    exposure_time_s : float
        Exposure time [s].
    f_number : float
        F-number.
    iso : float
        ISO value.
    typed_in : tuple of str
        Names of the exposure values that the file lacks and a person entered.
    extracted : bool
        True if its statistics in its present region exist.
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
    """Result of a version for one ISO value.

    Attributes
    ----------
    iso : float
        ISO value.
    model : str
        Name of the fitted model.
    luminance_k, luminance_k_standard_uncertainty : float
        Coefficient K and its standard uncertainty, in `luminance_k_unit`.
    luminance_k_unit : str
        Unit of K.
    dark_signal_dn : float
        Dark signal [DN].
    dark_frames : int
        Number of frames whose median is the dark signal.
    points : int
        Number of points.
    """

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
    """A calibration version of the campaign.

    Attributes
    ----------
    version : int
        Number of the version.
    isos : tuple of IsoFacts
        Results, one per ISO value.
    """

    version: int
    isos: tuple[IsoFacts, ...]


@dataclass(frozen=True, kw_only=True)
class Facts:
    """A campaign.

    Attributes
    ----------
    project_number : str or None
        Number of the project, if recorded.
    started_on, started_at : str or None
        Date and time of the start, if recorded.
    recorder : str or None
        Person who records, if recorded.
    frames : tuple of FrameFacts
        Light and dark frames, in the order of their names.
    unread : tuple of str
        Names of the frames that are not read yet.
    readings : mapping of str to tuple of float
        Valid luminance readings by scene [cd/m2].
    region : tuple of tuple[float, float]
        Corners [x, y] of the campaign's region [px]; empty if none was drawn.
    version : VersionFacts or None
        Newest version that was not revoked.
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
