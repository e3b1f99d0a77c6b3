"""Points of a reflectance fit: panel frames used, those left out with the reason, what is missing."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from radiometry.drawing.text import name_few
from radiometry.findings import Finding, InputRejected, Raised
from radiometry.fitting.evidence import list_unknown_exclusions
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance import codes
from radiometry.reflectance.clock import read_clock, read_clock_s
from radiometry.reflectance.features import Features
from radiometry.reflectance.gains import Gain
from radiometry.reflectance.levelling import measure_light
from radiometry.reflectance.panel import PanelValue, choose_readings, find_value, list_contradictions
from radiometry.reflectance.rows import FrameRow, Params, Reading
from radiometry.reflectance.sunshine import Sunshine
from radiometry.reflectance.sunshine_counts import compare_channels

PANEL = "panel"
MOST_SATURATED_SHARE = 0.001
DETECTION_ERRORS = 3.0
# Panel frames further apart than this belong to two visits to the panel.
VISIT_GAP_S = 300.0
STEEPEST_ANGLE_DEG = 60.0

NO_REFLECTANCE = "no reflectance of the panel in this band"


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A panel frame with all that its point needs.

    Attributes
    ----------
    row : FrameRow
        Row of the frame.
    band : Multispectral
        Metadata of the band.
    at_s : float or None
        Time on the camera's clock [s]; None if the file has none.
    visit : int
        Number of the panel capture, from 1.
    panel : PanelValue or None
        Reflectance of the panel in this band on that day; None if not known.
    sunshine : Sunshine or None
        Sunshine readings, if they are used.
    left_out : str
        "" if it counts, else the reason.
    left_out_code : Finding or None, default: None
        Code of the InputRejected that it would be; None for other reasons.
    """

    row: FrameRow
    band: Multispectral
    at_s: float | None
    visit: int
    panel: PanelValue | None
    sunshine: Sunshine | None
    left_out: str
    left_out_code: Finding | None = None

    @property
    def features(self) -> Features:
        """Features of the row, which a candidate has."""
        if self.row.features is None:
            raise ValueError(f"{self.row.frame} has no features")
        return self.row.features


def list_missing(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params, *, unread: Sequence[str] = ()
) -> list[str]:
    """List by name what keeps a fit from starting.

    Parameters
    ----------
    rows : sequence of FrameRow
        Frames of the campaign.
    readings : sequence of Reading
        Reflectances of the panel.
    params : Params
        Parameters of the fit.
    unread : sequence of str, default: ()
        Names of frames that are not read yet.

    Returns
    -------
    list of str
        Fragments that can be joined by "; ".
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = list_unknown_exclusions(params.exclude, [*(row.frame for row in rows), *unread])
    panels = [row for row in rows if row.role == PANEL and row.frame not in excluded]
    groups = {
        "not read yet": {*unread} - excluded,
        "no region on the panel": [row.frame for row in panels if not row.has_region],
        "not extracted yet": [row.frame for row in panels if row.has_region and row.features is None],
    }
    found += [f"{what}: {name_few('frame', names)}" for what, names in groups.items() if names]
    if not panels and not unread:
        found.append("the campaign has no panel frame")
    return [*found, *list_contradictions(readings, params)]


def list_bands_without_reflectance(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> list[str]:
    """List the bands that have panel frames but no reflectance, with what to do.

    Returns
    -------
    list of str
        Fragments of sentences; a fit can start with the other bands, and leaves
        these out.
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    shown = {
        row.header.multispectral.band
        for row in rows
        if row.role == PANEL
        and row.frame not in excluded
        and row.header.multispectral is not None
        and row.header.multispectral.panel_albedo is None
    }
    unknown = ", ".join(sorted(shown - {reading.band for reading in choose_readings(readings, params)}))
    if not unknown:
        return []
    if readings:
        named = f"panel {readings[0].panel} has no reflectance (band {unknown})"
        return [f"{named}: register it with what it reflects there"]
    named = f"the panel's reflectance is not known (band {unknown})"
    return [f"{named}: register the panel; where several are, name it (panel_id)"]


