"""Plan of a measurement for the worker, made from a frame and a request."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import shared
from radiometry.frame.grid import Grid
from radiometry.frame.proof import Proof
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.methods import METHODS, get_method
from radiometry.records import Record
from radiometry.road.lanes import LaneGrid, describe_lanes
from radiometry.specification.application import BandApplication, PictureApplication, SurfaceApplication
from radiometry.specification.parameters import list_parameters
from store.codec import decode, decode_exposure, decode_header, encode, read_applied
from store.measuring.version import choose_version, find_falloff, read_lens
from store.queries.frame_times import read_frame_time, read_zones
from store.queries.frames import current_roi, whole_frame_of
from store.tables import Calibration, Campaign, FrameRow

_SAID = FrameRow.header["multispectral"]


class Captures:
    """Captures of the campaigns of the frames that are asked for, as they are when first asked."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._frames: dict[str, dict[tuple[str, str], str]] = {}

    def find(self, frame: FrameRow, band: str) -> FrameRow:
        """The frame of a band in the capture, and campaign, of a frame that has been read."""
        shown = (frame.header or {}).get("multispectral") or {}
        if shown.get("band") == band:
            return frame
        capture_id = shown.get("capture_id")
        found = self._of_campaign(frame.campaign_id).get((capture_id, band)) if capture_id else None
        if found is None:
            there = ", ".join(sorted(self.list_bands(frame)))
            raise shared.CAPTURE_INCOMPLETE.reject(
                f"The campaign holds no frame of band {band} of the capture that {frame.filename} belongs "
                f"to, or it has not been read yet; there are {there or 'none'}. Upload the other files."
            )
        return self._session.get_one(FrameRow, found)

    def list_bands(self, frame: FrameRow) -> dict[str, str]:
        capture_id = ((frame.header or {}).get("multispectral") or {}).get("capture_id")
        frames = self._of_campaign(frame.campaign_id) if capture_id else {}
        return {band: frame_id for (capture, band), frame_id in frames.items() if capture == capture_id}

    def _of_campaign(self, campaign_id: str) -> dict[tuple[str, str], str]:
        """Ids by capture and band; of two frames of one band the older."""
        if campaign_id not in self._frames:
            rows = self._session.execute(
                select(_SAID["capture_id"].as_string(), _SAID["band"].as_string(), FrameRow.id)
                .where(FrameRow.standing(campaign_id), FrameRow.state != "refused")
                .where(FrameRow.exposure_time_s.is_not(None))
                .order_by(FrameRow.id.desc())
            )
            self._frames[campaign_id] = {(capture, band): frame_id for capture, band, frame_id in rows}
        return self._frames[campaign_id]


# what frames must have in common to be averaged, beside their exposure
_FORMAT = ("width_px", "height_px", "cfa", "white_level_dn", "rendered")


def require_read(frame: FrameRow, method: str) -> None:
    """Refuse a frame that was refused, has not been read, or lacks the exposure that its method needs."""
    if frame.state == "refused":
        raise shared.FRAME_NOT_READ.reject(f"Frame {frame.filename} was refused: {frame.refusal_detail}")
    if frame.header is None:
        message = f"Frame {frame.filename} has not been read yet: wait for its job and ask again."
        raise shared.FRAME_NOT_READ.reject(message)
    application = get_method(method).application
    if frame.exposure is None and (application is None or application.needs_exposure):
        message = f"Frame {frame.filename} states no exposure: type its exposure_time_s, f_number and iso in."
        raise shared.EXPOSURE_MISSING.reject(message)


def read_proof(frame: FrameRow) -> Proof | None:
    return decode(Proof, frame.proof) if frame.proof else None


def require_whole(frame: FrameRow, proof: Proof | None, allowed: Sequence[str]) -> None:
    """Refuse a frame with an empty part, unless somebody has asked for it by the flag's name."""
    if proof is None or not proof.wholeness.empty or shared.IMAGE_PART_EMPTY in allowed:
        return
    raise shared.IMAGE_PART_EMPTY.reject(
        f"Frame {frame.filename}: {proof.describe_doubt(decode_header(frame.header or {}))}. Copy the file "
        f"from the card again. To measure it as it is, ask with allow=[{shared.IMAGE_PART_EMPTY}]: "
        "the measurement then carries that flag."
    )


