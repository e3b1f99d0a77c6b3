"""Published versions of several cameras, without a campaign's work behind them."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import func, select

from store.publications import publish, revoke
from store.tables import Calibration, Camera, Campaign, CoefficientRow
from tests.support.versions import fitted_version

START = datetime(2026, 1, 1, tzinfo=UTC)


def add_published(
    house,
    camera: dict,
    value: float,
    *,
    day: int = 0,
    dated: bool = True,
    campaign_id: str | None = None,
    lens: str | None = None,
    **columns,
) -> str:
    """One more version of a camera, from a campaign of that day, published and so superseding the last."""
    at = START + timedelta(days=day)
    row = {
        "name": "luminance_k",
        "value": value,
        "standard_uncertainty": 0.3,
        "unit": "DN*m2/(cd*s)",
        "iso": 3200.0,
        "model": "proportional",
        "flags": [],
    }
    with house.database.writing("test") as session:
        organisation_id = session.get_one(Camera, camera["id"]).organisation_id
        owner = {"organisation_id": organisation_id, "camera_id": camera["id"], "method": "luminance"}
        if campaign_id is None:
            campaign = Campaign(**owner, started_at=at if dated else None)
            session.add(campaign)
            session.flush()
        else:
            campaign = session.get_one(Campaign, campaign_id)
        number = 1 + (
            session.scalar(select(func.max(Calibration.version)).where(Calibration.camera_id == camera["id"]))
            or 0
        )
        configuration = {"lens": {"model": "9 mm", "serial": lens}} if lens else {}
        version = fitted_version(campaign, number, 3200.0, configuration=configuration)
        session.add(version)
        session.flush()
        session.add(CoefficientRow(calibration_id=version.id, position=0, **row | columns))
        session.flush()
        publish(session, version, valid_from=at, valid_to=None, reason="good")
        return version.id


def take_back(house, version_id: str) -> None:
    with house.database.writing("test") as session:
        revoke(session, session.get_one(Calibration, version_id), reason="wrong meter", by="test")