def require_flat_angle(angle_deg: float) -> None:
    """Refuse an angle at which neither the cosine nor the panel's reflectance is reliable.

    Parameters
    ----------
    angle_deg : float
        Angle of incidence [deg].

    Raises
    ------
    InputRejected
        `panel_angle_too_large` above 60 degrees.
    """
    if angle_deg > STEEPEST_ANGLE_DEG:
        raise InputRejected(
            codes.PANEL_ANGLE_TOO_LARGE,
            f"The angle of incidence is {angle_deg:g} degrees; above {STEEPEST_ANGLE_DEG:g} a panel is no "
            "longer diffuse and a degree changes the result by more than 3 %. Level the panel, or wait for "
            "a higher sun.",
        )


def collect_candidates(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[Candidate, ...]:
    """Collect the panel frames in the order band, time, name: the order of the input changes nothing.

    Parameters
    ----------
    rows : sequence of FrameRow
        Frames of the campaign.
    readings : sequence of Reading
        Reflectances of the panel.
    params : Params
        Parameters of the fit.
    """
    reasons = {exclusion.frame: f"{exclusion.reason} ({exclusion.by})" for exclusion in params.exclude}
    panels = [row for row in rows if row.role == PANEL and row.header.multispectral is not None]
    visits = _count_visits(panels)
    bands = [row.header.multispectral for row in panels if row.header.multispectral is not None]
    ratios = {name: compare_channels(b for b in bands if b.band == name) for name in {b.band for b in bands}}
    found = [
        _judge(
            row,
            readings,
            params,
            visit=visits[row.frame],
            excluded=reasons.get(row.frame, ""),
            ratios=ratios,
        )
        for row in panels
    ]
    return tuple(sorted(found, key=lambda each: (each.band.band, each.at_s or 0.0, each.row.frame)))


def _count_visits(panels: Sequence[FrameRow]) -> dict[str, int]:
    """Number the panel captures; a frame without a time belongs to the only one, else to none (0)."""
    times = {row.frame: read_clock_s(row.header) for row in panels}
    known = sorted(at for at in times.values() if at is not None)
    starts = [after for before, after in itertools.pairwise(known) if after - before > VISIT_GAP_S]
    return {
        frame: 1 + sum(at >= start for start in starts) if at is not None else int(not starts)
        for frame, at in times.items()
    }


def _judge(
    row: FrameRow,
    readings: Sequence[Reading],
    params: Params,
    *,
    visit: int,
    excluded: str,
    ratios: Mapping[str, Gain | None],
) -> Candidate:
    band = row.header.multispectral
    assert band is not None  # noqa: S101  the caller chose rows with one
    panel = find_value(band, readings, params, at=read_clock(row.header))
    sunshine = None
    left_out, code = (excluded, None) if excluded else _inspect(row)
    if not left_out and panel is None:
        left_out = NO_REFLECTANCE
    if not left_out and not visit:
        left_out = "its time is not known, and the panel was visited more than once"
    if not left_out and params.normalisation == "sunshine":
        try:
            sunshine = measure_light(
                row.header,
                choice=params.sunshine_choice,
                params=params.levelling,
                ratio=ratios[band.band],
                where=f"frame {row.frame}",
            )
        except InputRejected as rejected:
            left_out, code = rejected.message, rejected.code
    return Candidate(
        row=row,
        band=band,
        at_s=read_clock_s(row.header),
        visit=visit,
        panel=panel,
        sunshine=sunshine,
        left_out=left_out,
        left_out_code=code,
    )


def _inspect(row: FrameRow) -> tuple[str, Finding | None]:
    """Return what keeps a frame's signal out of a fit, and its code if it has one of its own."""
    features = row.features
    if features is None:
        return "not extracted", None
    if features.statistics.saturated_share > MOST_SATURATED_SHARE:
        share = f"{features.statistics.saturated_share:.1%} of the region"
        return f"saturated: {share}", codes.PANEL_SATURATED
    numbers = (features.i_sq, features.i_sq_standard_uncertainty, features.gradient_rel)
    if not all(math.isfinite(number) for number in numbers):
        return "its signal is no number", None
    if features.i_sq <= DETECTION_ERRORS * features.i_sq_standard_uncertainty:
        return "less than three standard errors above black", None
    return "", None


def sunshine_flags(candidates: Sequence[Candidate]) -> list[Raised]:
    """Collect the flags of the used frames' sunshine readings.

    Returns
    -------
    list of Raised
        Flags of the frames that are used.
    """
    return [
        raised for each in candidates if each.sunshine and not each.left_out for raised in each.sunshine.flags
    ]
