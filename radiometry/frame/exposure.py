"""Exposure settings of a file in nominal and in APEX values, and quantities derived from them."""

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
    """The three values that enter the equations, on one basis.

    Attributes
    ----------
    exposure_time_s : float
        Exposure time t [s].
    f_number : float
        F-number f.
    iso : float
        ISO value S.
    """

    exposure_time_s: float
    f_number: float
    iso: float


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """Exposure settings of one frame, each with its origin.

    Attributes
    ----------
    exposure_time_s, f_number, iso : float
        Nominal values where the file has them; exposure time in seconds.
    exposure_time_apex_s, f_number_apex : float or None, default: None
        2^-Tv [s] and 2^(Av/2) from the APEX tags; None where the file lacks them.
    exposure_time_origin, f_number_origin, iso_origin : str, default: "exif"
        "exif" (nominal), "apex" (nominal value missing) or "supplied" (both
        missing; entered by a user).
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
        """Return the settings on the nominal or the APEX basis.

        Parameters
        ----------
        basis : {"nominal", "apex"}
            Basis of exposure time and f-number. A missing APEX value is replaced by
            the nominal one.

        Returns
        -------
        Settings
            The three settings on that basis.

        Notes
        -----
        The basis matters: f/11 stands for 2^3.5 = 11.314, 5.5 % in L; 1/60 s for
        1/64 s, 6.7 %. Nominal is the default: it is what a field team writes down.
        A K that was fitted with nominal values and is applied with nominal values
        contains the same error of a nominal value twice, in opposite directions.
        """
        time_s, f_number = self.exposure_time_s, self.f_number
        if basis == "apex":
            time_s = self.exposure_time_apex_s or time_s
            f_number = self.f_number_apex or f_number
        return Settings(exposure_time_s=time_s, f_number=f_number, iso=self.iso)

    @property
    def has_apex(self) -> bool:
        """True if both APEX values are known."""
        return self.exposure_time_apex_s is not None and self.f_number_apex is not None


def is_plausible(name: str, value: float) -> bool:
    """Return True if an exposure value lies within PLAUSIBLE; NaN and infinity do not.

    Returns
    -------
    bool
        False outside the range.
    """
    low, high = PLAUSIBLE[name]
    return math.isfinite(value) and low <= value <= high


def require_plausible(settings: Settings) -> None:
    """Refuse settings that no camera has.

    Parameters
    ----------
    settings : Settings
        Settings to check.

    Raises
    ------
    InputRejected
        `exposure_implausible` if one of them is outside PLAUSIBLE.
    """
    for name, (low, high) in PLAUSIBLE.items():
        value = getattr(settings, name)
        if not is_plausible(name, value):
            raise InputRejected(
                shared.EXPOSURE_IMPLAUSIBLE,
                f"{name} = {value:g} is not a setting of a camera: it must lie between {low:g} and {high:g}.",
            )


def compute_rhs(settings: Settings, *, luminance_cd_m2: float) -> float:
    """Compute the right-hand side of the calibration equation, X = t S L / f^2.

    Parameters
    ----------
    settings : Settings
        Exposure time, ISO value and f-number.
    luminance_cd_m2 : float
        Luminance L [cd/m2].

    Returns
    -------
    float
        X [cd*s/m2 times ISO], equation 1 of the procedure [1]_.

    References
    ----------
    .. [1] Standard operating procedure "Drone Camera Calibration", equation 1
    """
    return settings.exposure_time_s * settings.iso * luminance_cd_m2 / settings.f_number**2


def expect_luminance_k(*, black_level_dn: float, white_level_dn: float) -> float:
    """Compute the luminance K of a camera whose ISO value is rated by saturation.

    Parameters
    ----------
    black_level_dn, white_level_dn : float
        Black and white level [DN].

    Returns
    -------
    float
        K = (white - black) / 120 [DN*m2/(cd*s)]: about 137 for 14 bits, 34 for 12,
        2.1 for 8.

    Notes
    -----
    ISO 12232 [1]_ rates S so that the sensor saturates at H = 78 / S; with H = 0.65
    t L / f^2 this is X = 120.

    References
    ----------
    .. [1] ISO 12232:2019, saturation-based speed
    """
    return (white_level_dn - black_level_dn) / SATURATION_RHS
