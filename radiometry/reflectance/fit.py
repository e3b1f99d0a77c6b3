"""K of each band from its panel frames with its budget, and K at the time of another frame."""

import itertools
import math
import statistics
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from radiometry.findings import Raised
from radiometry.fitting.evidence import BudgetEntry
from radiometry.frame import EARLIEST_YEAR
from radiometry.frame.multispectral import Multispectral, RadianceModel, SensorModel
from radiometry.records import Record
from radiometry.reflectance import codes, results
from radiometry.reflectance.points import Candidate
from radiometry.reflectance.results import ASSUMED_DOF, READING_DOF, BandFit, Coefficient, Knot, Params, Point
from radiometry.reflectance.sun import Angles, locate_suns_of, read_clock, take_away, turned_deg
from radiometry.reflectance.sunshine import (
    LARGEST_TILT_DEG,
    SINGLE_READING_U_REL,
    compare_channels,
    see_light,
)

_CLOCK_JUMP_S = 60.0
_FLIGHT_DAY_S = 12 * 3600.0
# Beyond this zenith angle the light of a panel is mostly the sky's.
_STEEPEST_DEG = 80.0
# A difference that may lie anywhere between two visits, as a rectangular distribution.
_RECTANGLE = 1.0 / math.sqrt(12.0)


class PanelFrame(Record, kw_only=False):
    """K of one panel frame, and its errors that no other frame shares."""

    candidate: Candidate
    k: float
    noise_u_rel: float
    sunshine_u_rel: float
    level_u_rel: float

    @property
    def is_single(self) -> bool:
        """Return True if the frame has one sunshine reading, whose scatter it does not show."""
        return self.candidate.sunshine is not None and self.candidate.sunshine.is_single


class Estimate(Record, kw_only=False):
    """A relative standard deviation and its degrees of freedom."""

    rel: float
    dof: float


class Visit(Record, kw_only=False):
    """A visit to the panel in one band: its errors of its own as relative variances of K."""

    number: int
    knot: Knot
    noise: float
    sunshine: float
    repeat: float


def check_times(used: Sequence[Candidate]) -> tuple[list[Candidate], list[Raised]]:
    """Check the times of the panel frames, and drop those that contradict each other."""
    times = sorted(each.at_s for each in used if each.at_s is not None)
    if not times:
        return list(used), [
            codes.PANEL_TIMES_DOUBTFUL.at("", "No panel frame states its time: one visit is assumed.")
        ]
    jump = _find_jump(used)
    if jump:
        return [replace(each, at_s=None) for each in used], [codes.PANEL_TIMES_DOUBTFUL.at("", jump)]
    apart_s = max((b - a for a, b in itertools.pairwise(times)), default=0.0)
    if apart_s > _FLIGHT_DAY_S:
        detail = f"Two visits to the panel are {apart_s / 3600.0:.0f} hours apart."
        return list(used), [codes.PANEL_TIMES_DOUBTFUL.at("", detail)]
    return list(used), []


def _find_jump(used: Sequence[Candidate]) -> str:
    """Return how the clock jumped between the visits, by its years or the time since the start."""
    unset = {at.year < EARLIEST_YEAR for each in used if (at := read_clock(each.row.header)) is not None}
    if len(unset) > 1:
        return "The clock was set between the visits to the panel: some frames are dated before 2000."
    starts: dict[str, list[float]] = {}
    for each in used:
        if each.at_s is not None and each.band.exposed_at_us is not None and each.band.flight_id:
            starts.setdefault(each.band.flight_id, []).append(each.at_s - each.band.exposed_at_us * 1e-6)
    jump_s = max((max(found) - min(found) for found in starts.values()), default=0.0)
    if jump_s > _CLOCK_JUMP_S:
        return f"The clock jumped by {jump_s:.0f} s against the time since the camera's start."
    return ""


