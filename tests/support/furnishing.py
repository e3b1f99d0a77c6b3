"""An organisation that has worked for three years: cameras, versions, decisions, failures; not the work."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import select

from store import jobs, publications
from store.queries.organisations import find_key
from store.tables import Camera, Campaign, CoefficientRow, Job, Meter, utc_now
from tests.support.versions import fitted_version

ISOS = (100, 400, 1600, 6400)
SERIALS = ("0K1XE8", "0K1XF2", "0K1XG5")
REASONS = ("first calibration, reviewed by A. Meier", "yearly calibration", "after the lens was cleaned")


def furnish(database, key: str) -> list[str]:
    """Three cameras, of which the last has nothing in force; the ids. The first has three versions."""
    with database.reading() as session:
        found, organisation = find_key(session, key)
    with database.writing(found.id, organisation.id) as session:
        cameras = [_camera(session, organisation.id, serial) for serial in SERIALS]
        for place, camera in enumerate(cameras[:2]):
            for number in range(1, 4 - place):
                _publish(session, camera, number, found.id, shift=place)
        session.add(
            Meter(
                organisation_id=organisation.id,
                kind="luminance",
                make="LMT",
                model="L 1009",
                serial="0496",
                certificate_number="PL-2024-17",
                certificate_laboratory="Photometry Laboratory",
                certificate_issued_on=datetime(2024, 1, 17, tzinfo=UTC).date(),
                certificate_due_on=datetime(2025, 1, 17, tzinfo=UTC).date(),
                certificate_expanded_uncertainty_rel=0.03,
                certificate_coverage_factor=2.0,
            )
        )
        return [camera.id for camera in cameras]


def postpone(database, key: str) -> None:
    """A job that waits for the store of the files."""
    job_id = set_aside(database, key)
    with database.writing("test") as session:
        job = session.get_one(Job, job_id)
        job.state, job.lost, job.due_at = "queued", 0, utc_now() + timedelta(seconds=60)
        detail = "The store of the files did not serve. The job is retried automatically, for a day at most."
        job.error = {"code": "temporarily_unavailable", "detail": detail, "retryable": True}


def set_aside(database, key: str) -> str:
    """A job that lost three workers; its id."""
    with database.reading() as session:
        found, organisation = find_key(session, key)
        campaign = session.scalar(select(Campaign).where(Campaign.organisation_id == organisation.id))
    with database.writing("test", organisation.id) as session:
        job = jobs.enqueue(
            session,
            kind="fit",
            subject_id=campaign.id,
            organisation_id=organisation.id,
            by=found.id,
            parameters={},
        )
        job.state, job.lost = "quarantined", 3
        detail = "Its worker was lost 3 times while it ran."
        job.error = {"code": "worker_lost", "detail": detail, "retryable": False}
        return job.id


def _camera(session, organisation_id, serial):
    camera = Camera(
        organisation_id=organisation_id,
        make="DJI",
        model="FC6520",
        serial=serial,
        lens_make="DJI",
        lens_model="MFT 15mm F1.7 ASPH",
        pixel_pitch_um=3.28,
        sensor_width_mm=17.3,
    )
    session.add(camera)
    session.flush()
    return camera


def _publish(session, camera, number, by, *, shift):
    """One version a year, each a little lower than the last."""
    at = datetime(2023, 5, 4, 20, tzinfo=UTC) + timedelta(days=365 * number)
    campaign = Campaign(
        organisation_id=camera.organisation_id,
        camera_id=camera.id,
        method="luminance",
        project_number=f"P-{number}",
        started_at=at,
    )
    session.add(campaign)
    session.flush()
    version = fitted_version(campaign, number, *map(float, ISOS), created_by=by)
    session.add(version)
    session.flush()
    session.add_all(
        CoefficientRow(
            calibration_id=version.id,
            position=place,
            name="luminance_k",
            value=33.1 - 0.45 * number + 0.12 * place + 0.3 * shift + 0.05 * (-1) ** (number + place),
            standard_uncertainty=0.21 + 0.05 * place,
            unit="DN*m2/(cd*s)",
            iso=float(iso),
            model="proportional",
            flags=["noise_high"]
            if (number, iso) == (3, 6400)
            else ["meter_certificate_missing"] * (camera.serial == SERIALS[1]),
        )
        for place, iso in enumerate(ISOS)
    )
    session.flush()
    publications.publish(session, version, valid_from=at, valid_to=None, reason=REASONS[number - 1])