def require_repeat(repeat: FrameRow, frame: FrameRow) -> None:
    """Refuse to average two frames that are not repeats of one scene, and name what differs."""
    header, other = frame.header or {}, repeat.header or {}
    compared = {
        "campaign": (frame.campaign_id, repeat.campaign_id),
        "scene": (frame.scene, repeat.scene),
        "exposure": (frame.exposure, repeat.exposure),
        **{name: (header.get(name), other.get(name)) for name in _FORMAT},
    }
    differing = [name.replace("_", " ") for name, (here, there) in compared.items() if here != there]
    if frame.sha256 == repeat.sha256:
        differing = ["nothing: they are one image"]
    if differing:
        raise shared.FRAMES_DIFFER.refuse(
            f"{repeat.filename} cannot be averaged with {frame.filename}; different: {', '.join(differing)}."
        )


class Asked(Record):
    """Statements of a request; None where it leaves the choice to what is recorded."""

    polygon: Polygon | None = None
    grid: Grid | None = None
    lanes: LaneGrid | None = None  # geometry of the grid, where it is one of lanes
    reflectance: float | None = None
    incidence_angle_deg: float | None = None
    index: str | None = None
    quantity: str | None = None
    frame_ids: tuple[str, ...] | None = None  # of one scene, averaged; the measurement's own first
    conditions: Mapping[str, Any] = field(default_factory=dict)  # surroundings, as the method names them
    products: tuple[str, ...] = field(default=())
    allow: tuple[str, ...] = field(default=())  # flags that forbid to measure a frame, unless named here


def plan_measurement(
    session: Session, frame: FrameRow, asked: Asked, named: Calibration | None, captures: Captures
) -> dict[str, Any]:
    """The parameters of the job that measures: what is decided here cannot change while it waits."""
    campaign = session.get_one(Campaign, frame.campaign_id)
    require_read(frame, campaign.method)
    require_whole(frame, read_proof(frame), asked.allow)
    _refuse_foreign_options(campaign.method, asked)
    calibration, chosen, why = choose_version(session, frame, campaign, named)
    polygon, origin = _find_region(session, frame, campaign, asked)
    repeats = [session.get_one(FrameRow, each) for each in (asked.frame_ids or ())[1:]]
    for repeat in repeats:
        require_read(repeat, campaign.method)
        require_whole(repeat, read_proof(repeat), asked.allow)
        require_repeat(repeat, frame)
        if (
            choose_version(session, repeat, campaign, named)[0] is not calibration
            or _find_region(session, repeat, campaign, asked)[0] != polygon
        ):
            raise shared.FRAMES_DIFFER.refuse(
                f"{repeat.filename} and {frame.filename} have different regions or calibration versions."
            )
    # another zone may be stated later
    taken = read_frame_time(frame, read_zones(session, campaign))
    plan = {
        "calibration_id": calibration.id,
        "calibration_chosen": chosen,
        "why": why,
        "polygon": _list_points(polygon),
        "region_origin": origin,
        "products": list(asked.products),
        **({"time_zone": taken.zone} if taken and taken.zone else {}),
        **({"allow": list(asked.allow)} if asked.allow else {}),
        **({"repeats": [{"frame_id": r.id, "sha256": r.sha256} for r in repeats]} if repeats else {}),
    }
    match get_method(campaign.method).application:
        case SurfaceApplication() as application:
            return plan | _plan_surface(session, frame, calibration, application, polygon, asked)
        case BandApplication() as application:
            stated = _find_conditions(campaign, application, asked)
            return plan | stated | _plan_band(frame, calibration, application, polygon, asked, captures)
        case PictureApplication() as application:
            _require_picture(frame, calibration, application, asked)
    return plan