def pool_readings(bands: Sequence[Sequence[Sequence[PanelFrame]]]) -> Estimate:
    """Estimate the noise of a single sunshine reading.

    An assumed s_0 with one degree of freedom, the scatter of x = ln K within the n frames of each visit and
    band, and over the bands that of its change between two visits, x = D / sqrt(1/n_a + 1/n_b): what the
    bands share is drift [1]::

        s^2 = (s_0^2 + sum (x - mean)^2) / (1 + sum (n - 1))

    The bands of a capture may share errors: within the visits the degrees of freedom are those of one. What
    the sensor's attitudes explain of the scatter within a visit (`_find_leaning`) is not the readings'.

    [1] A. Gelman et al., Bayesian Data Analysis, 3rd ed., section 2.6 (variance of a normal distribution)
    """
    within: list[list[list[float]]] = []  # ln K by band, visit and frame
    changes: dict[tuple[int, int], list[float]] = {}
    leaning = 0.0
    for visits in bands:
        single = [visit for visit in visits if all(frame.is_single for frame in visit)]
        within.append([[math.log(frame.k) for frame in visit] for visit in single])
        for (a, before), (b, after) in itertools.pairwise(zip(single, within[-1], strict=True)):
            change = (statistics.fmean(after) - statistics.fmean(before)) / math.sqrt(
                1.0 / len(before) + 1.0 / len(after)
            )
            changes.setdefault((a[0].candidate.visit, b[0].candidate.visit), []).append(change)
        leaning += sum(_find_leaning(visit)[2] for visit in single)
    groups = [logs for band in within for logs in band] + list(changes.values())
    squares = math.fsum(statistics.variance(each) * (len(each) - 1) for each in groups if len(each) > 1)
    squares = max(0.0, squares - leaning)
    between = sum(len(each) - 1 for each in changes.values())
    free = [sum(len(logs) - 1 for logs in band) for band in within]
    variance = (READING_DOF * SINGLE_READING_U_REL**2 + squares) / (READING_DOF + sum(free) + between)
    return Estimate(math.sqrt(variance), READING_DOF + max(free) + between)


def _find_leaning(visit: Sequence[PanelFrame]) -> tuple[tuple[float, ...], float, float]:
    """Return what the attitudes of a visit's frames do to ln K.

    The mean effects of what captures share; the variance of the mean by what each attitude has of its own;
    and the sum of squares that both let the frames scatter. Frames that lean alike have one attitude.
    """
    n, heads, sizes = len(visit), list[Angles](), list[int]()
    for frame in visit:
        light = see_light(frame.candidate.band)
        angles = light.angles_deg if light else (0.0, 0.0, 0.0)
        alike = [turned_deg(angles, head) <= LARGEST_TILT_DEG for head in heads]
        if any(alike):
            sizes[alike.index(True)] += 1
        else:
            heads.append(angles)
            sizes.append(1)
    shared = [each.candidate.sunshine.level_effects if each.candidate.sunshine else () for each in visit]
    mean = results.add_effects(shared, [1.0 / n] * n)
    own = statistics.fmean(
        take_away(frame.level_u_rel, effects) ** 2 for frame, effects in zip(visit, shared, strict=True)
    )
    share = sum(size**2 for size in sizes) / n**2
    apart = sum(part**2 for each in shared for part in results.add_effects((each, mean), (1.0, -1.0)))
    return mean, share * own, apart + n * (1.0 - share) * own


