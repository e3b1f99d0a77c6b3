"""Light, distance and surroundings of a calibration and of a measurement, and the kinds of lamps."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from radiometry.frame.statistics import ChannelStatistics
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import about, later
from radiometry.spectral.curves import list_lamps, read_lamp

LampKind = Literal["incandescent", "led", "led_ripple", "led_phase_dimmed", "sodium", "metal_halide"]
Interval = tuple[float, float]
Colour = tuple[float, float]

_ANY_DEPTH: Final[Interval] = (0.0, 1.0)
_SECOND_RADIATION_CONSTANT_NM_K = 1.438776877e7
_WHITE_LEDS = ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1")
LABELS: Final[dict[str, str]] = {
    "incandescent": "Incandescent or halogen",
    "led": "LED with a steady driver, undimmed or dimmed by its current",
    "led_ripple": "LED with a simple or unknown driver",
    "led_phase_dimmed": "LED dimmed by phase",
    "sodium": "High-pressure sodium",
    "metal_halide": "Metal halide",
}


def _tabulate_black_body(temperature_k: float) -> str:
    """Return the relative spectrum of a black body as a table of wavelength [nm] and value."""
    return "\n".join(
        f"{nm},{(560 / nm) ** 5 / math.expm1(_SECOND_RADIATION_CONSTANT_NM_K / (nm * temperature_k))}"
        for nm in range(380, 781, 5)
    )


class _Kind(NamedTuple):
    """Smallest and largest modulation depth of a kind of lamps, and the spectra that it may have.

    Depth is (L_max - L_min) / (L_max + L_min) on the mains. That of LEDs with a steady driver, also where the
    current dims them, follows IEEE 1789, which calls up to 0.08 % per hertz a low risk: 8 % at 100 Hz and 9.6
    % at 120 Hz [1]. The other intervals are assumed, and a measured depth replaces them. Heat smooths the
    light of filaments. Metal halide lamps have magnetic or electronic ballasts, so that theirs may be
    anything.

    Spectra are those of the CIE [2]; of filaments also black bodies of 2400 and 3200 K, a dimmed lamp and
    that of a studio.

    [1] IEEE Std 1789-2015, doi:10.1109/IEEESTD.2015.7118618
    [2] CIE 015:2018, doi:10.25039/TR.015.2018
    """

    modulation: Interval
    lamps: tuple[str, ...]


_KINDS: Final[dict[LampKind, _Kind]] = {
    "incandescent": _Kind((0.05, 0.15), ("A", _tabulate_black_body(2400), _tabulate_black_body(3200))),
    "led": _Kind((0.0, 0.1), _WHITE_LEDS),
    "led_ripple": _Kind((0.0, 0.3), _WHITE_LEDS),
    "led_phase_dimmed": _Kind((0.3, 1.0), _WHITE_LEDS),
    "sodium": _Kind((0.5, 1.0), ("HP1", "HP2")),
    "metal_halide": _Kind(_ANY_DEPTH, ("HP3", "HP4", "HP5")),
}


def find_modulation(kind: LampKind | None, stated: float | None) -> Interval:
    """Return the modulation depths that a lamp may have: the stated one, else those of its kind, else any."""
    if stated is not None:
        return stated, stated
    return _KINDS[kind].modulation if kind else _ANY_DEPTH


def list_spectra(kind: LampKind | None, stated: str | None) -> tuple[str, ...]:
    """Return the spectra that a lamp may have: the stated one, else those of its kind, else none."""
    if stated is not None:
        return (stated,)
    return _KINDS[kind].lamps if kind else ()


@dataclass(frozen=True, kw_only=True)
class CalibrationConditions:
    """Lamp and distance of a calibration, as its campaign states them; None for what is not known."""

    lamp: str | None = field(default=None, metadata=about("Spectrum: a name of the library, or a table."))
    camera_response: str | None = field(default=None, metadata=about("A name of the library, or a table."))
    colour: Colour | None = field(
        default=None, metadata=about("R/G and B/G above dark of the light frames; the median over them.")
    )
    focus_distance_m: float | None = field(
        default=None, metadata=about("From the lens to the calibrated surface [m].")
    )
    focal_length_mm: float | None = None
    lamp_kind: LampKind | None = later("All that is known of the lamp's spectrum if `lamp` is None.")


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
        check_parameters(self)
        if self.light_source is not None:
            read_lamp(self.light_source)


def measure_colour(
    statistics: Sequence[ChannelStatistics], *, dark_above_black_dn: float, most_u_rel: float = math.inf
) -> Colour | None:
    """Compute R/G and B/G of a region; None if a channel is missing, not above dark or too uncertain.

    ``dark_above_black_dn`` is the same in all channels, ``most_u_rel`` the largest relative standard error
    that the mean of a channel may have.
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
