"""Responses of a sharpness fit: which are used, which are left out and why, and what is missing."""

from collections.abc import Sequence
from dataclasses import dataclass

from radiometry.drawing.text import name_few
from radiometry.sharpness.features import EdgeResponse, Estimate, Features, RegionResponse, StarResponse
from radiometry.sharpness.resolution import find_resolving_power
from radiometry.sharpness.rows import FrameRow, Params

MTF50 = "mtf50_cycles_per_pixel"
RESOLVING_POWER = "resolving_power_cycles_per_pixel"


Key = tuple[str, str, str, float]


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One channel of one region of one frame.

    Attributes
    ----------
    frame : str
        Name of the frame.
    features : Features
        Features of the frame.
    region : RegionResponse
        Responses of the region.
    channel : str
        Name of the channel.
    f_number : float or None
        F-number.
    response : EdgeResponse, StarResponse or None
        Response of the channel; None if the channel was refused.
    left_out : str
        "" if it counts, else the reason.
    """

    frame: str
    features: Features
    region: RegionResponse
    channel: str
    f_number: float | None
    response: EdgeResponse | StarResponse | None
    left_out: str

    @property
    def kind(self) -> str:
        """Kind of the target."""
        return self.features.kind

    @property
    def key(self) -> Key:
        """Key that repeats of one another share."""
        return self.kind, self.region.name, self.channel, self.f_number or 0.0

    @property
    def figure(self) -> str:
        """Name of the coefficient that is compared between frames and positions."""
        return MTF50 if self.kind == "slanted_edge" else RESOLVING_POWER

    def measure(self, params: Params) -> Estimate | None:
        """Return the coefficient that is compared between frames and positions.

        Parameters
        ----------
        params : Params
            Parameters of the fit.

        Returns
        -------
        Estimate or None
            Coefficient with its uncertainty, if it exists.
        """
        match self.response:
            case EdgeResponse():
                return self.response.mtf50
            case StarResponse():
                return find_resolving_power(
                    self.response.frequency, self.response.whole, contrast=params.star_contrast
                )
            case _:
                return None


def collect_candidates(rows: Sequence[FrameRow], params: Params) -> tuple[Candidate, ...]:
    """Return every channel of every region.

    Parameters
    ----------
    rows : sequence of FrameRow
        Evidence of the campaign's frames.
    params : Params
        Parameters of the fit.

    Returns
    -------
    tuple of Candidate
        Candidates ordered by position, channel, f-number and frame.
    """
    excluded = {exclusion.frame: exclusion for exclusion in params.exclude}
    found = []
    for row in rows:
        if row.features is None:
            continue
        exclusion = excluded.get(row.frame)
        left_out = f"excluded by {exclusion.by}: {exclusion.reason}" if exclusion else ""
        f_number = row.exposure.f_number if row.exposure is not None else None
        for region in row.features.regions:
            responses: tuple[EdgeResponse | StarResponse, ...] = (*region.edges, *region.stars)
            outcomes = [
                *((each.channel, each, left_out) for each in responses),
                *((each.channel, None, left_out or each.message) for each in region.refused),
            ]
            found += [
                Candidate(
                    frame=row.frame,
                    features=row.features,
                    region=region,
                    channel=channel,
                    f_number=f_number,
                    response=response,
                    left_out=reason,
                )
                for channel, response, reason in outcomes
            ]
    return tuple(sorted(found, key=lambda each: (each.key, each.frame)))


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    """List, by name, what keeps a fit from starting."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    wanted = [row for row in rows if row.role == "chart" and row.frame not in excluded]
    found = []
    if not wanted and not unread:
        found.append("no chart frame that can be used: photograph edges or stars in role chart")
    if unread:
        found.append(f"not read yet: {name_few('frame', unread)}")
    undrawn = [row.frame for row in wanted if row.features is None and not row.has_region]
    waiting = [row.frame for row in wanted if row.features is None and row.has_region]
    if undrawn:
        found.append(f"no region: {name_few('frame', undrawn)}")
    if waiting:
        found.append(f"not extracted yet: {name_few('frame', waiting)}")
    return tuple(found)
