"""Exposure settings: what the file says, in nominal and in APEX values, and what follows from them."""

import math
from dataclasses import dataclass

from radiometry.findings import InputRejected, shared

# Wider than any camera, narrower than nonsense. The shortest electronic shutters reach 1/32000 s, stacked
# exposures last an hour; lenses run from f/0.7 to f/64, pinholes to f/300; ISO from 1 to a few million.
PLAUSIBLE = {
    "exposure_time_s": (1e-6, 86400.0),
    "f_number": (0.5, 512.0),
    "iso": (1.0, 1e7),
}

# ISO 12232 saturation speed: H_sat = 78 / S [lx*s], and H = 0.65 t L / f^2 at the sensor: t S L / f^2 = 120.
SATURATION_RHS = 120.0


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The three numbers that enter the equations, on one basis."""

    exposure_time_s: float
    f_number: float
    iso: float


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """The exposure of a frame, with where each value came from.

    ``exposure_time_s``, ``f_number``, ``iso`` : nominal where the file has them
    ``exposure_time_apex_s``, ``f_number_apex`` : 2^-Tv and 2^(Av/2), None where the file lacks them
    ``*_origin`` : "exif" (nominal), "apex" (nominal missing), "supplied" (both missing; typed in)
    """

    exposure_time_s: float
    f_number: float
    iso: float
    exposure_time_apex_s: float | None = None
    f_number_apex: float | None = None
    exposure_time_origin: str = "exif"
    f_number_origin: str = "exif"
    iso_origin: str = "exif"

    def on_basis(self, basis: str) -> Settings:
        """Give the settings on the nominal or the APEX basis; where APEX is missing the nominal value stands.

        The basis matters: f/11 stands for 2^3.5 = 11.314, 5.5 % in L; 1/60 s for 1/64 s, 6.7 %. Nominal is
        the default: it is what a field team writes down, and K found with nominal values and applied with
        nominal values carries the same error of a marking twice, in opposite directions.
        """
        time_s, f_number = self.exposure_time_s, self.f_number
        if basis == "apex":
            time_s = self.exposure_time_apex_s or time_s
            f_number = self.f_number_apex or f_number
        return Settings(exposure_time_s=time_s, f_number=f_number, iso=self.iso)

    @property
    def has_apex(self) -> bool:
        """Whether both APEX values are known."""
        return self.exposure_time_apex_s is not None and self.f_number_apex is not None


def is_plausible(name: str, value: float) -> bool:
    """Say whether an exposure value lies within PLAUSIBLE; NaN and infinity do not."""
    low, high = PLAUSIBLE[name]
    return math.isfinite(value) and low <= value <= high


def require_plausible(settings: Settings) -> None:
    """Refuse settings that no camera has.

    Raises InputRejected(exposure_implausible)
    """
    for name, (low, high) in PLAUSIBLE.items():
        value = getattr(settings, name)
        if not is_plausible(name, value):
            raise InputRejected(
                shared.EXPOSURE_IMPLAUSIBLE,
                f"{name} = {value:g} is not a setting of a camera: it must lie between {low:g} and {high:g}.",
            )


def compute_rhs(settings: Settings, *, luminance_cd_m2: float) -> float:
    """Give the right-hand side of the calibration equation, X = t S L / f^2 [cd*s/m2 times ISO].

    Source: the luminance procedure, equation 1.
    """
    return settings.exposure_time_s * settings.iso * luminance_cd_m2 / settings.f_number**2


def expect_luminance_k(*, black_level_dn: float, white_level_dn: float) -> float:
    """Give the luminance K that a camera rated by saturation has, K = (white - black) / 120 [DN*m2/(cd*s)].

    ISO 12232 rates S so that the sensor saturates at H = 78 / S; with H = 0.65 t L / f^2 this is X = 120.
    About 137 for 14 bits, 34 for 12, 2.1 for 8.
    References ISO 12232:2019, saturation-based speed
    """
    return (white_level_dn - black_level_dn) / SATURATION_RHS
