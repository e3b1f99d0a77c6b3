"""Kinds of lamps: how deep their light flickers, and which spectra they may have."""

import math
from typing import Final, Literal, NamedTuple

LampKind = Literal["incandescent", "led", "led_ripple", "led_phase_dimmed", "sodium", "metal_halide"]
Interval = tuple[float, float]

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