def find_subject(session: Session, frame: FrameRow, asked: Asked, captures: Captures) -> FrameRow:
    """The frame that a measurement is of: of an index, its capture's near infrared one."""
    if asked.index is None:
        return frame
    method = session.get_one(Campaign, frame.campaign_id).method
    require_read(frame, method)
    _refuse_foreign_options(method, asked)
    application = get_method(method).application
    if not isinstance(application, BandApplication):
        raise TypeError(f"{method} takes an index without bands")
    return captures.find(frame, application.read_formula(asked.index).bands[0])


def list_others(parameters: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the frames of the capture's other bands that a plan names; older plans name one as `other`."""
    return parameters.get("others") or list(filter(None, [parameters.get("other")]))


def _refuse_foreign_options(method: str, asked: Asked) -> None:
    if get_method(method).application is None:
        able = ", ".join(spec.name for spec in METHODS if spec.application)
        raise shared.OPTION_NOT_OF_METHOD.reject(
            f"A frame of a {method} campaign has nothing to be measured. Upload it with role=field to a "
            f"campaign of one of these methods: {able}."
        )
    foreign = [
        name
        for spec in METHODS
        for name in spec.measurement_options
        if name not in get_method(method).measurement_options
        and (name in asked.conditions or getattr(asked, name, None) is not None)
    ]
    if foreign:
        message = f"{', '.join(foreign)}: no option of a {method} measurement. Leave it out."
        raise shared.OPTION_NOT_OF_METHOD.reject(message)


def require_lens(frame: FrameRow, calibration: Calibration, application: SurfaceApplication) -> Any:  # noqa: ANN401  the method's own
    """Return the lens that a version corrects, which must be that of the frame; None without one."""
    exposure, header = decode_exposure(frame.exposure or {}), frame.header or {}
    coefficient = application.choose_coefficient(read_applied(calibration), iso=exposure.iso)
    lens = read_lens(calibration, exposure)
    if lens is not None:
        channels = application.name_channels(header["cfa"], channel=coefficient.channel)
        lens.require(channels=channels, height_px=header["height_px"], width_px=header["width_px"])
    return lens


def _plan_surface(
    session: Session,
    frame: FrameRow,
    calibration: Calibration,
    application: SurfaceApplication,
    polygon: Polygon,
    asked: Asked,
) -> dict[str, Any]:
    coefficients, exposure = read_applied(calibration), decode_exposure(frame.exposure or {})
    header, lens = frame.header or {}, require_lens(frame, calibration, application)
    falloff = find_falloff(session, calibration)
    plan = {
        **({"grid": encode(asked.grid)} if asked.grid else {}),
        **({"reflectance": asked.reflectance} if asked.reflectance is not None else {}),
        **_find_conditions(session.get_one(Campaign, frame.campaign_id), application, asked),
        **({falloff.method: _name_version(falloff)} if falloff else {}),
    }
    request = read_request(application, {"polygon": _list_points(polygon), **plan})
    application.find_window(request, height_px=header["height_px"], width_px=header["width_px"])
    if "map" in asked.products or application.needs_scale(request):
        application.find_map_scale(coefficients, exposure, lens=lens)
    return plan | ({"lanes": describe_lanes(asked.lanes)} if asked.lanes else {})


def _find_conditions(
    campaign: Campaign, application: SurfaceApplication | BandApplication, asked: Asked
) -> dict[str, Any]:
    """Return what the request states of surroundings; what is left out, as the frame's campaign."""
    if application.conditions is None:
        return {}
    found, origin = {}, {}
    for each in list_parameters(application.conditions):
        if (value := asked.conditions.get(each.name)) is not None:
            found[each.field], origin[each.name] = value, "request"
        elif asked.conditions.keys().isdisjoint(each.displaced_by):
            value = getattr(campaign, each.name, None)
            found |= {} if value is None else {each.field: value}
            origin |= {} if value is None else {each.name: "campaign"}
    return {"conditions": found, **({"conditions_origin": origin} if origin else {})}


def _name_version(row: Calibration) -> dict[str, Any]:
    return {"calibration_id": row.id, "version": row.version, "content_sha256": row.content_sha256}


def _require_picture(
    frame: FrameRow, calibration: Calibration, application: PictureApplication, asked: Asked
) -> None:
    """Require that the whole frame is asked for as a picture, and that it has the calibration's size."""
    header = frame.header or {}
    application.require_size(
        read_applied(calibration), height_px=header["height_px"], width_px=header["width_px"]
    )
    if "map" not in asked.products or asked.polygon is not None:
        raise shared.OPTION_NOT_OF_METHOD.reject(
            f"What {calibration.method} gives of a frame is its whole {application.quantity}: ask for "
            "products=[map], without a region."
        )


def _plan_band(
    frame: FrameRow,
    calibration: Calibration,
    application: BandApplication,
    polygon: Polygon,
    asked: Asked,
    captures: Captures,
) -> dict[str, Any]:
    coefficients, angle_deg = read_applied(calibration), asked.incidence_angle_deg
    # without an angle of its own a measurement takes that of each version that it is compared by
    plan: dict[str, Any] = {} if angle_deg is None else {"incidence_angle_deg": angle_deg}
    header = decode_header(frame.header or {})
    bounding_window(polygon, height_px=header.height_px, width_px=header.width_px)
    radiance = asked.quantity not in (None, application.quantity)
    calibrated = {coefficient.band for coefficient in coefficients}
    bands: Sequence[str] = ()
    if asked.index is not None:
        if radiance:
            message = "An index is made of reflectances: leave quantity out."
            raise shared.OPTION_NOT_OF_METHOD.reject(message)
        formula = application.read_formula(asked.index, known=calibrated)
        plan |= {"index": formula.name}
        bands = formula.bands[1:]
    elif "bands" in asked.products:
        mine = (frame.header or {})["multispectral"]["band"]
        there = sorted(captures.list_bands(frame))
        bands = [band for band in there if band != mine and (radiance or band in calibrated)]
    others = [captures.find(frame, band) for band in bands]
    for other in others:
        require_whole(other, read_proof(other), asked.allow)
    headers = [header, *(decode_header(other.header or {}) for other in others)]
    if others:
        # without a correction: what the files state decides whether the bands see the region at all
        application.move_regions(polygon, header, [(each, None) for each in headers[1:]])
        plan |= {"others": [{"frame_id": other.id, "sha256": other.sha256} for other in others]}
    for each in headers:
        if radiance:
            application.require_radiance(each)
        else:
            application.find_scale_of_frame(each, coefficients=coefficients, incidence_angle_deg=angle_deg)
    application.find_place(header, decode(application.conditions, dict(asked.conditions)))
    return plan | ({"quantity": asked.quantity} if radiance else {})


def _list_points(polygon: Polygon) -> list[list[float]]:
    return [list(point) for point in polygon.points]


def read_request(application: SurfaceApplication, parameters: dict[str, Any]) -> Any:  # noqa: ANN401
    """Return the request of a plan, as the method takes it."""
    grid = parameters.get("grid")
    # measurements made before conditions could be stated have none
    stated = {}
    if "conditions" in parameters:
        stated["conditions"] = decode(application.conditions, parameters["conditions"])
    return application.request(
        polygon=Polygon.from_points(parameters["polygon"]),
        grid=decode(Grid, grid) if grid else None,
        reflectance=parameters.get("reflectance"),
        **stated,
    )


def _find_region(session: Session, frame: FrameRow, campaign: Campaign, asked: Asked) -> tuple[Polygon, str]:
    """Return the request's own region, else the outline of its grid, else the frame's or the campaign's."""
    application = get_method(campaign.method).application
    if isinstance(application, PictureApplication):
        return whole_frame_of(frame), "whole_frame"
    if asked.polygon is not None:
        return asked.polygon, "request"
    if asked.grid is not None and isinstance(application, SurfaceApplication):
        return application.outline(asked.grid), "grid"
    if (roi := current_roi(session, frame, campaign)) is not None:
        return Polygon.from_points(roi.points), "frame" if frame.roi_id else "campaign"
    if isinstance(application, BandApplication):
        return whole_frame_of(frame), "whole_frame"
    raise shared.REGION_MISSING.reject(
        f"Frame {frame.filename} has no region, nor has its campaign: draw one, or state one to measure in."
    )
