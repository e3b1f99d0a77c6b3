"""Coefficients of each camera of a fleet, as determined in each campaign."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, order=True, kw_only=True)
class Key:
    """Identity of a parameter: values with equal keys may be compared.

    Attributes
    ----------
    iso, f_number, band, channel : float or str or None
        What the parameter holds for; None where it holds for all.
    """

    name: str
    unit: str
    model: str
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None

    def __str__(self) -> str:
        """Return the name as used in a sentence: luminance_k at ISO 3200."""
        said = [
            f"ISO {self.iso:g}" if self.iso is not None else "",
            f"f/{self.f_number:g}" if self.f_number is not None else "",
            f"band {self.band}" if self.band is not None else "",
            f"channel {self.channel}" if self.channel is not None else "",
        ]
        where = ", ".join(part for part in said if part)
        return f"{self.name} at {where}" if where else self.name


@dataclass(frozen=True, kw_only=True)
class Source:
    """One calibration version, with its camera and campaign.

    Attributes
    ----------
    version : str
        Its id.
    camera, lens : str, str or None
        Serial numbers of body and lens; None where the lens is unknown.
    campaign : str
        Versions of one campaign share their frames and readings, and with them their errors.
    at : datetime
        When it was determined, with its time zone.
    """

    version: str
    camera: str
    lens: str | None
    campaign: str
    at: datetime


@dataclass(frozen=True, kw_only=True)
class Determination:
    """One value of one parameter, with its standard uncertainty [the key's unit]."""

    key: Key
    value: float
    standard_uncertainty: float
    source: Source


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A version that is not used, with the reason as a sentence."""

    version: str
    why: str


def keep_repeats(sources: Sequence[Source]) -> tuple[tuple[Source, ...], tuple[LeftOut, ...]]:
    """Return the last version of each campaign: only another campaign repeats a determination.

    Two versions of one campaign are two evaluations of the same frames and readings. Their agreement is no
    evidence of repeatability; counted as two they would make it too small.

    Parameters
    ----------
    sources : sequence of Source
        In any order; the last of a campaign is the last given.

    Returns
    -------
    kept : tuple of Source
        By camera and time.
    left_out : tuple of LeftOut
        The others, with the reason.
    """
    last = {(source.camera, source.campaign): source for source in sources}
    kept = sorted(last.values(), key=lambda source: (source.camera, source.at, source.version))
    left_out = tuple(
        LeftOut(
            version=source.version,
            why=f"Version {last[source.camera, source.campaign].version} is of the same campaign and newer: "
            "evaluated twice is not repeated.",
        )
        for source in sources
        if last[source.camera, source.campaign] is not source
    )
    return tuple(kept), left_out