def judge_visit(visit: Sequence[PanelFrame], reading: Estimate) -> Visit:
    """Compare the predicted scatter of a visit's frames with the observed one, of which the larger counts."""
    n = len(visit)
    noise = sum(frame.noise_u_rel**2 for frame in visit) / n**2
    sunshine = single = restless = 0.0
    for frame in visit:
        variance, light = frame.sunshine_u_rel**2 / n**2, frame.candidate.sunshine
        if frame.is_single:
            variance += (reading.rel**2 - SINGLE_READING_U_REL**2) / n**2
            single += variance
        elif light is not None:
            restless += variance**2 / (light.readings - 1.0)
        sunshine += variance
    scatter = 0.0
    if n > 1:
        values = [frame.k for frame in visit]
        scatter = (statistics.stdev(values) / statistics.fmean(values)) ** 2 / n
    effects, own_level, leaning = _find_leaning(visit)
    level = math.hypot(*effects) ** 2 + own_level
    repeat = max(0.0, scatter - noise - sunshine - leaning / max(1, n - 1) / n)
    if repeat > 0.0:
        restless += scatter**2 / (n - 1.0)
    times = [frame.candidate.at_s for frame in visit if frame.candidate.at_s is not None]
    return Visit(
        number=visit[0].candidate.visit,
        knot=Knot(
            at_s=statistics.fmean(times) if times else None,
            reflectance_k=statistics.fmean(frame.k for frame in visit),
            u_rel=math.sqrt(noise + sunshine + repeat + level),
            half_span_s=max(abs(at_s - statistics.fmean(times)) for at_s in times) if times else None,
            level_u_rel=math.sqrt(level),
            level_effects=effects,
            single_u_rel=math.sqrt(single),
            own_doubt=restless,
        ),
        noise=noise,
        sunshine=sunshine,
        repeat=repeat,
    )


def pool_drift(bands: Sequence[Sequence[Visit]], *, assumed_rel: float) -> Estimate:
    """Estimate the standard deviation of K's relative change in half an hour.

    As in `pool_readings`, with the mean over the bands of what the difference D between two visits exceeds
    their own variances u^2, for each of the n times T between visits::

        d^2 = (4 d_0^2 + sum max(0, mean(D^2 - u_a^2 - u_b^2)) / v(T)) / (4 + n)

    v is `change_variance`. The bands share most of what changes: they count as one.
    """
    found: dict[tuple[int, int], list[float]] = {}
    for band in bands:
        for before, after in itertools.pairwise(band):
            a, b = before.knot, after.knot
            if a.at_s is not None and b.at_s is not None:
                shared = results.add_effects((a.level_effects or (), b.level_effects or ()), (1.0, -1.0))
                known = math.hypot(a.own_u_rel, a.own_level_u_rel, b.own_u_rel, b.own_level_u_rel, *shared)
                excess = math.log(b.reflectance_k / a.reflectance_k) ** 2 - known**2
                found.setdefault((before.number, after.number), []).append(
                    excess / results.change_variance(b.at_s - a.at_s)
                )
    squares = math.fsum(max(0.0, statistics.fmean(each)) for each in found.values())
    dof = ASSUMED_DOF + len(found)
    return Estimate(math.sqrt((ASSUMED_DOF * assumed_rel**2 + squares) / dof), dof)


def compute_k(*, reflectance: float, incidence_angle_deg: float, i_sq: float, i_ss: float | None) -> float:
    """Compute K = R cos(theta) I_ss / I_sq.

    [1] "How to convert Sequoia images to reflectance?" 1.1, section 4c
    """
    lit = reflectance * math.cos(math.radians(incidence_angle_deg))
    return lit * (1.0 if i_ss is None else i_ss) / i_sq


def fit_bands(used: Sequence[Candidate], params: Params) -> dict[str, BandFit]:
    """Fit K of every band.

    K of a panel capture is the mean over its frames. K of the flight is the mean over the captures, or K(t)
    on straight lines between them::

        u_rel(K)^2 = panel^2 + angle^2 + evenness^2 + gain^2 + drift^2
                     + (noise^2 + sunshine^2 + tilt^2 + repeat^2)

        panel     u(R)/R, with the panel's change between or after its measurements (`find_value`)
        angle     tan(theta) u_theta and u_theta^2 / 2: the cosine's first and second order;
                  theta is the sun's zenith angle where none is stated
        evenness  gradient across the region / sqrt(12)
        gain      of the sunshine sensor's gain indices, which all frames share
        drift     of `evaluate_k` in the middle of the longest time between two captures, or half
                  an hour after a single one
        tilt      of the sunshine sensor's attitude and the diffuse fraction, alike where frames lean alike
        repeat    by how much the frames of a capture scatter beyond their noise

    Readings and drift are estimated from all bands together (`pool_readings`, `pool_drift`).
    """
    bands = {
        band: [each for each in used if each.band.band == band]
        for band in sorted({each.band.band for each in used})
    }
    frames = {
        band: [
            [_measure(each, params) for each in found if each.visit == number]
            for number in sorted({each.visit for each in found})
        ]
        for band, found in bands.items()
    }
    reading = pool_readings(list(frames.values()))
    visits = {band: [judge_visit(each, reading) for each in found] for band, found in frames.items()}
    drift = pool_drift(list(visits.values()), assumed_rel=params.drift_half_hour_rel)
    return {
        band: _fit_band(found, visits[band], params, reading=reading, drift=drift)
        for band, found in bands.items()
    }


