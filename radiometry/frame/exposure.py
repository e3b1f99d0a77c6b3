"""Exposure of a frame, and the acceptance of a frame for a campaign."""

import math

from radiometry.findings import InputRejected, files, shared
from radiometry.frame import FrameHeader
from radiometry.records import Record
from radiometry.specification.roles import CHART

# Wider than any camera, narrower than nonsense. The shortest electronic shutters reach 1/32000 s, stacked
# exposures last an hour; lenses run from f/0.7 to f/64, pinholes to f/300; ISO from 1 to a few million.
PLAUSIBLE = {"exposure_time_s": (1e-6, 86400.0), "f_number": (0.5, 512.0), "iso": (1.0, 1e7)}

# ISO 12232 saturation speed: H_sat = 78 / S [lx*s], and H = 0.65 t L / f^2 at the sensor: t S L / f^2 = 120.
SATURATION_RHS = 120.0


class Settings(Record):
    """The three values that enter the equations, on one basis."""

    exposure_time_s: float  #: Exposure time t [s]
    f_number: float
    iso: float


class Exposure(Record):
    """Exposure settings of one frame, each with its origin."""

    exposure_time_s: float  #: Nominal values where the file has them; exposure time in seconds
    f_number: float
    iso: float
    #: 2^-Tv [s] and 2^(Av/2) from the APEX tags; None where the file lacks them
    exposure_time_apex_s: float | None = None
    f_number_apex: float | None = None
    #: "exif" (nominal), "apex" (nominal value missing) or "supplied" (both missing; entered by a user)
    exposure_time_origin: str = "exif"
    f_number_origin: str = "exif"
    iso_origin: str = "exif"

    def on_basis(self, basis: str) -> Settings:
        """Return the settings on the nominal or the APEX basis.

        A missing APEX value is replaced by the nominal one.

        The basis matters: f/11 stands for 2^3.5 = 11.314, 5.5 % in L; 1/60 s for 1/64 s, 6.7 %. Nominal is
        the default: it is what a field team writes down. A K that was fitted with nominal values and is
        applied with nominal values contains the same error of a nominal value twice, in opposite directions.
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
    """Return True if an exposure value lies within PLAUSIBLE; NaN and infinity do not."""
    low, high = PLAUSIBLE[name]
    return math.isfinite(value) and low <= value <= high


def require_plausible(settings: Settings) -> None:
    for name, (low, high) in PLAUSIBLE.items():
        value = getattr(settings, name)
        if not is_plausible(name, value):
            raise shared.EXPOSURE_IMPLAUSIBLE.reject(
                f"{name} = {value:g} is not a setting of a camera: it must lie between {low:g} and {high:g}."
            )


def compute_rhs(settings: Settings, *, luminance_cd_m2: float) -> float:
    """Compute the right-hand side of the calibration equation, X = t S L / f^2.

    [1] Standard operating procedure "Drone Camera Calibration", equation 1
    """
    return settings.exposure_time_s * settings.iso * luminance_cd_m2 / settings.f_number**2


def expect_luminance_k(*, black_level_dn: float, white_level_dn: float) -> float:
    """Compute the luminance K of a camera whose ISO value is rated by saturation.

    ISO 12232 [1] rates S so that the sensor saturates at H = 78 / S; with H = 0.65 t L / f^2 this is X = 120.

    [1] ISO 12232:2019, saturation-based speed
    """
    return (white_level_dn - black_level_dn) / SATURATION_RHS


# Made for the eye by a camera or a converter: a tone curve, and nothing of the sensor's numbers.
_PICTURES = {"jpeg": "JPEG", "png": "PNG"}

_WORDS = {"exposure_time_s": "exposure time", "f_number": "f-number", "iso": "ISO value"}
_SUPPLIED_TOLERANCE_REL = 0.10


class Camera(Record):
    """The campaign's camera, as it was registered."""

    make: str  #: Manufacturer, model and serial number
    model: str
    serial: str


class SuppliedExposure(Record):
    """Exposure values that a user entered with the frame; None for a value that was not entered."""

    exposure_time_s: float | None = None
    f_number: float | None = None
    iso: float | None = None


class Acceptance(Record):
    """An accepted frame."""

    exposure: Exposure | None  #: Exposure of the frame; None only for a chart that states none
    flags: tuple[str, ...]  #: Codes of the flags that were raised


class _Value(Record, kw_only=False):
    number: float
    origin: str


def accept_frame(
    header: FrameHeader,
    *,
    role: str,
    supplied: SuppliedExposure,
    camera: Camera,
    manual_exposure: bool = True,
) -> Acceptance:
    """Accept a frame for a role in a campaign, or refuse it.

    Each of the three exposure values is the first plausible one of the file's
    nominal value, the file's APEX value, and the entered value. Zero in a file
    means "not written". An entered value never replaces that of the file.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the file.
    role : str
        Role of the frame.
    supplied : SuppliedExposure
        Exposure values that the user entered.
    camera : Camera
        The campaign's camera.
    manual_exposure : bool, default: True
        False for a method whose cameras choose their exposure as intended.

    Returns
    -------
    Acceptance
        Exposure and flags: `rendered`, `statistics_from_table`, `exposure_not_manual`, `serial_unknown`,
        `black_level_assumed`, `exposure_from_apex`, `exposure_supplied`, `supplied_exposure_ignored`.

    Raises
    ------
    InputRejected
        `not_a_raw_file` for a JPEG or PNG image, unless it shows a chart. `wrong_camera` if the file names
        another make, model or serial number. `exposure_missing` or `exposure_implausible` if a value is
        needed and not available; a chart needs none.
    """
    _refuse_pictures(header, role)
    _refuse_other_camera(header, camera)
    # a chart is measured for its geometry and sharpness: its exposure enters no equation
    needs_exposure = role != CHART.name
    flags = _header_flags(header, manual_required=manual_exposure and needs_exposure)
    try:
        found = _find_exposure(header, supplied)
    except InputRejected:
        if needs_exposure:
            raise
        return Acceptance(exposure=None, flags=tuple(flags))
    flags += _exposure_flags(found, supplied)
    exposure = Exposure(
        exposure_time_s=found["exposure_time_s"].number,
        f_number=found["f_number"].number,
        iso=found["iso"].number,
        exposure_time_apex_s=_plausible_or_none("exposure_time_s", header.exposure_time_apex_s),
        f_number_apex=_plausible_or_none("f_number", header.f_number_apex),
        exposure_time_origin=found["exposure_time_s"].origin,
        f_number_origin=found["f_number"].origin,
        iso_origin=found["iso"].origin,
    )
    return Acceptance(exposure=exposure, flags=tuple(flags))


