"""Plan of a road's evaluation for the worker, and the evaluation as it is kept."""

import hashlib
import json

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from radiometry import methods
from radiometry.findings import shared
from radiometry.frame.pose import GroundHeight, Pose, find_pose
from radiometry.road import codes
from radiometry.road.placing import NOMINAL_FOCAL_U, Lens, Mark, Placement, place_by_pose, place_frame
from radiometry.road.site import Road as StatedRoad
from radiometry.road.site import Site
from radiometry.specification.application import PictureApplication, SurfaceApplication
from store import files, software
from store.blobs import StoredBlob
from store.codec import decode, decode_header, encode, read_applied
from store.measuring.plan import read_proof, require_lens, require_read, require_whole
from store.measuring.record import describe_software
from store.measuring.version import choose_version, find_falloff
from store.publications import in_force
from store.queries import add
from store.queries.frame_times import FrameClocks
from store.tables import Calibration, Camera, Campaign, FrameRow, Json, Road, RoadResult

RESULT_SCHEMA = 1
_USUAL_VIEW = 1.0
"""Focal length over the frame's width where neither geometry nor optics are known: 53 degrees wide."""


def plan_evaluation(session: Session, row: Road, stated: StatedRoad) -> Json:
    """Return the parameters of the job: what is decided here cannot change while it waits."""
    clocks = FrameClocks(session)
    frames = [_plan_frame(session, clocks, each, stated.site) for each in row.frames]
    return {"road": encode(stated), "frames": frames}


def _plan_frame(session: Session, clocks: FrameClocks, stated: Json, site: Site) -> Json:
    frame = session.get_one(FrameRow, stated["frame_id"])
    campaign = session.get_one(Campaign, frame.campaign_id)
    require_read(frame, campaign.method)
    require_whole(frame, read_proof(frame), ())
    application = methods.get_method(campaign.method).application
    if not isinstance(application, SurfaceApplication):
        raise shared.OPTION_NOT_OF_METHOD.reject(f"Frame {frame.filename} is not of a luminance campaign.")
    calibration, _, why = choose_version(session, frame, campaign, None)
    require_lens(frame, calibration, application)
    falloff = find_falloff(session, calibration)
    return {
        "sha256": frame.sha256,
        "calibration_id": calibration.id,
        "why": why,
        **({falloff.method: {"calibration_id": falloff.id}} if falloff else {}),
        **plan_placement(session, clocks, frame, stated, site),
    }


def plan_placement(session: Session, clocks: FrameClocks, frame: FrameRow, stated: Json, site: Site) -> Json:
    """Return what places a frame as it is stated, with its camera and own position, for `read_placement`."""
    campaign = session.get_one(Campaign, frame.campaign_id)
    geometry = _find_geometry(session, clocks, frame, campaign.camera_id)
    focal_mm, pitch_um = campaign.focal_length_mm, session.get_one(Camera, campaign.camera_id).pixel_pitch_um
    known = {
        **({"geometry_id": geometry.id} if geometry else {}),
        **({"focal_px": 1e3 * focal_mm / pitch_um} if focal_mm and pitch_um else {}),
    }
    pose = {} if "marks" in stated else {"pose": _find_pose(frame, stated, site, known)}
    return stated | known | pose


def read_placement(
    named: Json, geometry: Calibration | None, site: Site, *, height_px: int, width_px: int
) -> Placement:
    """Place a frame by its marks, else by its own position, with the lens in force or one by its optics."""
    focal_px = named.get("focal_px", _USUAL_VIEW * width_px)
    camera = Lens.of_focal_length(focal_px, height_px=height_px, width_px=width_px)
    if geometry is not None:
        known = read_applied(geometry)
        camera = Lens(known.matrix, known.distortion)
    if "marks" in named:
        return place_frame(decode(tuple[Mark, ...], named["marks"]), camera)
    assert site.origin is not None  # noqa: S101  the plan has seen it
    u_rel = 0.0 if geometry else NOMINAL_FOCAL_U
    return place_by_pose(decode(Pose, named["pose"]), site.origin, camera, focal_u_rel=u_rel)


def _find_pose(frame: FrameRow, stated: Json, site: Site, optics: Json) -> Json:
    """Return the own place of a frame without marks, as far as all that it takes is known."""
    heights = {name: each for name, each in stated.items() if name.startswith("height_")}
    found = find_pose(decode_header(frame.header or {}), GroundHeight(**heights))
    if site.origin is None:
        found = "the site has no origin"
    if not optics:
        found = "the camera has no geometry in force, and its focal length and pixel pitch are not stated"
    if isinstance(found, str):
        raise codes.PLACE_UNDETERMINED.refuse(f"Frame {frame.filename} has no marks, and {found}.")
    kept: Json = encode(found)
    return kept


def _find_geometry(
    session: Session, clocks: FrameClocks, frame: FrameRow, camera_id: str
) -> Calibration | None:
    """Return the one geometry of the camera in force when a frame of its size was taken."""
    if (taken := clocks.find(frame)) is None:
        return None
    spec = next(each for each in methods.METHODS if isinstance(each.application, PictureApplication))
    found = in_force(session, camera_id=camera_id, method=spec.name, at=taken.earliest, until=taken.latest)
    known = [held.calibration for held in found if held.holds(taken.earliest, taken.latest)]
    size = {name: (frame.header or {})[name] for name in ("height_px", "width_px")}
    fitting = [each for each in known if size.items() <= vars(read_applied(each)).items()]
    return fitting[0] if len(fitting) == 1 else None


def write_result(
    session: Session, row: Road, parameters: Json, result: Json, picture: StoredBlob | None, *, by: str
) -> RoadResult:
    """Write an evaluation once; the same content again is the one that exists."""
    if picture is not None:
        files.keep_blobs(session, [picture])
    session.get_one(Road, row.id, with_for_update=True)
    content = json.dumps([parameters, software.MEASURER], sort_keys=True).encode()
    content_sha256 = hashlib.sha256(content).hexdigest()
    mine = select(RoadResult).where(RoadResult.road_id == row.id)
    if (found := session.scalar(mine.filter_by(content_sha256=content_sha256))) is not None:
        return found
    last = session.scalar(select(func.max(RoadResult.number)).where(RoadResult.road_id == row.id)) or 0
    made = RoadResult(
        organisation_id=row.organisation_id,
        road_id=row.id,
        number=last + 1,
        inputs=parameters,
        result=result,
        result_schema=RESULT_SCHEMA,
        software=describe_software(),
        content_sha256=content_sha256,
        map_png_sha256=picture.sha256 if picture else None,
        created_by=by,
    )
    return add(session, made)
