"""Measurements: what is answered."""

from typing import Any, Literal

from radiometry.findings import grouping, shared
from radiometry.fitting.evidence import FieldCorrection
from radiometry.frame.multispectral import Alignment, LightBasis
from radiometry.frame.place import Place, PlaceShare
from radiometry.methods import get_method
from radiometry.methods.findings import FINDINGS
from radiometry.road.lanes import LaneGrid
from radiometry.specification.method import Scope
from service.calibrations.schemas import SCOPE_MEANING
from service.http.models import Answer, FindingGroupAnswer, Instant, Quantity, group_flags, maybe, told
from store.queries.calibrations import VersionState, VersionStatus
from store.ready.rows import list_passed
from store.tables import Calibration, FrameRow, Measurement


class CalibrationUsed(Answer):
    id: str
    version: int
    why: str
    state: VersionState = told("As it stands now.")
    superseded_by: str | None = None
    revoked_reason: str | None = None


class FlagAnswer(Answer):
    flag: str
    where: str = told('"" for the whole, "grid" for its cells, "min" for dark parts.')
    detail: str


class BudgetRow(Answer):
    """One source's share of the mean's uncertainty, in the unit of the mean."""

    source: str
    shared: bool = told("The same error in every pixel: no mean over pixels reduces it.")
    standard_uncertainty_cd_m2: float | None = maybe("Of a luminance.")
    standard_uncertainty: float | None = maybe("Of a reflectance.")
    variance_share: float


class CorrectionAnswer(Answer, restates=FieldCorrection):
    """An error of the field: L = factor * L_shown - offset, and what is left of it in the budget."""


class ReflectedAnswer(Answer):
    """How a band's reflectance came about: R = K I_sq / (I_ss cos(incidence))."""

    band: str
    i_sq: float
    i_ss: float | None = maybe("On a level surface wherever the file allows; none of a panel-only K.")
    i_ss_oriented: float | None = maybe("As the sensor was oriented.")
    i_ss_basis: LightBasis | None = maybe(
        "What `i_ss` is: `levelled` here, `horizontal` or `compensated` by the camera, or "
        "`oriented` as the sensor was."
    )
    reflectance_k: float = told("At the time of the frame.")
    incidence_angle_deg: float
    shared_u: float = told("The part of the mean's uncertainty that all pixels share.")
    noise_u: float = told("The part that is the mean's own noise.")
    below_zero_share: float = told("Of the region's pixels; nothing is clipped.")
    above_one_share: float


class BandAnswer(Answer):
    band: str
    i_sq: float
    i_ss: float | None = None
    i_ss_oriented: float | None = None
    i_ss_basis: LightBasis | None = None
    reflectance_k: float
    reflectance: Quantity


class IndexAnswer(Answer):
    """An index of the region's mean reflectances, that of the first band first."""

    name: str = told("Name of the index, or its formula.")
    formula: str | None = maybe("Absent of measurements of older releases.")
    bands: list[BandAnswer]


class AlignmentAnswer(Answer, restates=Alignment):
    """How a band was aligned onto the pixels of the measurement's frame."""


class PlaceShareAnswer(Answer, restates=PlaceShare):
    """One source's share of the uncertainty of a place."""


class PlaceAnswer(Answer, restates=Place, without="tie_points corners transform"):
    """Where the pixels of `map.tif` lie on level ground, as its GeoTIFF tags state it."""

    transform: list[float] | None = maybe(
        "[a, b, c, d, e, f] of longitude = a + b col + c row and latitude = d + e col + f row "
        "[deg], counted from the outer corner of the first pixel, as GDAL does."
    )
    corners: list[list[float]] = told(
        "[longitude, latitude] of the frame's corners: top-left, top-right, bottom-right, bottom-left.",
        default=[],
    )
    budget: list[PlaceShareAnswer] = told("Sources of the uncertainty.", default=[])


class UndistortedAnswer(Answer):
    """Content of `map.tif`: the whole picture as a lens without distortion would have taken it."""

    planes: list[str] = told(
        "`grey`: around each pixel of a mosaic its pattern's four sites weigh a quarter each; "
        "`R`, `G`, `B` of a rendered picture."
    )
    linear: bool = told("Raw numbers [DN], black included; false: with the picture's tone curve.")
    height_px: int
    width_px: int
    seen_share: float = told("Of the pixels that the camera saw; the others are 0.")
    parameters: dict[str, Quantity] = told("The camera's, in OpenCV's notation.")


class MapCounts(Answer):
    """Counts of all pixels of the map: how many leave [0, 1], are saturated, or have no index."""

    pixels: int
    below_zero: int | None = None
    above_one: int | None = None
    saturated: int | None = None
    undefined: int | None = None


