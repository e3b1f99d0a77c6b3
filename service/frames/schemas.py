"""Frames: what came, what it says of itself, and its statistics."""

from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema
from typing_extensions import TypeAliasType

from radiometry.findings import InputRejected, Reason
from radiometry.frame import FrameHeader, verdicts
from radiometry.frame.statistics import ChannelStatistics
from radiometry.methods import METHODS, findings
from radiometry.specification.application import FoundBy
from service.campaigns.schemas import REGION_PATTERN, Role
from service.http import models
from service.http.models import Answer, Flag, Form, Text, maybe, told
from store import blobs, codec, tables
from store.queries.evidence import list_panels
from store.queries.frames import FrameColumns

_measure_light = next(spec.measure_light for spec in METHODS if spec.measure_light)
_REASONS = [each.code for each in findings.FINDINGS.values() if "verdict" in each.where]
ReasonCode = TypeAliasType("ReasonCode", Annotated[str, WithJsonSchema({"type": "string", "enum": _REASONS})])
MOST_FRAMES = 1000


class Upload(Form):
    """Statements of the field team about the file that it sends."""

    role: Role
    scene: Text | None = maybe("The light level that a light frame belongs to.")
    filename: str | None = maybe("Its name; folders are left out.", min_length=1)
    exposure_time_s: models.PositiveText | None = maybe("For a file that does not say it.")
    f_number: models.PositiveText | None = maybe("For a file that does not say it.")
    iso: models.PositiveText | None = maybe("For a file that does not say it.")
    roi: models.LongText | None = maybe(
        "The frame's own region, where the camera has moved: [[x,y],...], or a "
        "makePolygon(...) or makeRectangle(...) call of an ImageJ macro.",
        json_schema_extra={"pattern": REGION_PATTERN},
    )


class FrameChange(Form):
    """A correction of what was said of a frame; it is then read again, except for scene and left_out."""

    role: Role | None = maybe("What the frame shows: it decides what it is used for.")
    scene: models.Clearable | None = maybe('The light level that it shows; "" for a frame without one.')
    left_out: Flag | None = maybe("Keep the frame, and leave it out of every fit and batch measurement.")
    reason: models.LongText | None = maybe("Why it is left out.")
    withdrawn: Flag | None = maybe("Take the frame out of its campaign; false restores it.")
    exposure_time_s: models.Positive | None = maybe("For a file that does not say it.")
    f_number: models.Positive | None = maybe("For a file that does not say it.")
    iso: models.Positive | None = maybe("For a file that does not say it.")


class ExpectedFrame(Form):
    """A frame as its user saw it."""

    role: Role | None = None
    scene: models.Clearable | None = maybe('"" for a frame without one.')
    left_out: Flag | None = None
    withdrawn: Flag | None = None


class FramesChange(FrameChange):
    """The same correction of many frames of one campaign."""

    frame_ids: Annotated[list[Text], Field(min_length=1, max_length=MOST_FRAMES)]
    expected: ExpectedFrame | None = maybe(
        "As all of them were seen: if one has been changed meanwhile, none is, and the answer is "
        "409 `changed_meanwhile`."
    )


class FramesChanged(Answer):
    """How many frames were named, and how many of them are read again."""

    frames: int
    read_again: int


class CameraAsRead(Answer, restates=FrameHeader, fields="make model serial lens_make lens_model lens_serial"):
    pass


class Refusal(Answer):
    code: str
    detail: str


class ReasonAnswer(Answer, restates=Reason):
    code: ReasonCode
    detail: str = told("A sentence with the numbers and what to do.")


class VerdictAnswer(Answer, restates=verdicts.Verdict):
    """Verdict on a frame: what a field team does about it while it is on site."""


class StatisticsRow(Answer, restates=ChannelStatistics):
    """One channel in one region; raw DN, black not subtracted."""

    roi: str
    i_sq: float | None = maybe("Of a band: the region's mean after black, then vignetting.")
    i_sq_standard_uncertainty: float | None = None
    i_sq_unit: str | None = None
    gradient_rel: float | None = maybe("How much i_sq changes across the region.")
    extractor: str

    @classmethod
    def of(cls, extraction: tables.Extraction, row: ChannelStatistics) -> "StatisticsRow":
        return cls.restate(row, extraction, extraction.features or {}, roi=extraction.roi_id)


class SunshineAnswer(Answer):
    """The light while the band was exposed: the mean of the valid readings."""

    i_ss: float
    standard_uncertainty: float
    unit: str
    readings: int = told("Valid ones.")
    spread_rel: float | None = maybe("Of the valid readings; none for one.")
    left_out: list[str] = told("Why the others are not valid.")
    serial: str | None = None


