"""Measurements: what is asked for, and what is answered."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from radiometry.flags import Flag
from radiometry.luminance.advice import advise
from radiometry.surface import MAX_CELLS_A_SIDE
from service.schemas.base import Answer, Form, Instant, Quantity, Text
from service.schemas.campaigns import NewRoi, Point, Reflectance
from service.schemas.jobs import JobAnswer
from store.queries.calibrations import Standing
from store.tables import Calibration, FrameRow, Measurement

Side = Annotated[int, Field(ge=1, le=MAX_CELLS_A_SIDE, strict=True)]
_CORNERS: list[Any] = [[2200, 1600], [3100, 1620], [3160, 2300], [2140, 2290]]


class NewGrid(Form):
    """Equal cells of a rectangular surface, by the image of its corners."""

    corners: Annotated[
        list[Point],
        Field(
            min_length=4,
            max_length=4,
            description="[x, y] in pixels of the surface's corners: top-left, top-right, bottom-right, "
            "bottom-left.",
        ),
    ]
    rows: Side
    columns: Side


class MeasurementOptions(Form):
    """How to measure; what is left out is taken from the frame, its campaign and what is in force."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"reflectance": 0.08, "products": ["map"]}]})

    calibration_id: Annotated[
        Text | None, Field(description="Else the version in force when the frame was taken.")
    ] = None
    roi: Annotated[NewRoi | None, Field(description="Else the frame's region, else the campaign's.")] = None
    grid: NewGrid | None = None
    reflectance: Annotated[
        Reflectance | None, Field(description="rho of the surface: gives E = pi L / rho.")
    ] = None
    products: Annotated[list[Literal["map"]] | None, Field(max_length=1)] = None


class NewMeasurement(MeasurementOptions):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "frame_id": "frm_1",
                    "grid": {"corners": _CORNERS, "rows": 3, "columns": 5},
                    "products": ["map"],
                }
            ]
        }
    )

    frame_id: Text


class CalibrationUsed(Answer):
    id: str
    version: int
    why: str
    state: Literal["draft", "published", "superseded", "revoked"] = Field(description="As it stands now.")
    superseded_by: str | None = None
    revoked_reason: str | None = None


class FlagAnswer(Answer):
    flag: str
    where: str = Field(description='"" for the whole, "grid" for its cells.')
    detail: str


class BudgetRow(Answer):
    """One source's share of the mean's uncertainty."""

    source: str
    shared: bool = Field(description="The same error in every pixel: no mean over pixels reduces it.")
    standard_uncertainty_cd_m2: float
    variance_share: float


class PercentileAnswer(Answer):
    percent: int
    luminance: Quantity


class GridAnswer(Answer):
    """The cells as the surface runs, row by row."""

    corners: list[list[float]]
    rows: int
    columns: int
    cell_model: str = Field(description="`projective`: equal cells of the surface, not of its image.")
    cells: list[list[Quantity]]


def _quantity(value: float, uncertainty: float, unit: str = "cd/m2") -> dict[str, Any]:
    return {"value": value, "standard_uncertainty": uncertainty, "unit": unit}


_EXAMPLE: dict[str, Any] = {
    "id": "msr_1",
    "frame_id": "frm_1",
    "campaign_id": "cmp_1",
    "camera_id": "cam_1",
    "filename": "DJI_0100.DNG",
    "method": "luminance",
    "calibration": {
        "id": "cal_1",
        "version": 3,
        "why": "version 3 is in force from 2026-05-01T00:00:00Z on",
        "state": "published",
    },
    "region": _CORNERS,
    "region_origin": "campaign",
    "pixels": 310000,
    "mean": _quantity(0.787, 0.028),
    "shared_u_cd_m2": 0.028,
    "noise_u_cd_m2": 0.0001,
    "min": _quantity(0.44, 0.022),
    "max": _quantity(1.23, 0.046),
    "median": _quantity(0.8, 0.028),
    "percentiles": [{"percent": 5, "luminance": _quantity(0.48, 0.023)}],
    "budget": [
        {
            "source": "f-number",
            "shared": True,
            "standard_uncertainty_cd_m2": 0.0236,
            "variance_share": 0.71,
        }
    ],
    "saturated_share": 0.0,
    "vignetting": "none",
    "signal": "green",
    "flags": [
        {
            "flag": "no_vignetting_correction",
            "where": "",
            "detail": "Vignetting was corrected with: none.",
        }
    ],
    "to_do_better": ["Calibrate the vignetting of this lens from flat fields."],
    "links": {"map_tif": "/v1/measurements/msr_1/map.tif", "map_png": "/v1/measurements/msr_1/map.png"},
    "parameters": {"products": ["map"]},
    "software": {"stilb": "0.1.0"},
    "content_sha256": "0" * 64,
    "created_at": "2026-05-03T08:00:00Z",
    "created_by": "key_1",
}


class MeasurementAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    id: str
    frame_id: str
    campaign_id: str
    camera_id: str
    filename: str
    taken_at: str | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    method: str
    calibration: CalibrationUsed
    region: list[list[float]]
    region_origin: Literal["request", "frame", "campaign", "grid"]
    pixels: int = Field(description="How many measured pixels the region holds.")
    mean: Quantity
    shared_u_cd_m2: float = Field(
        description="The part of the mean's standard uncertainty that all pixels share [cd/m2]."
    )
    noise_u_cd_m2: float = Field(description="The part that is the mean's own noise [cd/m2].")
    min: Quantity
    max: Quantity
    median: Quantity
    percentiles: list[PercentileAnswer] = Field(description="Of single pixels, with a single pixel's noise.")
    budget: list[BudgetRow]
    illuminance: Quantity | None = Field(default=None, description="E = pi L / rho of the region's mean.")
    grid: GridAnswer | None = None
    l_av_cd_m2: Quantity | None = None
    l_min_cd_m2: Quantity | None = None
    l_max_cd_m2: Quantity | None = None
    u_o: Quantity | None = Field(default=None, description="L_min / L_av over the cells.")
    u_l: list[Quantity] | None = Field(default=None, description="L_min / L_max along each row of cells.")
    average_to_min: Quantity | None = None
    max_to_min: Quantity | None = None
    grid_illuminance: Quantity | None = Field(default=None, description="E = pi L_av / rho.")
    saturated_share: float
    vignetting: str = Field(description="What vignetting was corrected with.")
    signal: str
    flags: list[FlagAnswer]
    to_do_better: list[str]
    links: dict[str, str]
    parameters: dict[str, Any]
    software: dict[str, Any]
    content_sha256: str
    created_at: Instant
    created_by: str

    @classmethod
    def of(
        cls, row: Measurement, frame: FrameRow, calibration: Calibration, standing: Standing
    ) -> "MeasurementAnswer":
        result, header = row.result, frame.header or {}
        place: dict[str, Any] = {name: header.get(name) for name in _FROM_HEADER}
        flags = [FlagAnswer.model_validate(raised) for raised in result["flags"]] + _flags_of(standing)
        budget = [(share["source"], share["variance_share"]) for share in result["budget"]]
        return cls(
            **{name: getattr(row, name) for name in _FROM_ROW},
            **{name: result[name] for name in ("pixels", "mean", "median", "saturated_share", "vignetting")},
            **place,
            **_surface(row),
            camera_id=calibration.camera_id,
            filename=frame.filename,
            calibration=CalibrationUsed(
                id=calibration.id,
                version=calibration.version,
                why=result["why"],
                state=standing.state,
                superseded_by=standing.superseded_by,
                revoked_reason=standing.revoked_reason,
            ),
            region=row.parameters["polygon"],
            region_origin=row.parameters["region_origin"],
            shared_u_cd_m2=result["shared_u_cd_m2"],
            noise_u_cd_m2=result["noise_u_cd_m2"],
            min=result["smallest"],
            max=result["largest"],
            percentiles=result["percentiles"],
            budget=result["budget"],
            illuminance=result["illuminance_lx"],
            signal=result["channel"],
            flags=flags,
            to_do_better=list(advise([raised.flag for raised in flags], budget=budget)),
            links=_links(row),
        )


_FROM_ROW = (
    *("id", "frame_id", "campaign_id", "method", "parameters", "software", "content_sha256"),
    *("created_at", "created_by"),
)
_FROM_HEADER = ("taken_at", "latitude_deg", "longitude_deg", "altitude_m")
_FIGURES = ("l_av_cd_m2", "l_min_cd_m2", "l_max_cd_m2", "u_o", "average_to_min", "max_to_min")


def _surface(row: Measurement) -> dict[str, Any]:
    surface = row.result["surface"]
    if surface is None:
        return {}
    grid = row.parameters["grid"]
    lines = surface["u_l"]
    return {
        "grid": GridAnswer(**grid, cell_model=surface["cell_model"], cells=surface["cells"]),
        **{name: surface[name] for name in _FIGURES},
        # a row without a positive luminance has no ratio, and null is no answer
        "u_l": lines if all(lines) else None,
        "grid_illuminance": surface["illuminance_lx"],
    }


def _links(row: Measurement) -> dict[str, str]:
    own = f"/v1/measurements/{row.id}"
    links = {"frame": f"/v1/frames/{row.frame_id}", "calibration": f"/v1/calibrations/{row.calibration_id}"}
    if row.map_tif_sha256 is not None:
        links |= {"map_tif": f"{own}/map.tif", "map_png": f"{own}/map.png"}
    return links


def _flags_of(standing: Standing) -> list[FlagAnswer]:
    """What has become of the version since."""
    match standing.state:
        case "draft":
            flag, detail = Flag.CALIBRATION_NOT_PUBLISHED, "It is a draft."
        case "superseded":
            flag, detail = Flag.CALIBRATION_SUPERSEDED, f"By {standing.superseded_by or 'another version'}."
        case "revoked":
            flag, detail = Flag.CALIBRATION_REVOKED, f"Because: {standing.revoked_reason}."
        case _:
            return []
    return [FlagAnswer(flag=flag.value, where="", detail=detail)]


class NotMeasured(Answer):
    """A frame that cannot be measured, and why."""

    frame_id: str
    filename: str
    code: str
    detail: str


class CampaignMeasurementsAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "jobs": [JobAnswer.model_json_schema()["examples"][0] | {"kind": "measure"}],
                    "not_measured": [
                        {
                            "frame_id": "frm_2",
                            "filename": "DJI_0101.DNG",
                            "code": "iso_not_calibrated",
                            "detail": "The frame was taken at ISO 100; this calibration holds ISO 3200.",
                        }
                    ],
                }
            ]
        }
    )

    jobs: list[JobAnswer]
    not_measured: list[NotMeasured]
