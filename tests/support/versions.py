"""Calibration versions without a campaign's work behind them: for what is decided of them."""

from dataclasses import replace

from sqlalchemy import select

from store.codec import encode
from store.publications import InForce, overlaps
from store.tables import Calibration, Camera, Campaign, Organisation, Publication, Slot
from tests.radiometry.coefficients import COEFFICIENT

NOTHING = {"iso_fits": [], "points": [], "scenes": [], "flags": [], "tolerance_rel": 0.04, "passed": True}


def bare_version(campaign: Campaign, number: int, *, created_by: str = "test", **columns) -> Calibration:
    """A version of a campaign, not yet added, that says nothing of how it came about."""
    nothing = {"configuration": {}, "parameters": {}, "inputs": {}, "result": NOTHING, "software": {}}
    return Calibration(
        organisation_id=campaign.organisation_id,
        camera_id=campaign.camera_id,
        campaign_id=campaign.id,
        method=campaign.method,
        version=number,
        result_schema=1,
        content_sha256=f"{number:064x}",
        created_by=created_by,
        **nothing | columns,
    )


def fitted_version(campaign: Campaign, number: int, *isos: float, **columns) -> Calibration:
    """A luminance version, not yet added, with a coefficient of each ISO value and no points."""
    bare = {"models": [], "budget": [], "chi_squared_per_dof": 1.0, "birge_ratio": 1.0, "passed": True}
    bare |= {"expected_k": 1.0, "largest_residual_rel": 0.0}
    fits = [bare | {"coefficient": encode(replace(COEFFICIENT, iso=iso))} for iso in isos]
    result = NOTHING | {"iso_fits": fits}
    made = {"result": result, "parameters": {"exclude": []}, "inputs": {"frames": []}}
    return bare_version(campaign, number, **made | columns)


def add_versions(database, count: int) -> list[str]:
    """One camera with so many draft versions; their ids."""
    with database.writing("test") as session:
        organisation = Organisation(name="house")
        session.add(organisation)
        session.flush()
        camera = Camera(organisation_id=organisation.id, make="DJI", model="FC6520", serial="1")
        session.add(camera)
        session.flush()
        campaign = Campaign(organisation_id=organisation.id, camera_id=camera.id, method="luminance")
        session.add(campaign)
        session.flush()
        versions = [bare_version(campaign, number) for number in range(1, count + 1)]
        session.add_all(versions)
        session.flush()
        return [version.id for version in versions]


def find_held(session, camera_id, at, known_at):
    """What held at a time as known at another, by the plain words of the tables."""
    known = (Publication.known_from <= known_at) & (
        Publication.known_to.is_(None) | (Publication.known_to > known_at)
    )
    rows = session.execute(
        select(Calibration, Publication)
        .join(Publication, Publication.calibration_id == Calibration.id)
        .join(Slot, Slot.id == Publication.slot_id)
        .where(Slot.camera_id == camera_id, Slot.method == "luminance", known, overlaps(at, at))
        .order_by(Slot.configuration)
    )
    return [InForce(calibration=row[0], publication=row[1]) for row in rows]
