"""What the paper says of each method: its procedure in words, its equation, the columns of its points."""

from dataclasses import dataclass
from typing import Literal, assert_never

from radiometry.methods import Method

Form = Literal["text", "number", "percent"]


@dataclass(frozen=True, kw_only=True)
class Column:
    """One figure of a point in print. ``name`` : in the point; ``share`` : of the table's width."""

    name: str
    head: str
    form: Form = "number"
    share: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A method's words.

    ``headlines`` : the coefficients that stand on the first page, all others in a table of their own
    ``traceability`` : "" where meters or panels say it
    ``holds_for_lens`` : a certificate that names no lens lacks something
    ``statements`` : that only this method makes
    """

    procedure: str
    equation: str
    headlines: frozenset[str]
    columns: tuple[Column, ...]
    traceability: str = ""
    holds_for_lens: bool = True
    statements: tuple[str, ...] = ()


def describe_paper(method: Method) -> Paper:
    """Give a method's words."""
    match method:
        case "luminance":
            return _LUMINANCE
        case "reflectance":
            return _REFLECTANCE
        case "vignetting":
            return _VIGNETTING
        case "sharpness":
            return _SHARPNESS
        case "geometry":
            return _GEOMETRY
        case "noise":
            return _NOISE
        case _:
            assert_never(method)


_FRAME = Column(name="frame", head="frame", form="text", share=2.4)

_LUMINANCE = Paper(
    procedure="Luminance coefficient K of a camera against a luminance meter, one per ISO value, after the "
    "standard operating procedure “Drone Camera Calibration”; K by generalised least squares",
    equation="N - D = K X,  X = t S L / f²",
    headlines=frozenset({"luminance_k"}),
    columns=(),  # its sheets are its own
    statements=(
        (
            "The verdict compares the largest deviation of a point from the luminance meter with the "
            "tolerance; the measurement uncertainty is not taken into account in the decision."
        ),
    ),
)

_REFLECTANCE = Paper(
    procedure="Reflectance coefficient K of each band of a camera with its sunshine sensor, from frames of a "
    "panel of known reflectance",
    equation="R cos θ = K I_sq / I_ss: I_sq the band's signal after black and vignetting, I_ss the sunshine "
    "sensor's reading",
    headlines=frozenset({"reflectance_k"}),
    columns=(
        _FRAME,
        Column(name="band", head="band", form="text"),
        Column(name="visit", head="visit", share=0.6),
        Column(name="i_sq", head="I_sq"),
        Column(name="i_ss", head="I_ss"),
        Column(name="sunshine_spread_rel", head="spread of I_ss", form="percent"),
        Column(name="gradient_rel", head="gradient", form="percent"),
        Column(name="reflectance_k", head="K"),
        Column(name="residual_rel", head="deviation", form="percent"),
    ),
    holds_for_lens=False,
    statements=(
        (
            "K belongs to the camera and the sunshine sensor named here together, and to the light of the "
            "day on which the panel was photographed."
        ),
        "The vignetting is corrected as each file states it for its camera.",
    ),
)

_VIGNETTING = Paper(
    procedure="Falloff of the light over the frame, one per f-number and channel, from frames of an even "
    "surface; centre and coefficients by weighted least squares",
    equation="(N - D) / A = 1 + k1 r² + k2 r⁴ + k3 r⁶, r = 1 at half of the frame's diagonal from the "
    "fitted centre",
    headlines=frozenset({"corner_falloff"}),
    columns=(
        _FRAME,
        Column(name="role", head="role", form="text", share=0.7),
        Column(name="f_number", head="f/", share=0.6),
        Column(name="signal_share", head="signal", form="percent"),
        Column(name="saturated_share", head="saturated", form="percent"),
        Column(name="gradient_rel", head="gradient", form="percent"),
        Column(name="gradient_standard_uncertainty_rel", head="u(gradient)", form="percent"),
    ),
    traceability="A ratio of light within one frame: no standard from outside enters. Uneven light is sought "
    "in the frames themselves, and told among the flags.",
)

_SHARPNESS = Paper(
    procedure="Contrast that the camera keeps at each fineness, per position and channel, from slanted edges "
    "(ISO 12233, e-SFR) or Siemens stars",
    equation="MTF(f) = |F{LSF}(f)| / |F{LSF}(0)|, f in cycles per pixel of the whole sensor",
    headlines=frozenset({"mtf50_cycles_per_pixel", "resolving_power_cycles_per_pixel"}),
    columns=(
        _FRAME,
        Column(name="position", head="position", form="text", share=1.2),
        Column(name="channel", head="channel", form="text"),
        Column(name="f_number", head="f/", share=0.6),
        Column(name="value", head="f [c/px]"),
        Column(name="standard_uncertainty", head="u(f)"),
        Column(name="residual_rel", head="deviation", form="percent"),
    ),
    traceability="Lengths are counted in pixels of the camera itself: no standard from outside enters. Line "
    "pairs per millimetre rest on the pixel pitch that is stated for the camera.",
)

_GEOMETRY = Paper(
    procedure="Principal distance, principal point and distortion of the camera, from views of a plane "
    "board; camera and poses by least squares over all corners",
    equation="col = fx x' + cx, row = fy y' + cy, (x', y') the direction distorted by k1, k2, k3, p1, p2",
    headlines=frozenset({"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2", "rms_px"}),
    columns=(
        _FRAME,
        Column(name="corners", head="corners", share=0.8),
        Column(name="rms_px", head="rms [px]"),
        Column(name="largest_px", head="largest [px]"),
        Column(name="tilt_deg", head="tilt [°]"),
        Column(name="distance_mm", head="distance [mm]"),
        Column(name="edge_rise_px", head="edge rise [px]"),
    ),
    traceability="Figures in pixels rest on the board's shape, not on its size: no standard from outside "
    "enters. Distances rest on the square size and the pixel pitch that are stated.",
)

_NOISE = Paper(
    procedure="Temporal noise, system gain, linearity and nonuniformity per ISO value and channel, from "
    "stacks of equal frames, by the definitions of EMVA 1288",
    equation="var_y - var_dark = K (mu_y - mu_dark)",
    headlines=frozenset({"system_gain_dn_per_e", "read_noise_e", "full_well_e", "dynamic_range_stops"}),
    columns=(
        _FRAME,
        Column(name="channel", head="channel", form="text", share=0.8),
        Column(name="role", head="role", form="text", share=0.7),
        Column(name="iso", head="ISO", share=0.8),
        Column(name="exposure_time_s", head="t [s]"),
        Column(name="mean_dn", head="mean [DN]", share=1.2),
        Column(name="clipped_share", head="clipped", form="percent"),
        Column(name="frames_of_setting", head="frames alike"),
    ),
    traceability="Electrons are counted by the statistics of the light itself: no standard from outside "
    "enters.",
    holds_for_lens=False,
)
