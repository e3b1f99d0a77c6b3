"""Kinds of lamps: how deep each flickers, and which spectra it may have."""

import math
from dataclasses import dataclass
from functools import cache
from typing import Final, Literal

LampKind = Literal["incandescent", "led", "led_ripple", "led_phase_dimmed", "sodium", "metal_halide"]
Interval = tuple[float, float]

ANY_DEPTH: Final[Interval] = (0.0, 1.0)
_SECOND_RADIATION_CONSTANT_NM_K = 1.438776877e7
_WHITE_LEDS = ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1")
_FILAMENTS_K = (2400, 3200)


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Depths of flicker and spectra that are assumed of a kind of lamps.

    Attributes
    ----------
    label : str
        Name of the kind on forms.
    modulation : tuple[float, float]
        Smallest and largest modulation depth on the mains.
    lamps : tuple of str
        Lamps of the library, or tables, that its spectrum may be like.
    """

    label: str
    modulation: Interval
    lamps: tuple[str, ...]


@cache
def get_kind(name: LampKind) -> Kind:
    """Return what is assumed of a kind of lamps.

    Notes
    -----
    Modulation depth on the mains, (L_max - L_min) / (L_max + L_min). That of LEDs with a steady driver, also
    where the current dims them, follows IEEE 1789, which calls up to 0.08 % per hertz a low risk: 8 % at
    100 Hz and 9.6 % at 120 Hz [1]_. The other intervals are assumed, and a measured depth replaces them:
    0.05 to 0.15 of filaments, whose heat smooths the light; up to 0.3 of LEDs with a simple or unknown driver
    and 0.3 to 1 of those dimmed by phase; 0.5 to 1 of high-pressure sodium. Metal halide lamps have magnetic
    or electronic ballasts, so that theirs may be anything.

    Spectra are those of the CIE [2]_; of filaments also black bodies of 2400 and 3200 K, a dimmed lamp and
    that of a studio.

    References
    ----------
    .. [1] IEEE Std 1789-2015, doi:10.1109/IEEESTD.2015.7118618
    .. [2] CIE 015:2018, doi:10.25039/TR.015.2018
    """
    filaments = ("A", *(_tabulate_black_body(temperature_k) for temperature_k in _FILAMENTS_K))
    return {
        "incandescent": Kind(label=LABELS[name], modulation=(0.05, 0.15), lamps=filaments),
        "led": Kind(label=LABELS[name], modulation=(0.0, 0.1), lamps=_WHITE_LEDS),
        "led_ripple": Kind(label=LABELS[name], modulation=(0.0, 0.3), lamps=_WHITE_LEDS),
        "led_phase_dimmed": Kind(label=LABELS[name], modulation=(0.3, 1.0), lamps=_WHITE_LEDS),
        "sodium": Kind(label=LABELS[name], modulation=(0.5, 1.0), lamps=("HP1", "HP2")),
        "metal_halide": Kind(label=LABELS[name], modulation=ANY_DEPTH, lamps=("HP3", "HP4", "HP5")),
    }[name]


LABELS: Final[dict[str, str]] = {
    "incandescent": "Incandescent or halogen",
    "led": "LED with a steady driver, undimmed or dimmed by its current",
    "led_ripple": "LED with a simple or unknown driver",
    "led_phase_dimmed": "LED dimmed by phase",
    "sodium": "High-pressure sodium",
    "metal_halide": "Metal halide",
}


def find_modulation(kind: LampKind | None, stated: float | None) -> Interval:
    """Return the modulation depths that a lamp may have: the stated one, else those of its kind, else any."""
    if stated is not None:
        return stated, stated
    return get_kind(kind).modulation if kind else ANY_DEPTH


def list_spectra(kind: LampKind | None, stated: str | None) -> tuple[str, ...]:
    """Return the spectra that a lamp may have: the stated one, else those of its kind, else none."""
    if stated is not None:
        return (stated,)
    return get_kind(kind).lamps if kind else ()


@cache
def _tabulate_black_body(temperature_k: float) -> str:
    """Return the relative spectrum of a black body as a table of wavelength [nm] and value."""
    return "\n".join(
        f"{nm},{(560 / nm) ** 5 / math.expm1(_SECOND_RADIATION_CONSTANT_NM_K / (nm * temperature_k))}"
        for nm in range(380, 781, 5)
    )