def _refuse_pictures(header: FrameHeader, role: str) -> None:
    """Refuse a JPEG or PNG image wherever light is measured; a chart may be one."""
    picture = _PICTURES.get(header.container)
    if picture is not None and role != CHART.name:
        raise files.NOT_A_RAW_FILE.reject(
            f"The file is a {picture} picture, in which the sensor's numbers are lost; only frames of the "
            f"role chart may be pictures, this one's is {role}. Send the camera's raw file (DNG), or a TIFF."
        )


def _refuse_other_camera(header: FrameHeader, camera: Camera) -> None:
    """Refuse a file that names another camera; what the file does not name cannot be compared."""
    for word, stated, registered in (
        ("serial number", header.serial, camera.serial),
        ("model", header.model, camera.model),
        ("make", header.make, camera.make),
    ):
        if _plain(stated) and _plain(stated) != _plain(registered):
            raise shared.WRONG_CAMERA.reject(
                f"This file was taken by another camera: its {word} is {_shown(stated)}, the campaign's "
                f"camera is {camera.make} {camera.model}, serial number {camera.serial}. Upload the file to "
                "its own campaign, or register the camera with the names that it writes into its files."
            )


def _plain(text: str | None) -> str:
    """Fold case and blanks: firmware pads names with blanks and zero bytes."""
    return " ".join((text or "").replace("\0", " ").split()).casefold()


def _shown(text: str | None) -> str:
    return repr(" ".join((text or "").replace("\0", " ").split())[:80])


def _header_flags(header: FrameHeader, *, manual_required: bool) -> list[str]:
    flags: list[str] = []
    if header.rendered:
        flags.append(shared.RENDERED)
    if header.table is not None:
        flags.append(shared.STATISTICS_FROM_TABLE)
    if manual_required and _chosen_by_camera(header):
        flags.append(shared.EXPOSURE_NOT_MANUAL)
    if not _plain(header.serial):
        flags.append(shared.SERIAL_UNKNOWN)
    if header.assumes_black:
        flags.append(shared.BLACK_LEVEL_ASSUMED)
    return flags


def _chosen_by_camera(header: FrameHeader) -> bool:
    """Return True if the file states automatic exposure; the mode has priority over the program."""
    if header.exposure_mode is not None:
        return header.exposure_mode != "manual"
    return header.exposure_program not in (None, "manual", "not_defined")


def _find_exposure(header: FrameHeader, supplied: SuppliedExposure) -> dict[str, _Value]:
    return {
        "exposure_time_s": _choose(
            "exposure_time_s",
            [
                (header.exposure_time_s, "exif"),
                (header.exposure_time_apex_s, "apex"),
                (supplied.exposure_time_s, "supplied"),
            ],
        ),
        "f_number": _choose(
            "f_number",
            [(header.f_number, "exif"), (header.f_number_apex, "apex"), (supplied.f_number, "supplied")],
        ),
        "iso": _choose("iso", [(header.iso, "exif"), (supplied.iso, "supplied")]),
    }


def _choose(name: str, candidates: list[tuple[float | None, str]]) -> _Value:
    """Return the first plausible candidate; a missing value and zero are ignored."""
    stated = [_Value(number, origin) for number, origin in candidates if number]
    for value in stated:
        if is_plausible(name, value.number):
            return value
    word = _WORDS[name]
    if stated:
        low, high = PLAUSIBLE[name]
        raise shared.EXPOSURE_IMPLAUSIBLE.reject(
            f"The {word} of this frame cannot be right: {stated[0].number:g} ({_source(stated[0].origin)}). "
            f"It must lie between {low:g} and {high:g}. Upload the frame again with the {word} from your "
            f"notes typed in ({name})."
        )
    raise shared.EXPOSURE_MISSING.reject(
        f"The file does not say the {word} of this frame (it is missing or zero). Upload it again with the "
        f"{word} from your notes typed in ({name}), or use the camera's original file."
    )


def _source(origin: str) -> str:
    return "as typed in" if origin == "supplied" else "as the file says"


def _exposure_flags(found: dict[str, _Value], supplied: SuppliedExposure) -> list[str]:
    origins = {value.origin for value in found.values()}
    flags: list[str] = []
    if "apex" in origins:
        flags.append(shared.EXPOSURE_FROM_APEX)
    if "supplied" in origins:
        flags.append(shared.EXPOSURE_SUPPLIED)
    for name, value in found.items():
        typed = getattr(supplied, name)
        if typed and not abs(typed / value.number - 1.0) <= _SUPPLIED_TOLERANCE_REL:
            flags.append(shared.SUPPLIED_EXPOSURE_IGNORED)
            break
    return flags


def _plausible_or_none(name: str, value: float | None) -> float | None:
    return value if value is not None and is_plausible(name, value) else None
