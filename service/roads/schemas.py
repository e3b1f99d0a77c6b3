"""Roads as requests state them and as they are answered."""

from typing import Annotated, Any, Literal

from pydantic import Field

from radiometry.road import grid, placing, results, rules, site
from service.http import models
from service.http.models import Answer, Form, Instant, LongText, Number, Text, maybe, told
from store.queries.calibrations import VersionState
from store.tables import Road, RoadResult

MOST_POINTS = 500
MOST_FRAMES = 100
_UNITS = {"illuminance": ("lx", "fc"), "luminance": ("cd/m2", "fL")}


class NewSite(models.model_of(site.Site, Form)):  # type: ignore[misc]
    """Luminaires and surfaces of a stretch; x runs along the road and y across it, in metres."""


class NewRequirement(models.model_of(site.Requirement, Form)):  # type: ignore[misc]
    """Class of the road and how the verdict takes the uncertainty into account."""

    def check(self) -> None:
        if any(each.at_least is None and each.at_most is None for each in self.criteria or ()):
            raise ValueError("criteria: each needs at_least or at_most")


class NewConditions(models.model_of(site.Conditions, Form)):  # type: ignore[misc]
    """State of the road and its lamps at the flight."""


class NewMark(models.model_of(placing.Mark, Form)):  # type: ignore[misc]
    """A point of the road that was found in the picture."""


class RoadFrame(Form, Answer):
    """A frame of the road, placed by what was marked in it, else by the place that its file states."""

    frame_id: Text
    marks: list[NewMark] | None = maybe(
        "Points of the road in the picture, which surround the field. Without them, the frame is placed by "
        "its file's position, height and attitude, and the site's `origin`.",
        min_length=4,
        max_length=200,
    )
    height_above_ground_m: Annotated[Number, Field(gt=0, le=1e4)] | None = maybe(
        "Of the camera, for a frame without marks; else that above take-off."
    )
    height_u_m: Annotated[Number, Field(gt=0, le=1e3)] | None = maybe("Its standard uncertainty.")


class RoadPoint(models.model_of(site.ControlPoint, Form), Answer):  # type: ignore[misc]
    """Readings of a meter at one place on the road."""

    values: list[Annotated[Number, Field(gt=0, le=1e7)]] = told(
        "Readings, repeated ones as often as they were taken.", min_length=1, max_length=9
    )
    taken_at: Instant | None = None
    left_out: LongText | None = maybe("Reason why a person left it out.")

    def check(self) -> None:
        if self.unit not in _UNITS[self.quantity]:
            raise ValueError(f"{self.quantity} is read in {' or '.join(_UNITS[self.quantity])}")


class SiteFeatures(Form):
    """A site as a FeatureCollection, as `GET .../site.geojson` writes it."""

    type: Literal["FeatureCollection"]
    coordinates: Literal["deg", "m"] = told("Degrees of WGS 84, or metres of the road.")
    features: list[dict[str, Any]] = told("Rows of luminaires first.", max_length=200)


class RoadChange(Form):
    """Corrections; what is left out stays."""

    name: Text | None = None
    site: NewSite | None = None
    requirement: NewRequirement | None = None
    conditions: NewConditions | None = None
    frames: list[RoadFrame] | None = maybe("All frames of the road.", max_length=MOST_FRAMES)
    hidden: list[Text] | None = maybe(
        "Names of grid points that a car or a tree hides.", max_length=grid.MOST_POINTS
    )

    def check(self) -> None:
        if len({each.frame_id for each in self.frames or ()}) < len(self.frames or ()):
            raise ValueError("frames: each is stated once")


class NewRoad(RoadChange):
    """A road on one night."""

    name: Text
    site: NewSite
    requirement: NewRequirement


class RoadPoints(Answer):
    items: list[RoadPoint]


class RoadResultSummary(Answer, restates=RoadResult, fields="number created_at"):
    verdict: results.Verdict
    link: str


class GridPointAnswer(Answer, restates=grid.GridPoint):
    """A point of the grid."""


class RoadAnswer(Answer, restates=Road, fields="id name hidden created_at"):
    """A road as it is stated, with its grid and its evaluations, the newest last."""

    site: models.model_of(site.Site, Answer)  # type: ignore[valid-type]
    requirement: models.model_of(site.Requirement, Answer)  # type: ignore[valid-type]
    conditions: models.model_of(site.Conditions, Answer)  # type: ignore[valid-type]
    frames: list[RoadFrame]
    points: list[RoadPoint]
    grid: list[GridPointAnswer]
    results: list[RoadResultSummary]


class PlacementAnswer(Answer):
    """Where the road lies in a picture: h takes (x, y, 1) in metres to the rays of the lens."""

    h: list[list[float]] = told("Homography, 3 by 3, to places at unit distance from the lens.")
    matrix: list[list[float]] = told("Camera matrix, 3 by 3 [px], about the middle of the first pixel.")
    distortion: list[float] = told("k1, k2, p1, p2, k3 of the geometry in force, or zeros.")
    place_u_m: float = told("Largest standard uncertainty of the place of a grid point [m].")


class RoadRuleAnswer(models.model_of(rules.Rule, Answer)):  # type: ignore[misc]
    """A rule: its figures, with their source and date, and how they were read."""


class RoadRules(Answer):
    items: list[RoadRuleAnswer]


class WantedPlan(Form):
    """Expanded uncertainties that a flight is to reach, as shares of the figures."""

    e_av_u_rel: float = told("Of E_av.", default=0.06, gt=0, lt=1)
    u_0_u_rel: float = told("Of U_0.", default=0.05, gt=0, lt=1)


class RoadPlanAnswer(models.model_of(results.Plan, Answer)):  # type: ignore[misc]
    """Control points and exposures for a flight."""


class StatedRoad(models.model_of(site.Road, Answer)):  # type: ignore[misc]
    """All that was stated of a road when it was evaluated."""


class EvaluatedFrame(Answer):
    """A frame of an evaluation, with the version that it was measured with."""

    frame_id: str
    filename: str
    sha256: str
    taken_at: str | None = None
    exposure_time_s: float
    f_number: float
    iso: float
    altitude_m: float | None = None
    calibration_id: str
    calibration_version: int
    calibration_state: VersionState = told("As it stands now.")
    certificate: str | None = maybe("Number of the version's certificate, the newest one.")
    camera: str = told("Make, model and serial number.")
    lens: str = told("`none`, or the id of the geometry version that its distortion was corrected with.")
    placed_by: Literal["marks", "position"] = told(
        "`position`: by position, height and attitude of its file."
    )


class MapExtent(Answer):
    """Part of the road that `map.png` shows: E on the road from above, x to the right and y downwards."""

    x_m: list[float] = told("From and to, along the road.")
    y_m: list[float] = told("From and to, across.")
    lx: list[float] = told("Ends of the logarithmic colours.")


class RoadResultAnswer(models.model_of(results.RoadResult, Answer)):  # type: ignore[misc]
    """One evaluation of a road, which never changes."""

    id: str
    road_id: str
    name: str
    number: int
    said: list[str] = told("The verdict, and what was decided of each figure, in sentences.")
    findings: list[models.FindingGroupAnswer] = told("The flags, equal ones as one.")
    stated: StatedRoad
    frames: list[EvaluatedFrame]
    map: MapExtent | None = None
    links: dict[str, str]
    software: dict[str, Any]
    content_sha256: str
    created_at: Instant
    created_by: str