class SunshineMissing(Answer):
    code: str
    detail: str


class FrameAnswer(
    Answer,
    restates=tables.FrameRow,
    fields="id campaign_id sha256 filename scene roi_id exposure_time_s f_number iso withdrawn_at warnings "
    "created_at",
):
    size_bytes: int | None = None
    stored_file: blobs.Damage | None = maybe(
        "What the disk did to the file: upload it again, which heals it."
    )
    role: Role
    roi_origin: Literal["drawn", "found"] | None = maybe(
        "Of the frame's own region: drawn by a person, or found on a panel."
    )
    roi_found_by: FoundBy | None = maybe(
        "How it was found: by the panel's code, in the file's `ReflectArea`, or from another "
        "band of the capture. A drawn region goes before a found one."
    )
    panel_serial: str | None = maybe(
        "Of the panel that the frame shows, by its code in the image or the file."
    )
    supplied: dict[str, float] | None = None
    state: tables.campaign.FrameState
    camera: CameraAsRead | None = None
    exposure: dict[str, Any] | None = maybe("Nominal and APEX values and their origin.")
    black_level_dn: float | None = maybe("Mean over the sites of the CFA pattern.")
    white_level_dn: float | None = maybe("The lowest of the sites.")
    cfa: str | None = None
    width_px: int | None = None
    height_px: int | None = None
    taken_at: str | None = None
    metadata: dict[str, Any] | None = maybe("Everything that the file says of itself.")
    band: str | None = maybe("Of a multispectral camera's file.")
    capture_id: str | None = maybe("The same in all bands of one capture.")
    sunshine: SunshineAnswer | None = None
    sunshine_missing: SunshineMissing | None = maybe(
        "Why a multispectral file has no sunshine reading that can be used."
    )
    refusal: Refusal | None = None
    left_out: dict[str, str] | None = maybe("Who left it out, and why.")
    statistics: list[StatisticsRow]
    verdict: VerdictAnswer | None = maybe(
        "Of the campaign as it is now. Left out where an upload or a change "
        "finds nothing to do: ask for the frame."
    )
    job_id: str | None = maybe("The newest job that reads it.")
    kept: list[str] | None = maybe(
        "Of an upload of a file that the campaign has: what was stated otherwise and stays as it is. A PATCH "
        "of the frame changes it."
    )

    @classmethod
    def of(
        cls,
        row: tables.FrameRow,
        *,
        blob: tables.Blob,
        statistics: list[StatisticsRow] | None = None,
        verdict: verdicts.Verdict | None = None,
        job_id: str | None = None,
    ) -> "FrameAnswer":
        refusal = None
        if row.refusal_code is not None:
            refusal = Refusal(code=row.refusal_code, detail=row.refusal_detail or "")
        return cls.restate(
            _from_header(row.header) | _from_band(row.header) | _from_found(row),
            row,
            supplied=row.supplied or None,
            size_bytes=blob.size_bytes,
            stored_file=blob.damage,
            refusal=refusal,
            statistics=statistics or [],
            verdict=VerdictAnswer.model_validate(verdict) if verdict else None,
            job_id=job_id,
        )


def _from_found(row: tables.FrameRow) -> dict[str, Any]:
    found, named = row.found or {}, list_panels(FrameColumns.of(row))
    answer: dict[str, Any] = {"panel_serial": named[0] if named else None}
    if row.roi_id is None:
        return answer
    if found.get("roi_id") != row.roi_id:
        return answer | {"roi_origin": "drawn"}
    return answer | {"roi_origin": "found", "roi_found_by": found.get("by", "code")}


def _from_header(header: dict[str, Any] | None) -> dict[str, Any]:
    if header is None:
        return {"metadata": None}
    said = {name: value for name, value in header.items() if value is not None}
    return {
        "camera": CameraAsRead.model_validate({n: said.get(n) for n in CameraAsRead.model_fields}),
        "black_level_dn": sum(said["black_level_dn"]) / len(said["black_level_dn"]),
        "white_level_dn": min(said["white_level_dn"]),
        "metadata": said,
        **{name: said.get(name) for name in ("cfa", "width_px", "height_px", "taken_at")},
    }


def _from_band(header: dict[str, Any] | None) -> dict[str, Any]:
    band = codec.decode_header(header).multispectral if header and header.get("multispectral") else None
    if band is None:
        return {}
    said: dict[str, Any] = {"band": band.band, "capture_id": band.capture_id}
    try:
        sunshine = _measure_light(band)
    except InputRejected as missing:
        return said | {"sunshine_missing": SunshineMissing(code=str(missing.code), detail=missing.message)}
    return said | {"sunshine": SunshineAnswer.restate(sunshine, serial=band.sunshine_serial)}
