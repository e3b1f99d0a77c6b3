"""K of one band from its panel frames, with its budget, before and after the flight."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.fitting.curve import coverage_factor
from radiometry.fitting.evidence import BudgetEntry
from radiometry.frame.multispectral import Multispectral, RadianceModel, SensorModel
from radiometry.reflectance.clock import locate_sun_of
from radiometry.reflectance.evaluation import evaluate_k
from radiometry.reflectance.micasense import panel_irradiance
from radiometry.reflectance.points import Candidate
from radiometry.reflectance.results import BandFit, Coefficient, Knot, Point
from radiometry.reflectance.rows import Normalisation, Params

# Beyond this zenith angle the light of a panel is mostly the sky's.
_STEEPEST_DEG = 80.0
# A difference that may lie anywhere between two visits, as a rectangular distribution.
_RECTANGLE = 1.0 / math.sqrt(12.0)


@dataclass(frozen=True)
class _Frame:
    """K of one panel frame, and its errors that no other frame shares."""

    candidate: Candidate
    k: float
    noise_u_rel: float
    sunshine_u_rel: float
    level_u_rel: float


@dataclass(frozen=True)
class _Own:
    """Errors that panel captures do not share, as relative variances of K, with degrees of freedom."""

    noise: float
    sunshine: float
    level: float
    repeat: float
    dof: float

    @property
    def total(self) -> float:
        return self.noise + self.sunshine + self.level + self.repeat


def compute_k(*, reflectance: float, incidence_angle_deg: float, i_sq: float, i_ss: float | None) -> float:
    """Compute K = R cos(theta) I_ss / I_sq.

    Parameters
    ----------
    reflectance : float
        Reflectance R of the panel.
    incidence_angle_deg : float
        Angle theta between the light and the panel's normal [deg].
    i_sq : float
        Signal I_sq of the panel.
    i_ss : float or None
        Sunshine reading I_ss; None leaves it out.

    Returns
    -------
    float
        K, as in section 4c of [1]_.

    References
    ----------
    .. [1] "How to convert Sequoia images to reflectance?" 1.1, section 4c
    """
    lit = reflectance * math.cos(math.radians(incidence_angle_deg))
    return lit * (1.0 if i_ss is None else i_ss) / i_sq


def fit_band(used: Sequence[Candidate], params: Params) -> BandFit:
    """Fit K of one band.

    Parameters
    ----------
    used : sequence of Candidate
        Panel frames in the order of time, at least one.
    params : Params
        Parameters of the fit.

    Returns
    -------
    BandFit
        Coefficient with its budget.

    Notes
    -----
    K of a panel capture is the mean over its frames. K of the flight is the mean
    over the captures, or K(t) on straight lines between them::

        u_rel(K)^2 = panel^2 + angle^2 + evenness^2 + gain^2 + drift^2
                     + (noise^2 + sunshine^2 + tilt^2 + repeat^2)

        panel     u(R)/R, with the panel's change between or after its measurements (`find_value`)
        angle     tan(theta) u_theta and u_theta^2 / 2: the cosine's first and second order;
                  theta is the sun's zenith angle where none is stated
        evenness  gradient across the region / sqrt(12)
        gain      of the sunshine sensor's gain indices, which all frames share
        drift     |K_last - K_first| / (K sqrt(12)) of a constant K; K(t) follows it
        tilt      of the sunshine sensor's attitude and the diffuse fraction, alike in a capture
        repeat    by how much the frames of a capture scatter beyond their noise
    """
    frames = [_measure(candidate, params) for candidate in used]
    visits = [
        [frame for frame in frames if frame.candidate.visit == number]
        for number in sorted({frame.candidate.visit for frame in frames})
    ]
    owns = [_judge_visit(visit) for visit in visits]
    knots = tuple(_knot(visit, own) for visit, own in zip(visits, owns, strict=True))
    k = statistics.fmean(knot.reflectance_k for knot in knots)
    drift_rel = (knots[-1].reflectance_k - knots[0].reflectance_k) / k if len(knots) > 1 else None
    count = len(owns) ** 2
    panels = [each.panel for each in used if each.panel]
    sources = {
        "panel reflectance": ("B", max(p.standard_uncertainty / p.reflectance for p in panels)),
        "panel angle": ("B", _angle_u_rel(used, params)),
        "panel evenness": (
            "B",
            _RECTANGLE * statistics.fmean(f.candidate.features.gradient_rel for f in frames),
        ),
        "sunshine gain": ("B", max((c.sunshine.gain_u_rel for c in used if c.sunshine), default=0.0)),
        "drift": ("B", _RECTANGLE * abs(drift_rel or 0.0) if params.interpolation == "constant" else 0.0),
        "pixel noise": ("A", math.sqrt(sum(own.noise for own in owns) / count)),
        "sunshine readings": ("A", math.sqrt(sum(own.sunshine for own in owns) / count)),
        "sunshine tilt": ("B", math.sqrt(sum(own.level for own in owns) / count)),
        "repeat of the panel": ("A", math.sqrt(sum(own.repeat for own in owns) / count)),
    }
    coefficient = _build(
        used, params, knots, k=k, sources={name: u for name, (_, u) in sources.items()}, owns=owns
    )
    total = math.fsum(u**2 for _, u in sources.values())
    return BandFit(
        coefficient=coefficient,
        budget=tuple(
            BudgetEntry(source=name, kind=kind, u_rel=u, variance_share=u**2 / total if total else 0.0)
            for name, (kind, u) in sources.items()
        ),
        visits=len(visits),
        drift_rel=drift_rel,
    )


def _measure(candidate: Candidate, params: Params) -> _Frame:
    features, sunshine, panel = candidate.features, candidate.sunshine, candidate.panel
    assert panel is not None  # noqa: S101  frames without one are left out
    k = compute_k(
        reflectance=panel.reflectance,
        incidence_angle_deg=params.incidence_angle_deg,
        i_sq=features.i_sq,
        i_ss=sunshine.i_ss if sunshine else None,
    )
    return _Frame(
        candidate=candidate,
        k=k,
        noise_u_rel=features.i_sq_standard_uncertainty / features.i_sq,
        sunshine_u_rel=sunshine.standard_uncertainty / sunshine.i_ss if sunshine else 0.0,
        level_u_rel=sunshine.level_u_rel if sunshine else 0.0,
    )


def _judge_visit(visit: Sequence[_Frame]) -> _Own:
    """Compare the predicted scatter of the frames with the observed one; the larger of the two counts."""
    n = len(visit)
    noise = sum(frame.noise_u_rel**2 for frame in visit) / n**2
    sunshine = sum(frame.sunshine_u_rel**2 for frame in visit) / n**2
    scatter = 0.0
    if n > 1:
        values = [frame.k for frame in visit]
        scatter = (statistics.stdev(values) / statistics.fmean(values)) ** 2 / n
    repeat = max(0.0, scatter - noise - sunshine)
    level = statistics.fmean(frame.level_u_rel for frame in visit) ** 2
    return _Own(
        noise=noise, sunshine=sunshine, level=level, repeat=repeat, dof=n - 1.0 if repeat > 0.0 else math.inf
    )


def _knot(visit: Sequence[_Frame], own: _Own) -> Knot:
    times = [frame.candidate.at_s for frame in visit if frame.candidate.at_s is not None]
    return Knot(
        at_s=statistics.fmean(times) if times else None,
        reflectance_k=statistics.fmean(frame.k for frame in visit),
        u_rel=math.sqrt(own.total),
    )


def _angle_u_rel(used: Sequence[Candidate], params: Params) -> float:
    suns = [sun for each in used if (sun := locate_sun_of(each.row.header)) is not None]
    angle_deg = params.incidence_angle_deg or max((90.0 - sun.elevation_deg for sun in suns), default=0.0)
    u, theta = math.radians(params.incidence_angle_u_deg), math.radians(min(angle_deg, _STEEPEST_DEG))
    return math.hypot(math.tan(theta) * u, u**2 / 2.0)


def _build(
    used: Sequence[Candidate],
    params: Params,
    knots: tuple[Knot, ...],
    *,
    k: float,
    sources: dict[str, float],
    owns: Sequence[_Own],
) -> Coefficient:
    first, panels = used[0], [each.panel for each in used if each.panel]
    panel = panels[0]  # frames without one are left out
    u_rel = math.hypot(*sources.values())
    # Welch and Satterthwaite: what is not a visit's scatter has no end of freedom
    restless = math.fsum((own.total / len(owns) ** 2) ** 2 / own.dof for own in owns)
    factor = coverage_factor(u_rel**4 / restless if restless > 0.0 else math.inf)
    sunshine = [candidate.sunshine for candidate in used if candidate.sunshine]
    return Coefficient(
        band=first.band.band,
        reflectance_k=k,
        reflectance_k_standard_uncertainty=k * u_rel,
        reflectance_k_unit=unit_of_k(first.band, params.normalisation),
        expanded_uncertainty=factor * k * u_rel,
        coverage_factor=factor,
        normalisation=params.normalisation,
        sunshine_choice=params.sunshine_choice,
        interpolation=params.interpolation,
        tilt=params.levelling,
        camera_serial=first.row.header.serial,
        sunshine_serial=first.band.sunshine_serial if sunshine else None,
        wavelength_nm=first.band.wavelength_nm,
        incidence_angle_deg=params.incidence_angle_deg,
        panel=panel.panel,
        panel_reflectance=panel.reflectance,
        panel_measured_on=tuple(sorted({day for p in panels for day in p.measured_on})) or None,
        knots=knots,
        shared_u_rel=math.hypot(
            *(sources[name] for name in ("panel reflectance", "panel angle", "panel evenness"))
        ),
        gain_u_rel=sources["sunshine gain"],
        drift_u_rel=sources["drift"],
        gain_indices=tuple(sorted({index for each in sunshine for index in each.gain_indices})),
        sensor_model_scale=find_scale(first.band),
        i_sq_range=_range([candidate.features.i_sq for candidate in used]),
        i_ss_range=_range([each.i_ss for each in sunshine]) if sunshine else None,
    )


def find_scale(band: Multispectral) -> float:
    """Return the coefficient that sets the scale of a band's signal.

    Returns
    -------
    float
        A of a Sequoia, a1 of a MicaSense camera, SensorGainAdjustment of a DJI
        camera; 0 if the file has none.
    """
    if isinstance(band.response, SensorModel):
        return band.response.a
    if isinstance(band.response, RadianceModel):
        return band.response.a1
    return band.response.adjustment if band.response is not None else 0.0


def unit_of_k(band: Multispectral, normalisation: Normalisation) -> str:
    """Return the unit of R I_ss / I_sq."""
    if isinstance(band.response, SensorModel):
        return "1/s" if normalisation == "sunshine" else "1"
    if isinstance(band.response, RadianceModel):
        return "sr" if normalisation == "sunshine" else "m2*sr*nm/W"
    return "s"  # the light sensor's unit is its own


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def describe_point(candidate: Candidate, params: Params, fit: BandFit | None) -> Point:
    """Describe a panel frame as it is stored, used or not.

    Parameters
    ----------
    candidate : Candidate
        Panel frame.
    params : Params
        Parameters of the fit.
    fit : BandFit or None
        Result of the band; None if the band was not fitted.
    """
    features, sunshine, panel = candidate.row.features, candidate.sunshine, candidate.panel
    k = residual = None
    if not candidate.left_out and fit is not None:
        k = _measure(candidate, params).k
        residual = k / evaluate_k(fit.coefficient, at_s=candidate.at_s).value - 1.0
    return Point(
        frame=candidate.row.frame,
        band=candidate.band.band,
        capture_id=candidate.band.capture_id,
        visit=candidate.visit,
        at_s=candidate.at_s,
        used=not candidate.left_out,
        left_out=candidate.left_out,
        i_sq=features.i_sq if features else None,
        i_sq_standard_uncertainty=features.i_sq_standard_uncertainty if features else None,
        gradient_rel=features.gradient_rel if features else None,
        saturated_share=features.statistics.saturated_share if features else None,
        i_ss=sunshine.i_ss if sunshine else None,
        i_ss_oriented=sunshine.oriented if sunshine else None,
        sunshine_readings=sunshine.readings if sunshine else None,
        sunshine_spread_rel=sunshine.spread_rel if sunshine else None,
        panel_reflectance=panel.reflectance if panel else None,
        panel_irradiance_w_m2_nm=_find_irradiance(candidate),
        reflectance_k=k,
        residual_rel=residual,
    )


def _find_irradiance(candidate: Candidate) -> float | None:
    """Return what a light sensor should read: a hundred times more or less is another unit."""
    features, panel = candidate.row.features, candidate.panel
    if candidate.band.radiance_model is None or candidate.left_out or features is None or panel is None:
        return None
    return panel_irradiance(features.i_sq, albedo=panel.reflectance)
