"""Light, distance and surroundings that K was calibrated under, and those of a measurement."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance.lamp_kinds import LABELS, LampKind
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import LATER
from radiometry.spectral.curves import list_lamps, read_lamp

Colour = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class CalibrationConditions:
    """Lamp and distance of a calibration, as its campaign states them; None for what is not known.

    Attributes
    ----------
    lamp, camera_response : str or None, default: None
        Spectrum and response, each a name of the library or a table.
    colour : tuple[float, float] or None, default: None
        R/G and B/G of the light frames, dark signal subtracted; the median over the frames.
    focus_distance_m, focal_length_mm : float or None, default: None
        Distance from the lens to the calibrated surface [m], and focal length [mm].
    lamp_kind : str or None, default: None
        Kind of the lamp, whose spectrum is only known by it if `lamp` is None.
    """

    lamp: str | None = None
    camera_response: str | None = None
    colour: Colour | None = None
    focus_distance_m: float | None = None
    focal_length_mm: float | None = None
    lamp_kind: LampKind | None = field(default=None, metadata=LATER)


@dataclass(frozen=True, kw_only=True)
class FieldConditions:
    """Light and surroundings of a measurement, as it states them; None for what is not known."""

    light_source: str | None = parameter(
        None,
        kind="text",
        suggest=list_lamps,
        label="Light source",
        description="Spectrum of the light on the surface: a lamp of the library, or a table of wavelength "
        "in nm and value.",
        default_text="unknown",
        example="LED-B3",
    )
    spectral_mismatch_u_rel: float | None = parameter(
        None,
        label="Uncertainty of the spectral mismatch",
        description="Relative standard uncertainty of L from the spectrum, in place of the one that is "
        "estimated.",
        default_text="estimated, or 10 % where a spectrum is unknown",
        example=0.05,
        bounds="[0, 1)",
    )
    distance_m: float | None = parameter(
        None,
        label="Distance",
        description="From the lens to the measured surface, to which the lens is focused.",
        default_text="unknown",
        unit="m",
        example=30.0,
        bounds="[0.1, 1e5]",
    )
    lamp_kind: LampKind | None = parameter(
        None,
        label="Kind of lamp",
        description="Of the measured light. It states how deep the light flickers, and which spectra it may "
        "have.",
        labels=LABELS,
        default_text="the campaign's, else anything",
        example="led",
        displaced_by=("lamp_kind", "light_source"),
    )
    mains_frequency_hz: float | None = parameter(
        None,
        label="Mains frequency",
        description="Of the supply of the measured light, which flickers at twice this frequency; 0 for "
        "direct current.",
        default_text="the campaign's, else 50 or 60 Hz",
        unit="Hz",
        example=50.0,
        displaced_by=("lamp_kind",),
        bounds="[0, 500]",
    )
    flicker_modulation: float | None = parameter(
        None,
        name="lamp_modulation",
        label="Modulation depth",
        description="(L_max - L_min) / (L_max + L_min) of the measured light over a period of its flicker, "
        "where it was measured.",
        default_text="the campaign's, else that of the kind of lamp, else anything from 0 to 1",
        example=0.3,
        displaced_by=("lamp_kind", "light_source"),
        bounds="[0, 1]",
    )
    glare_share: float | None = parameter(
        None,
        label="Glare",
        description="Luminance of a black trap in such a scene, as the camera shows it, over the mean of the "
        "whole frame.",
        default_text="unknown",
        example=0.02,
        bounds="[0, 0.5]",
    )

    def __post_init__(self) -> None:
        """Check every value against its range, and that the light is known or can be read."""
        check_parameters(self)
        if self.light_source is not None:
            read_lamp(self.light_source)


def measure_colour(
    statistics: Sequence[ChannelStatistics], *, dark_above_black_dn: float, most_u_rel: float = math.inf
) -> Colour | None:
    """Compute the raw colour of a region.

    Parameters
    ----------
    statistics : sequence of ChannelStatistics
        Statistics of the region, one row per channel.
    dark_above_black_dn : float
        Dark signal above the black level, the same in all channels [DN].
    most_u_rel : float, default: inf
        Largest relative standard error that the mean of a channel may have.

    Returns
    -------
    tuple[float, float] or None
        R/G and B/G; None if a channel is missing, not above dark, or less certain than that.
    """
    means: dict[str, list[float]] = {"R": [], "G": [], "B": []}
    for row in statistics:
        if row.channel[0] in means:
            mean = row.mean_dn - row.black_level_dn - dark_above_black_dn
            if row.std_dn > most_u_rel * mean * math.sqrt(row.n):
                return None
            means[row.channel[0]].append(mean)
    if not all(values and min(values) > 0.0 for values in means.values()):
        return None
    red, green, blue = (sum(values) / len(values) for values in means.values())
    return red / green, blue / green