class PercentileAnswer(Answer):
    percent: int
    luminance: Quantity | None = None
    reflectance: Quantity | None = None


class LanesAnswer(Answer, restates=LaneGrid, fields="lanes lane_width_m spacing_m length_m"):
    """Lanes between two luminaires; the points of EN 13201-3 are the centres of the cells."""

    marked: list[list[float]] = told("Corners of the rectangle as they were given [px].")
    corner_u_px: float
    along_m: float = told("Distance of the points along the lanes.")
    across_m: float
    points_m: list[list[list[float]]] = told(
        "[x, y] of each point along and across from the first corner, row by row."
    )
    point_u_m: float = told(
        "Largest standard uncertainty of a point's place on the road from that of the corners."
    )


class GridAnswer(Answer):
    """The cells as the surface runs, row by row."""

    corners: list[list[float]]
    rows: int
    columns: int
    corner_u_px: float | None = maybe(
        "Standard uncertainty of each coordinate of a corner, whose effect is part of the cells' "
        "uncertainties; absent of measurements of older releases, where it is not."
    )
    cell_model: str = told("`projective`: equal cells of the surface, not of its image.")
    cells: list[list[Quantity]]
    lanes: LanesAnswer | None = None


class MeasurementAnswer(Answer):
    id: str
    frame_id: str
    frame_ids: list[str] | None = maybe(
        "The frames that were averaged, `frame_id` first; absent of a single one."
    )
    campaign_id: str
    camera_id: str
    filename: str
    taken_at: str | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    method: str
    calibration: CalibrationUsed
    uncertainty_scope: Scope | None = maybe(SCOPE_MEANING)
    seen_from: Literal["above"] | None = maybe(
        "Of a luminance: it is that towards the camera, not towards a driver."
    )
    seen_from_detail: str | None = maybe("What that means, in a sentence.")
    region: list[list[float]] = told(
        "Outline [x, y] in px of what mean, median, min, max, percentiles and illuminance are of."
    )
    region_origin: Literal["request", "frame", "campaign", "grid", "whole_frame"] = told(
        "Source of the region: `roi` of the request, else the outline of its `grid`, else the "
        "frame's own region, else its campaign's, else the whole frame."
    )
    pixels: int | None = maybe("How many measured pixels the region holds.")
    mean: Quantity | None = maybe("Of a luminance in cd/m2; of a reflectance or an index without unit.")
    shared_u_cd_m2: float | None = maybe(
        "The part of the mean's standard uncertainty that all pixels share [cd/m2]."
    )
    noise_u_cd_m2: float | None = maybe("The part that is the mean's own noise [cd/m2].")
    effective_dof: float | None = maybe(
        "Of the mean's standard uncertainty; absent if they are without limit."
    )
    coverage_factor: float | None = maybe("Of the mean, for a coverage probability of 95 %.")
    expanded_uncertainty_cd_m2: float | None = maybe(
        "`coverage_factor` times the mean's standard uncertainty."
    )
    expanded_uncertainty: float | None = maybe("The same of a reflectance or an index, without unit.")
    min: Quantity | None = None
    max: Quantity | None = None
    median: Quantity | None = None
    percentiles: list[PercentileAnswer] = told("Of single pixels, with a single pixel's noise.")
    conditions_origin: dict[str, Literal["request", "campaign"]] | None = maybe(
        "Light and surroundings that were stated, each by the request or the frame's campaign."
    )
    budget: list[BudgetRow]
    corrections: list[CorrectionAnswer] = told(
        "Of a luminance: errors of light, distance and surroundings, corrected as far as known."
    )
    reflected: ReflectedAnswer | None = maybe("Of a band's reflectance.")
    index: IndexAnswer | None = None
    radiance: str | None = maybe("The band, of a radiance.")
    alignment: list[AlignmentAnswer] | None = maybe(
        "Of an index and of the product `bands`: the other bands of the capture."
    )
    place: PlaceAnswer | None = maybe("Of a band or an index: where its map lies, or why it is not placed.")
    undistorted: UndistortedAnswer | None = maybe("Of a geometry campaign's frame.")
    map: MapCounts | None = maybe("Of a map of reflectance or of an index.")
    illuminance: Quantity | None = maybe("E = pi L / rho of the region's mean.")
    grid: GridAnswer | None = None
    l_av_cd_m2: Quantity | None = None
    l_min_cd_m2: Quantity | None = None
    l_max_cd_m2: Quantity | None = None
    u_o: Quantity | None = maybe("L_min / L_av over the cells.")
    u_l: list[Quantity] | None = maybe("L_min / L_max along each row of cells.")
    average_to_min: Quantity | None = None
    max_to_min: Quantity | None = None
    grid_illuminance: Quantity | None = maybe("E = pi L_av / rho.")
    saturated_share: float | None = None
    vignetting: str = told("What vignetting was corrected with: `none`, `file`, or the calibration's id.")
    lens_share: Quantity | None = maybe("V of the region, by which its signal above dark was divided.")
    signal: str = told("The channel or the band.")
    flags: list[FlagAnswer]
    findings: list[FindingGroupAnswer] = told("The flags, equal ones as one.")
    to_do_better: list[str]
    links: dict[str, str]
    parameters: dict[str, Any]
    software: dict[str, Any] = told("The release that measured (`stilb`), and what it used.")
    content_sha256: str
    created_at: Instant
    created_by: str

    @classmethod
    def of(
        cls,
        row: Measurement,
        frame: FrameRow,
        calibration: Calibration,
        status: VersionStatus,
        of_vignetting: VersionStatus | None = None,
    ) -> "MeasurementAnswer":
        result, header = row.result, frame.header or {}
        repeats = row.parameters.get("repeats", [])
        flags = [FlagAnswer.model_validate(raised) for raised in result["flags"]]
        flags += [FlagAnswer.model_validate(raised) for raised in list_passed(calibration, frame)]
        flags += _flags_of(status) + _flags_of_vignetting(of_vignetting)
        spec = get_method(row.method)
        summary = spec.summarise(result)
        told = {raised.flag for raised in flags}
        scopes = [spec.find_scope(name, told) for name in sorted(spec.certificate.headlines)]
        budget = [(share["source"], share["variance_share"]) for share in result.get("budget", [])]
        assumed = {each["source"] for each in result.get("corrections", []) if each.get("assumed")}
        return cls.restate(
            row,
            summary.figures,
            {name: header.get(name) for name in ("taken_at", "latitude_deg", "longitude_deg", "altitude_m")},
            signal=summary.signal,
            vignetting=summary.vignetting,
            grid=_describe_grid(row),
            camera_id=calibration.camera_id,
            frame_ids=[row.frame_id, *(each["frame_id"] for each in repeats)] if repeats else None,
            filename=frame.filename,
            calibration=CalibrationUsed.restate(calibration, status, why=result["why"]),
            uncertainty_scope=scopes[0] if scopes else None,
            region=row.parameters["polygon"],
            region_origin=row.parameters["region_origin"],
            conditions_origin=row.parameters.get("conditions_origin"),
            budget=result.get("budget", []),
            corrections=result.get("corrections", []),
            percentiles=result.get("percentiles", []),
            map=result.get("map"),
            place=result.get("place"),
            alignment=result.get("alignment") or None,
            flags=flags,
            findings=group_flags(each.model_dump() for each in flags),
            to_do_better=list(
                grouping.advise([FINDINGS[raised.flag] for raised in flags], budget=budget, assumed=assumed)
            ),
            links=_links(row),
        )