def _fit_band(
    used: Sequence[Candidate], visits: Sequence[Visit], params: Params, *, reading: Estimate, drift: Estimate
) -> BandFit:
    knots = tuple(visit.knot for visit in visits)
    k = statistics.fmean(knot.reflectance_k for knot in knots)
    change_rel = (knots[-1].reflectance_k - knots[0].reflectance_k) / k
    count = len(visits) ** 2
    panels = [each.panel for each in used if each.panel]
    constant_u_rel = _RECTANGLE * abs(change_rel) if params.interpolation == "constant" else 0.0
    midway = results.interpolate(
        knots, at_s=_choose_moment(knots), follow=params.interpolation == "linear", drift_rel=drift.rel
    )
    sources: dict[str, tuple[Literal["A", "B"], float]] = {
        "panel reflectance": ("B", max(p.standard_uncertainty / p.reflectance for p in panels)),
        "panel angle": ("B", _angle_u_rel(used, params)),
        "panel evenness": ("B", _RECTANGLE * statistics.fmean(c.features.gradient_rel for c in used)),
        "sunshine gain": ("B", max((c.sunshine.gain_u_rel for c in used if c.sunshine), default=0.0)),
        "drift": ("B", math.hypot(midway.drift_u_rel, constant_u_rel)),
        "pixel noise": ("A", math.sqrt(sum(visit.noise for visit in visits) / count)),
        "sunshine readings": ("A", math.sqrt(sum(visit.sunshine for visit in visits) / count)),
        "sunshine tilt": ("B", math.hypot(midway.level_u_rel, *midway.level_effects)),
        "repeat of the panel": ("A", math.sqrt(sum(visit.repeat for visit in visits) / count)),
    }
    total = math.fsum(u**2 for _, u in sources.values())
    doubt = results.Doubt(
        math.fsum((knot.single_u_rel or 0.0) ** 2 for knot in knots) / count,
        math.fsum(knot.own_doubt or 0.0 for knot in knots) / count**2 + midway.drift_u_rel**4 / drift.dof,
        reading.dof,
    )
    coefficient = _build(
        used,
        params,
        knots,
        k=k,
        sources={name: u for name, (_, u) in sources.items()},
        coverage_factor=doubt.expand(total)[0],
        drift=(constant_u_rel, drift),
        reading=reading,
    )
    return BandFit(
        coefficient=coefficient,
        budget=tuple(
            BudgetEntry(source=name, kind=kind, u_rel=u, variance_share=u**2 / total if total else 0.0)
            for name, (kind, u) in sources.items()
        ),
        visits=len(visits),
        drift_rel=change_rel if len(knots) > 1 else None,
    )


def _choose_moment(knots: Sequence[Knot]) -> float | None:
    """Return the moment for which the budget holds: K is least known in the middle of the longest gap."""
    times = [knot.at_s for knot in knots if knot.at_s is not None]
    if len(times) < len(knots):
        return None
    gaps = [(b - a, (a + b) / 2.0) for a, b in itertools.pairwise(times)]
    return max(gaps)[1] if gaps else times[0] + results.HALF_HOUR_S


