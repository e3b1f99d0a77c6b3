"""What a fleet is judged by: each camera's coefficients, determined anew in each campaign."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, order=True, kw_only=True)
class Key:
    """What makes two coefficients the same parameter, so that their values may be compared.

    ``iso``, ``f_number``, ``band``, ``channel`` : what it holds for, None where it holds for all
    """

    name: str
    unit: str
    model: str
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None

    def __str__(self) -> str:
        """Name it as a sentence does: luminance_k at ISO 3200."""
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
    """One calibration version: whose it is, and what it was made from.

    ``version`` : its id; ``camera`` : serial number of the body; ``lens`` : of the lens, None where unknown
    ``campaign`` : versions of one campaign share their frames and readings, and with them their errors
    ``at`` : when it was determined, with its time zone
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
    """A version that is not used, and why, as a sentence."""

    version: str
    why: str


def keep_repeats(sources: Sequence[Source]) -> tuple[tuple[Source, ...], tuple[LeftOut, ...]]:
    """Keep the last version of each campaign: only another campaign repeats a determination.

    Two versions of one campaign are two evaluations of the same frames and readings. What they agree in says
    nothing about repeatability, and counted as two they would make it too small.

    Takes
      sources : in any order; the last of a campaign is the last given
    Returns the kept ones by camera and time, and the others with the reason
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