def _describe_grid(row: Measurement) -> GridAnswer | None:
    if not (surface := row.result.get("surface")):
        return None
    return GridAnswer.restate(row.parameters["grid"], surface, lanes=row.parameters.get("lanes"))


def _links(row: Measurement) -> dict[str, str]:
    own = f"/v1/measurements/{row.id}"
    links = {"frame": f"/v1/frames/{row.frame_id}", "calibration": f"/v1/calibrations/{row.calibration_id}"}
    if row.map_tif_sha256 is not None:
        links |= {"map_tif": f"{own}/map.tif", "map_png": f"{own}/map.png", "stac": f"{own}/stac.json"}
    return links


def _flags_of_vignetting(status: VersionStatus | None) -> list[FlagAnswer]:
    """Only that it was revoked: a K belongs to its own vignetting version, whatever is in force since."""
    if status is None or status.state != "revoked":
        return []
    detail = f"Of vignetting, because: {status.revoked_reason}."
    return [FlagAnswer(flag=shared.CALIBRATION_REVOKED, where="", detail=detail)]


def _flags_of(status: VersionStatus) -> list[FlagAnswer]:
    match status.state:
        case "draft":
            flag, detail = shared.CALIBRATION_NOT_PUBLISHED, "It is a draft."
        case "superseded":
            newer = f"version {status.successor}" if status.successor else "another version"
            flag, detail = shared.CALIBRATION_SUPERSEDED, f"By {newer}."
        case "revoked":
            flag, detail = shared.CALIBRATION_REVOKED, f"Because: {status.revoked_reason}."
        case _:
            return []
    return [FlagAnswer(flag=flag.code, where="", detail=detail)]
