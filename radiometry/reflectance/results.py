"""Inputs and results of a reflectance fit, and K at the time of a frame; what does not exist is None."""

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from radiometry.findings import Raised
from radiometry.fitting.curve import coverage_factor, find_dof
from radiometry.fitting.evidence import BudgetEntry, Exclusion, FrameEvidence, Quantity
from radiometry.frame import multispectral
from radiometry.records import Record, about, later
from radiometry.reflectance import imaging, sun, sunshine
from radiometry.specification.parameters import check_parameters, parameter

Normalisation = Literal["sunshine", "panel_only"]
Surface = Literal["level", "oriented"]
Level = Literal["eye", "measured"]
Interpolation = Literal["constant", "linear"]


_MEASURED_LEVEL_U_DEG = 0.3


class Params(Record):
    """Parameters of a reflectance fit."""

    normalisation: Normalisation = parameter(
        "sunshine",
        label="Normalised by",
        description="With the sunshine sensor K holds while the light changes; by the panel alone K holds "
        "for the light of the panel capture.",
        labels={"sunshine": "The sunshine sensor", "panel_only": "The panel alone: holds for one light"},
    )
    sunshine_choice: sunshine.Choice = parameter(
        "mean",
        label="Sunshine reading",
        description="Which of a file's valid readings of the sunshine sensor is used.",
        labels={"mean": "Mean of the valid ones", "last": "The last", "nearest": "The nearest in time"},
    )
    interpolation: Interpolation = parameter(
        "linear",
        label="Between panel captures",
        description="Linear: K(t) between them, by the time of each frame. Constant: the mean of all panel "
        "captures, with their difference in u(K).",
        labels={"constant": "One K", "linear": "K linear in time"},
    )
    drift_half_hour_rel: float = parameter(
        0.02,
        label="Assumed change of K",
        description="Relative standard deviation of K's change in half an hour, by drift and by light that "
        "is not modelled. It counts as four degrees of freedom, and the difference of two panel captures as "
        "one more.",
        bounds="[0, 1]",
        later=True,
    )
    incidence_angle_deg: float = parameter(
        0.0,
        label="Incidence angle",
        description="Angle between the panel's normal and the sun. The procedure calls it the angle of "
        "observation; for a diffuse panel the cosine belongs to the incoming light. 0: the panel lies as the "
        "sunshine sensor does, which is the usual way, and both see the same cosine. A measurement takes the "
        "same angle unless it states another.",
        unit="deg",
        bounds="[0, 90)",
    )
    incidence_angle_u_deg: float = parameter(
        2.0,
        label="Uncertainty of the incidence angle",
        description="Its standard uncertainty; 2 degrees is a panel levelled by eye. Its effect is that of "
        "the sun's zenith angle where the incidence angle is 0 and the file states position and time.",
        unit="deg",
        bounds="[0, 90)",
    )
    panel_level: Level = parameter(
        "eye",
        label="Level of the panel",
        description="By a bubble or an inclinometer the incidence angle is known to 0.3 degrees.",
        labels={"eye": "By eye", "measured": "By a bubble or an inclinometer"},
        later=True,
    )
    sunshine_surface: Surface = parameter(
        "level",
        label="Surface of the sunshine reading",
        description="Level: by the sensor's attitude and the sun's position, wherever the file states "
        "attitude, time and position.",
        labels={"level": "A level surface", "oriented": "As the sensor was oriented"},
    )
    tilt: sun.TiltParams | None = parameter(
        None,
        label="Tilt correction",
        description="Assumptions about sky and sensor for a reading on a level surface.",
        default_text="a clear sky, a PTFE diffuser, an attitude known to 2 degrees",
    )
    panel_measured_on: str | None = parameter(
        None,
        label="Measurement of the panel",
        description="Day of the one measurement of the panel to use, where several are registered.",
        kind="text",
        default_text="on the day of each panel frame, interpolated between the measurements",
        example="2026-03-14",
        later=True,
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def level_u_deg(self) -> float:
        """Standard uncertainty of the panel's angle to the sun."""
        measured = _MEASURED_LEVEL_U_DEG if self.panel_level == "measured" else math.inf
        return min(self.incidence_angle_u_deg, measured)

    @property
    def levelling(self) -> sun.TiltParams | None:
        """Assumptions with which readings are converted to a level surface; None if they are not."""
        return None if self.sunshine_surface == "oriented" else self.tilt or sun.TiltParams()


FrameRow = FrameEvidence[imaging.Features]


class Reading(Record):
    """Reflectance of the panel in one band, as its certificate states it."""

    panel: str
    band: str
    reflectance: float  # under these directions, (0, 1.2]
    standard_uncertainty: float | None = None  # absolute
    measured_on: str | None = later()  # ISO 8601
    # True if a camera, or the panel's code, states it: any measurement goes before it
    from_file: bool | None = later()

    def __post_init__(self) -> None:
        uncertainty = self.standard_uncertainty or 0.0
        if not (0.0 < self.reflectance <= 1.2 and 0.0 <= uncertainty < 1.0):
            raise ValueError(f"a reflectance that cannot be: {self}")


REFLECTANCE_UNIT = "1"
# The time over which `drift_half_hour_rel` is stated.
HALF_HOUR_S = 1800.0
# An assumed standard deviation counts as one from so many values: it is known to 35 % (JCGM 100, G.4.2).
ASSUMED_DOF = 4.0
# That of a single sunshine reading, 0.2 to 4.7 % by sensor.
READING_DOF = 1.0
_USUAL_DRIFT_REL = 0.02
_FAST_S = 300.0
# A clock that was set in between leaves years: the rule ends with the day.
_LONGEST_S = 86_400.0


class Knot(Record):
    """K at one panel capture."""

    at_s: float | None = about("Mean time on the camera's clock; None if it has none.")
    reflectance_k: float
    u_rel: float = about("Relative standard uncertainty of its own: noise, sunshine scatter and tilt.")
    half_span_s: float | None = later("From the mean time to the frame furthest from it.")
    level_u_rel: float | None = later("Part of `u_rel` from levelling the sunshine, alike in all bands.")
    level_effects: tuple[float, ...] | None = later(
        "Parts of `level_u_rel` that all captures share, each with its sign."
    )
    single_u_rel: float | None = later("Part of `u_rel` from single sunshine readings.")
    own_doubt: float | None = later(
        "Squares of the other relative variances that were estimated, each over its degrees of freedom."
    )

    @property
    def own_u_rel(self) -> float:
        return sun.take_away(self.u_rel, (self.level_u_rel or 0.0,))

    @property
    def own_level_u_rel(self) -> float:
        return sun.take_away(self.level_u_rel or 0.0, self.level_effects or ())


class Coefficient(Record):
    """Reflectance calibration of one band: all that `apply` needs, in plain fields.

    K = R cos(theta) I_ss / I_sq, for this camera and this sunshine sensor, and for the flight of the panel
    captures.
    """

    band: str
    reflectance_k: float
    reflectance_k_standard_uncertainty: float = about("From all sources.")
    reflectance_k_unit: str
    expanded_uncertainty: float = about("Of K, for a coverage probability of 95 %.")
    coverage_factor: float
    normalisation: Normalisation
    sunshine_choice: sunshine.Choice = about("Choice among the sunshine readings.")
    interpolation: Interpolation = about('"constant", or "linear" if K follows the knots.')
    tilt: sun.TiltParams | None = about("Assumptions of the tilt correction; None without it.")
    camera_serial: str | None
    sunshine_serial: str | None
    wavelength_nm: float | None
    incidence_angle_deg: float = about("Between the light and the panel's normal [deg].")
    panel: str
    panel_reflectance: float
    knots: tuple[Knot, ...] = about("K of the panel captures, in time.")
    shared_u_rel: float = about("From panel, angle and evenness, the same in every capture.")
    gain_u_rel: float = about("From the sunshine sensor's gain; it cancels at the same `gain_indices`.")
    drift_u_rel: float = about("From the difference of the captures, of a constant K.")
    gain_indices: tuple[int, ...] = about("Of the sunshine readings used; -1 - i for index i of channel 1.")
    sensor_model_scale: float = about(
        "A of SensorModel, a1 of RadiometricCalibration, or SensorGainAdjustment."
    )
    i_sq_range: tuple[float, float] = about("Lowest and highest signal used.")
    i_ss_range: tuple[float, float] | None = about(
        "Lowest and highest sunshine reading used; None for panel_only."
    )
    panel_measured_on: tuple[str, ...] | None = later(
        "Days of the panel's measurements used; None if none is dated."
    )
    drift_half_hour_rel: float | None = later(
        "Relative standard deviation of K's change in half an hour, from the assumed one and the "
        "differences between the captures."
    )
    reading_u_rel: float | None = later("Of a single sunshine reading; None if the frames had several.")
    reading_dof: float | None = later("Degrees of freedom of the noise of a single sunshine reading.")
    drift_dof: float | None = later("Degrees of freedom of `drift_half_hour_rel`.")
    channel_ratio: float | None = later(
        "CH0 / CH1 of a Sequoia's sunshine sensor under the panel's light, for a saturated CH0."
    )
    channel_ratio_u_rel: float | None = later()
    angle_u_rel: float | None = later("Part of `shared_u_rel` from the panel's angle, alike in all bands.")
    panel_light: tuple[sunshine.Light, ...] | None = later(
        "Readings of a light sensor at the panel with their attitude, by which a stale one is known."
    )


class Point(Record):
    """One panel frame in the fit."""

    frame: str
    band: str
    capture_id: str | None
    visit: int | None = about("Number of the panel capture, from 1.")
    at_s: float | None = about("Time on the camera's clock [s].")
    used: bool
    left_out: str = about('"" if it was used, else the reason.')
    i_sq: float | None = about("Signal of the panel.")
    i_sq_standard_uncertainty: float | None
    gradient_rel: float | None = about("Change of the signal across the region.")
    saturated_share: float | None = about("Saturated fraction of the region, 0 to 1.")
    i_ss: float | None = about("Sunshine reading.")
    sunshine_readings: int | None = about("Number of valid sunshine readings.")
    sunshine_spread_rel: float | None = about("Standard deviation of the readings / mean.")
    panel_reflectance: float | None
    panel_irradiance_w_m2_nm: float | None = about("On the panel, where radiance is known.")
    reflectance_k: float | None
    residual_rel: float | None = about("K of this frame relative to the coefficient's at its time, minus 1.")
    i_ss_oriented: float | None = later("Sunshine reading as the sensor was oriented.")
    i_ss_basis: multispectral.LightBasis | None = later("Surface for which `i_ss` holds.")


class BandFit(Record):
    """Result for one band."""

    coefficient: Coefficient
    budget: tuple[BudgetEntry, ...] = about("Contributions to u(K).")
    visits: int = about("Number of panel captures.")
    drift_rel: float | None = about("(K_last - K_first) / K; None for one capture.")


class Fit(Record):
    """A reflectance calibration: one coefficient per band, every point, every flag."""

    band_fits: tuple[BandFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]


class Doubt(Record, kw_only=False):
    """How well a variance is known.

    ``single``: its part by single light readings, whose noise is known with ``dof`` degrees of freedom.
    ``restless``: the squares of other estimated parts, each over its degrees of freedom.
    """

    single: float
    restless: float
    dof: float

    def scale(self, factor: float) -> "Doubt":
        return Doubt(self.single * factor**2, self.restless * factor**4, self.dof)

    def expand(self, variance: float) -> tuple[float, float]:
        """Return the coverage factor for 95 %, and the degrees of freedom that have it.

        By Welch and Satterthwaite [1], where what was not estimated has no end of freedom. A single reading
        may be twice as noisy as assumed, no more: its part, with at least two degrees, adds in squares.

        [1] JCGM 100:2008, G.4.1, doi:10.59161/JCGM100-2008E
        """
        rest, single = max(0.0, variance - self.single), coverage_factor(max(2.0, self.dof))
        others = coverage_factor(max(1.0, rest**2 / self.restless) if self.restless else math.inf)
        expanded = math.hypot(others * math.sqrt(rest), single * math.sqrt(self.single))
        k = expanded / math.sqrt(variance) if variance else others
        return k, find_dof(k)


class Effect(Record):
    """Effect of one standard uncertainty of one source on a reflectance."""

    source: str
    shared: bool  # the same in every region of the frame
    effect: float


class AppliedReflectance(Record):
    """Reflectance of a region in a new frame, with its flags."""

    band: str
    reflectance: Quantity
    i_sq: float
    i_ss: float | None  # None for a panel-only K
    reflectance_k: float  # at the frame's time
    effects: tuple[Effect, ...]
    flags: tuple[Raised, ...]
    i_ss_oriented: float | None = later()
    i_ss_basis: multispectral.LightBasis | None = later()
    doubt: Doubt | None = later()


class KAtTime(Record):
    """K at the time of a frame."""

    value: float
    u_rel: float  # from all sources but the sunshine gain and drift
    level_effects: tuple[float, ...]  # parts of `u_rel`: what captures share in levelling
    level_u_rel: float  # part of `u_rel`: of levelling beside those
    drift_u_rel: float  # from K's change between the panel visits and the frame
    single: float  # part of the relative variance by single readings
    restless: float  # of its other estimated parts, as in `Doubt`
    # to the nearest panel visit, negative before the first; 0 between or during visits, None if not known
    outside_s: float | None


def change_variance(after_s: float) -> float:
    """Compute the variance of K's change in a time, relative to that in half an hour.

    Half of it is a random walk (a sensor that drifts), half settles within minutes (light that is not
    modelled)::

        v(t) = (t / 30 min + 1 - exp(-t / 5 min)) / 2
    """
    time_s = min(abs(after_s), _LONGEST_S)
    return 0.5 * (time_s / HALF_HOUR_S - math.expm1(-time_s / _FAST_S))


def interpolate(
    knots: Sequence[Knot], *, at_s: float | None, follow: bool, drift_rel: float | None
) -> KAtTime:
    """Compute K(t) from the panel visits, with the uncertainty that they do not share.

    K(t) is the sum of w_i K_i over the visits: lines weigh the two around t by time, and before the first and
    after the last visit take the nearest. With the growth v(t) of `change_variance` [1]::

        u^2 = sum (w_i own_i)^2 + sum (w_i tilt_i)^2 + sum_j (sum_i w_i level_ij)^2
        drift^2 = d^2 (sum w_i v(t - t_i) - sum w_i w_j v(t_i - t_j) / 2)

    Without the time of the frame or of the visits K is the mean, and the drift d and the whole difference
    between visits. Versions of before the drift was estimated have the usual one.

    [1] N. Cressie, Statistics for Spatial Data (1993), section 3.2 (v/2 is a variogram),
    doi:10.1002/9781119115151
    """
    drift_rel = _USUAL_DRIFT_REL if drift_rel is None else drift_rel
    ks = [knot.reflectance_k for knot in knots]
    times = [knot.at_s for knot in knots if knot.at_s is not None]
    known_s = at_s if len(times) == len(knots) else None
    weights = [1.0 / len(knots)] * len(knots)
    if known_s is not None and follow:
        weights = _weigh(times, known_s)
    value = math.fsum(w * k for w, k in zip(weights, ks, strict=True))
    shares = [w * k / value for w, k in zip(weights, ks, strict=True)]
    effects = add_effects([knot.level_effects or () for knot in knots], shares)
    own_u_rel = math.hypot(*(w * knot.own_u_rel for w, knot in zip(shares, knots, strict=True)))
    level_u_rel = math.hypot(*(w * knot.own_level_u_rel for w, knot in zip(shares, knots, strict=True)))
    # what older captures have of their own counts as of single readings
    single = math.fsum(
        (w * (knot.own_u_rel if knot.single_u_rel is None else knot.single_u_rel)) ** 2
        for w, knot in zip(shares, knots, strict=True)
    )
    found = KAtTime(
        value=value,
        u_rel=math.hypot(own_u_rel, level_u_rel, *effects),
        level_effects=effects,
        level_u_rel=level_u_rel,
        drift_u_rel=math.hypot(drift_rel, (max(ks) - min(ks)) / value),
        single=single,
        restless=math.fsum(w**4 * (knot.own_doubt or 0.0) for w, knot in zip(shares, knots, strict=True)),
        outside_s=None,
    )
    if known_s is None:
        return found
    weighed = list(zip(weights, times, strict=True))
    variance = math.fsum(w * change_variance(known_s - t) for w, t in weighed) - 0.5 * math.fsum(
        w * v * change_variance(t - s) for w, t in weighed for v, s in weighed
    )
    first, last = (knots[end].half_span_s or 0.0 for end in (0, -1))
    return replace(
        found,
        drift_u_rel=drift_rel * math.sqrt(max(0.0, variance)),
        outside_s=min(0.0, known_s - times[0] + first) + max(0.0, known_s - times[-1] - last),
    )


def add_effects(effects: Sequence[Sequence[float]], weights: Sequence[float]) -> tuple[float, ...]:
    """Return the weighted sum, part by part, of effects that are shared; those of one without are zeros."""
    return tuple(
        math.fsum(w * part for w, part in zip(weights, parts, strict=True))
        for parts in itertools.zip_longest(*effects, fillvalue=0.0)
    )


def evaluate_k(coefficient: Coefficient, *, at_s: float | None) -> KAtTime:
    """Compute K(t) with its uncertainty by `interpolate`, and what all visits share."""
    found = interpolate(
        coefficient.knots,
        at_s=at_s,
        follow=coefficient.interpolation == "linear",
        drift_rel=coefficient.drift_half_hour_rel,
    )
    return replace(
        found,
        u_rel=math.hypot(found.u_rel, coefficient.shared_u_rel),
        drift_u_rel=math.hypot(found.drift_u_rel, coefficient.drift_u_rel),
        restless=found.restless + found.drift_u_rel**4 / (coefficient.drift_dof or ASSUMED_DOF),
    )


def _weigh(times: Sequence[float], at_s: float) -> list[float]:
    weights = [0.0] * len(times)
    at_s = min(max(at_s, times[0]), times[-1])
    right = bisect.bisect_left(times, at_s)
    weights[right] = 1.0
    if times[right] > at_s:
        weights[right] = (at_s - times[right - 1]) / (times[right] - times[right - 1])
        weights[right - 1] = 1.0 - weights[right]
    return weights