def _measure(candidate: Candidate, params: Params) -> PanelFrame:
    features, sunshine, panel = candidate.features, candidate.sunshine, candidate.panel
    assert panel is not None  # noqa: S101  frames without one are left out
    k = compute_k(
        reflectance=panel.reflectance,
        incidence_angle_deg=params.incidence_angle_deg,
        i_sq=features.i_sq,
        i_ss=sunshine.i_ss if sunshine else None,
    )
    return PanelFrame(
        candidate=candidate,
        k=k,
        noise_u_rel=features.i_sq_standard_uncertainty / features.i_sq,
        sunshine_u_rel=sunshine.standard_uncertainty / sunshine.i_ss if sunshine else 0.0,
        level_u_rel=sunshine.level_u_rel if sunshine else 0.0,
    )


def _angle_u_rel(used: Sequence[Candidate], params: Params) -> float:
    suns = [suns for each in used if (suns := locate_suns_of(each.row.header))]
    angle_deg = params.incidence_angle_deg or max(
        (90.0 - statistics.fmean(sun.elevation_deg for sun in each) for each in suns), default=0.0
    )
    u, theta = math.radians(params.level_u_deg), math.radians(min(angle_deg, _STEEPEST_DEG))
    return math.hypot(math.tan(theta) * u, u**2 / 2.0)


def _build(
    used: Sequence[Candidate],
    params: Params,
    knots: tuple[Knot, ...],
    *,
    k: float,
    sources: dict[str, float],
    coverage_factor: float,
    drift: tuple[float, Estimate],
    reading: Estimate,
) -> Coefficient:
    first, panels = used[0], [each.panel for each in used if each.panel]
    panel = panels[0]  # frames without one are left out
    u_rel = math.hypot(*sources.values())
    sunshine = [candidate.sunshine for candidate in used if candidate.sunshine]
    ratio = compare_channels(candidate.band for candidate in used) if sunshine else None
    return Coefficient(
        band=first.band.band,
        reflectance_k=k,
        reflectance_k_standard_uncertainty=k * u_rel,
        reflectance_k_unit=unit_of_k(first.band, params.normalisation),
        expanded_uncertainty=k * coverage_factor * u_rel,
        coverage_factor=coverage_factor,
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
        angle_u_rel=sources["panel angle"],
        panel_light=tuple(light for each in used if (light := see_light(each.band))) or None,
        gain_u_rel=sources["sunshine gain"],
        drift_u_rel=drift[0],
        drift_half_hour_rel=drift[1].rel,
        drift_dof=drift[1].dof,
        reading_u_rel=reading.rel if any(each.is_single for each in sunshine) else None,
        reading_dof=reading.dof,
        channel_ratio=ratio.value if ratio else None,
        channel_ratio_u_rel=ratio.u_rel if ratio else None,
        gain_indices=tuple(sorted({index for each in sunshine for index in each.gain_indices})),
        sensor_model_scale=find_scale(first.band),
        i_sq_range=_range([candidate.features.i_sq for candidate in used]),
        i_ss_range=_range([each.i_ss for each in sunshine]) if sunshine else None,
    )


def find_scale(band: Multispectral) -> float:
    """Return the coefficient that sets the scale of a band's signal."""
    if isinstance(band.response, SensorModel):
        return band.response.a
    if isinstance(band.response, RadianceModel):
        return band.response.a1
    return band.response.adjustment if band.response is not None else 0.0


def unit_of_k(band: Multispectral, normalisation: results.Normalisation) -> str:
    """Return the unit of R I_ss / I_sq."""
    if isinstance(band.response, SensorModel):
        return "1/s" if normalisation == "sunshine" else "1"
    if isinstance(band.response, RadianceModel):
        return "sr" if normalisation == "sunshine" else "m2*sr*nm/W"
    return "s"  # the light sensor's unit is its own


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def describe_point(candidate: Candidate, params: Params, fit: BandFit | None) -> Point:
    features, sunshine, panel = candidate.row.features, candidate.sunshine, candidate.panel
    k = residual = None
    if not candidate.left_out and fit is not None:
        k = _measure(candidate, params).k
        residual = k / results.evaluate_k(fit.coefficient, at_s=candidate.at_s).value - 1.0
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
        i_ss_basis=sunshine.basis if sunshine else None,
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
    return math.pi * features.i_sq / panel.reflectance
