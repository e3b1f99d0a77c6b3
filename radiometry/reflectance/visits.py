"""Panel visits: K of each, and what all visits and bands together show of a reading's noise and K's drift."""

import itertools
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace

from radiometry.findings import Raised
from radiometry.frame.clock import EARLIEST_YEAR
from radiometry.reflectance import codes
from radiometry.reflectance.clock import read_clock
from radiometry.reflectance.evaluation import change_variance
from radiometry.reflectance.points import Candidate
from radiometry.reflectance.results import Knot
from radiometry.reflectance.sunshine import SINGLE_READING_U_REL

# An assumed standard deviation counts as one from so many values: it is known to 35 % (JCGM 100, G.4.2).
_ASSUMED_DOF = 4.0
_CLOCK_JUMP_S = 60.0
_FLIGHT_DAY_S = 12 * 3600.0


@dataclass(frozen=True)
class PanelFrame:
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


@dataclass(frozen=True)
class Estimate:
    """A relative standard deviation and its degrees of freedom."""

    rel: float
    dof: float


@dataclass(frozen=True)
class Visit:
    """A visit to the panel in one band: its errors of its own as relative variances of K.

    ``restless``: the squares of those that were estimated, each over its degrees of freedom.
    """

    number: int
    knot: Knot
    noise: float
    sunshine: float
    level: float
    repeat: float
    restless: float


def check_times(used: Sequence[Candidate]) -> tuple[list[Candidate], list[Raised]]:
    """Check the times of the panel frames, and drop those that contradict each other.

    Parameters
    ----------
    used : sequence of Candidate
        Panel frames that are used.

    Returns
    -------
    tuple
        The frames, without times if a clock jumped; flags `panel_times_doubtful`.
    """
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


def pool_readings(visits: Sequence[Sequence[PanelFrame]]) -> Estimate:
    """Estimate the noise of a single sunshine reading.

    Parameters
    ----------
    visits : sequence of sequence of PanelFrame
        Frames of each visit in each band.

    Notes
    -----
    An assumed s_0 with 4 degrees of freedom and the scatter of ln K within the n frames
    of each visit and band [1]_::

        s^2 = (4 s_0^2 + sum (ln K - mean)^2) / (4 + sum (n - 1))

    The bands of a capture may share errors: the degrees of freedom are those of one.

    References
    ----------
    .. [1] A. Gelman et al., Bayesian Data Analysis, 3rd ed., section 2.6 (variance of a normal distribution)
    """
    squares, free, most = 0.0, 0, 0
    bands: dict[str, int] = {}
    for visit in visits:
        if len(visit) > 1 and all(frame.is_single for frame in visit):
            logs = [math.log(frame.k) for frame in visit]
            squares += statistics.variance(logs) * (len(logs) - 1)
            free += len(logs) - 1
            band = visit[0].candidate.band.band
            bands[band] = bands.get(band, 0) + len(logs) - 1
            most = max(most, bands[band])
    variance = (_ASSUMED_DOF * SINGLE_READING_U_REL**2 + squares) / (_ASSUMED_DOF + free)
    return Estimate(math.sqrt(variance), _ASSUMED_DOF + most)


def judge_visit(visit: Sequence[PanelFrame], reading: Estimate) -> Visit:
    """Compare the predicted scatter of a visit's frames with the observed one; the larger of the two counts.

    Parameters
    ----------
    visit : sequence of PanelFrame
        Frames of one visit in one band.
    reading : Estimate
        Noise of a single sunshine reading.
    """
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
    repeat = max(0.0, scatter - noise - sunshine)
    if repeat > 0.0:
        restless += scatter**2 / (n - 1.0)
    level = statistics.fmean(frame.level_u_rel for frame in visit) ** 2
    times = [frame.candidate.at_s for frame in visit if frame.candidate.at_s is not None]
    return Visit(
        number=visit[0].candidate.visit,
        knot=Knot(
            at_s=statistics.fmean(times) if times else None,
            reflectance_k=statistics.fmean(frame.k for frame in visit),
            u_rel=math.sqrt(noise + sunshine + repeat + level),
            half_span_s=max(abs(at_s - statistics.fmean(times)) for at_s in times) if times else None,
        ),
        noise=noise,
        sunshine=sunshine,
        level=level,
        repeat=repeat,
        restless=restless + single**2 / reading.dof,
    )


def pool_drift(bands: Sequence[Sequence[Visit]], *, assumed_rel: float) -> Estimate:
    """Estimate the standard deviation of K's relative change in half an hour.

    Parameters
    ----------
    bands : sequence of sequence of Visit
        Visits of each band in the order of time.
    assumed_rel : float
        Its assumed value d_0.

    Notes
    -----
    As in `pool_readings`, with the mean over the bands of what the difference D between
    two visits exceeds their own variances u^2, for each of the n times T between visits::

        d^2 = (4 d_0^2 + sum max(0, mean(D^2 - u_a^2 - u_b^2)) / v(T)) / (4 + n)

    v is `change_variance`. The bands share most of what changes: they count as one.
    """
    found: dict[tuple[int, int], list[float]] = {}
    for band in bands:
        for before, after in itertools.pairwise(band):
            a, b = before.knot, after.knot
            if a.at_s is not None and b.at_s is not None:
                excess = math.log(b.reflectance_k / a.reflectance_k) ** 2 - a.u_rel**2 - b.u_rel**2
                found.setdefault((before.number, after.number), []).append(
                    excess / change_variance(b.at_s - a.at_s)
                )
    squares = math.fsum(max(0.0, statistics.fmean(each)) for each in found.values())
    dof = _ASSUMED_DOF + len(found)
    return Estimate(math.sqrt((_ASSUMED_DOF * assumed_rel**2 + squares) / dof), dof)
