"""The fleet's verdict and a camera's drift over HTTP: which versions count, what is said, what is refused."""

import itertools
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import func, select

from radiometry.fleet.verdict import judge_fleet
from store.publications import publish, revoke
from store.queries.fleet import list_determinations
from store.tables import Blob, Calibration, Camera, Campaign, CoefficientRow, FrameRow
from tests.support.versions import fitted_version

pytestmark = pytest.mark.either_database

ALIKE = {"A": (33.0, 33.2, 32.9), "B": (33.1, 33.0, 33.2), "C": (32.9, 33.0, 33.1)}
APART = {"A": (30.0, 30.2, 29.9), "B": (33.1, 33.0, 33.2), "C": (36.2, 36.0, 36.1)}

START = datetime(2026, 1, 1, tzinfo=UTC)
numbers = itertools.count()


@pytest.fixture
def house(shared_house):
    return shared_house


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


def add_fleet(house, values):
    """New cameras of a new model; by name, with their versions."""
    model = f"model {next(numbers)}"
    cameras = {name: house.camera(model=model, serial=name) for name in values}
    versions = {
        name: [add_published(house, cameras[name], value, day=30 * n) for n, value in enumerate(repeats)]
        for name, repeats in values.items()
    }
    return cameras, versions


def judge(house, cameras, *, status=200, **said):
    body = {
        "method": "luminance",
        "camera_ids": [camera["id"] for camera in cameras.values()],
        "tolerance": 0.04,
    }
    return house.post("/v1/fleet/verdict", body | said, status=status)


def detail(house, cameras, **said):
    problem = judge(house, cameras, status=422, **said)
    assert problem["code"] == "validation_failed"
    return problem["detail"]


def test_a_fleet_that_is_alike_shares(house):
    cameras, _ = add_fleet(house, ALIKE)
    found = judge(house, cameras)
    assert (found["verdict"], found["method"]) == ("shared", "luminance")
    assert found["said"] == "One set of coefficients serves all 3 cameras."
    assert [(each["serial"], each["repeats"]) for each in found["cameras"]] == [("A", 3), ("B", 3), ("C", 3)]
    (k,) = found["parameters"]
    assert (k["name"], k["iso"], k["model"]) == ("luminance_k", 3200, "proportional")
    assert (k["verdict"], k["judged"], k["cameras"], k["repeats"], k["dof"]) == ("shared", True, 3, 9, 6)
    assert k["tolerance"] == {"limit": 4, "unit": "%", "kind": "relative", "of": "of the luminance"}
    assert k["cost"]["unit"] == "%"
    assert k["cost"]["value"] == pytest.approx(100 * (33.1 / (99.1333333 / 3) - 1), rel=1e-6)
    assert k["costliest"] == "B"
    assert k["within_camera_variance"]["value"] == pytest.approx((0.14 / 3 + 0.04) / 6)
    assert k["within_camera_variance"]["unit"] == "(DN*m2/(cd*s))^2"
    assert k["between_camera_variance"]["value"] == 0
    assert 0 < k["f_p_value"] < 1
    assert k["equivalence_p_value"] < 0.05
    assert [each["label"] for each in k["effects"][0]["deviations"]] == ["A", "B", "C"]
    assert found["left_out"] == []
    assert len(found["assumed"]) == 4


def test_a_fleet_that_differs_does_not(house):
    cameras, _ = add_fleet(house, APART)
    found = judge(house, cameras)
    assert found["verdict"] == "per_camera"
    assert found["said"] == "Each camera needs its own set: luminance_k at ISO 3200."
    assert found["parameters"][0]["exceedance_p_value"] < 0.05
    assert judge(house, cameras, tolerance={"luminance_k": 0.2})["verdict"] == "shared"
    with house.database.reading() as session:
        rows = [session.get_one(Camera, camera["id"]) for camera in cameras.values()]
        determined = list_determinations(session, rows, "luminance", {})
    expected = judge_fleet(determined, method="luminance", cameras=list(cameras), tolerance=0.04)
    (answer,) = found["parameters"]
    assert answer["said"] == expected.parameters[0].said
    assert answer["exceedance_p_value"] == expected.parameters[0].judgement.exceedance_p_value


def test_single_versions_tell_nothing_and_nothing_published_is_an_answer(house):
    cameras, _ = add_fleet(house, {"A": (33.0,), "B": (36.0,)})
    found = judge(house, cameras)
    assert (found["verdict"], found["parameters"][0]["verdict"]) == ("cannot_tell", "cannot_tell")
    assert "equivalence_p_value" not in found["parameters"][0]
    cameras, _ = add_fleet(house, {"A": (), "B": ()})
    found = judge(house, cameras)
    assert (found["verdict"], found["parameters"]) == ("cannot_tell", [])
    assert "A, B without a published version" in found["said"]


def test_a_revoked_version_is_no_repeat_and_a_superseded_one_is(house):
    cameras, versions = add_fleet(house, {**ALIKE, "A": (33.0, 33.2, 32.9, 50.0)})
    assert judge(house, cameras)["verdict"] == "cannot_tell"
    take_back(house, versions["A"][3])
    found = judge(house, cameras)
    assert found["verdict"] == "shared"
    assert found["cameras"][0]["repeats"] == 3


def test_a_draft_is_no_repeat(house):
    cameras, versions = add_fleet(house, ALIKE)
    with house.database.writing("test") as session:
        published = session.get_one(Calibration, versions["A"][0])
        columns = {name: getattr(published, name) for name in Calibration.__table__.columns.keys()}  # noqa: SIM118
        changed = {"id": f"cal_draft_{next(numbers)}", "version": 9, "content_sha256": "d" * 64}
        session.add(Calibration(**columns | changed))
    assert judge(house, cameras)["cameras"][0]["repeats"] == 3


def test_a_second_version_of_a_campaign_takes_the_place_of_the_first(house):
    cameras, versions = add_fleet(house, ALIKE)
    with house.database.reading() as session:
        campaign_id = session.get_one(Calibration, versions["A"][0]).campaign_id
    add_published(house, cameras["A"], 33.1, campaign_id=campaign_id)
    found = judge(house, cameras)
    assert [each["calibration_id"] for each in found["left_out"]] == [versions["A"][0]]
    assert found["cameras"][0]["repeats"] == 3
    assert found["parameters"][0]["repeats"] == 9


def test_lenses_come_from_the_versions_or_are_named(house):
    model = f"model {next(numbers)}"
    cameras = {name: house.camera(model=model, serial=name) for name in "AB"}
    mounted = [("A", "L"), ("A", "M"), ("B", "L"), ("B", "M")] * 2
    values = {"A": 33.0, "B": 36.0, "L": 0.0, "M": 0.1}
    said = []
    for day, (body, lens) in enumerate(mounted):
        value = values[body] + values[lens] + 0.02 * (-1) ** (day // 4)
        add_published(house, cameras[body], value, day=day, lens=lens)
    (k,) = judge(house, cameras)["parameters"]
    recorded = {effect["factor"]: effect for effect in k["effects"]}
    assert recorded["body"]["verdict"] == "per_camera"
    assert recorded["lens"]["verdict"] == "shared"
    others = {name: house.camera(model=f"{model} b", serial=name) for name in "AB"}
    for day, (body, lens) in enumerate(mounted):
        value = values[body] + values[lens] + 0.02 * (-1) ** (day // 4)
        version = add_published(house, others[body], value, day=day)
        said.append({"calibration_id": version, "serial": lens})
    assert [each["factor"] for each in judge(house, others)["parameters"][0]["effects"]] == ["camera"]
    named = judge(house, others, lenses=said)["parameters"][0]
    assert {effect["factor"]: effect for effect in named["effects"]} == recorded


def test_the_lens_in_the_file_stands_before_the_camera_s_own(house):
    cameras, _ = add_fleet(house, {"A": ()})
    version = add_published(house, cameras["A"], 33.0, lens="of the camera")
    sha256 = f"{next(numbers):064x}"
    with house.database.writing("test") as session:
        campaign_id = session.get_one(Calibration, version).campaign_id
        session.add(Blob(sha256=sha256, size_bytes=1))
        session.flush()
        frame = FrameRow(campaign_id=campaign_id, sha256=sha256, filename="a.dng", role="light", state="read")
        frame.header = {"lens_serial": "of the file"}
        session.add(frame)
    with house.database.reading() as session:
        camera = session.get_one(Camera, cameras["A"]["id"])
        (found,) = list_determinations(session, [camera], "luminance", {})
        (said,) = list_determinations(session, [camera], "luminance", {version: "as said"})
    assert (found.source.lens, said.source.lens) == ("of the file", "as said")


def test_what_cannot_be_compared_is_refused(house):
    cameras, versions = add_fleet(house, ALIKE)
    other = house.camera(model=f"model {next(numbers)}", serial="A")
    assert "different models" in detail(house, {**cameras, "D": other})
    assert "names a camera twice" in detail(house, {**cameras, "D": cameras["A"]})
    assert "there is no such parameter; there are luminance_k" in detail(house, cameras, tolerance={"k": 0.1})
    assert "must be a share less than 1" in detail(house, cameras, tolerance=4)
    assert "must be a share less than 1" in detail(house, cameras, tolerance={"luminance_k": 4})
    assert "method" in detail(house, cameras, method="astrology")
    assert "camera_ids" in detail(house, {"A": cameras["A"]})
    named = [{"calibration_id": "cal_none", "serial": "L"}]
    assert "cal_none is not a published version" in detail(house, cameras, lenses=named)
    assert judge(house, cameras, lenses=[{"calibration_id": versions["A"][0], "serial": "L"}])
    # 4 DN is no share
    add_published(house, cameras["A"], 64.0, day=99, name="dark_signal_dn", unit="DN")
    assert judge(house, cameras, tolerance={"dark_signal_dn": 4, "luminance_k": 0.04})


@pytest.mark.parametrize(
    ("tolerance", "field", "said"),
    [
        (0, "body.tolerance", "must be greater than 0"),
        ("4 %", "body.tolerance", "must be a number"),
        ([0.04], "body.tolerance", "must be a number"),
        ({}, "body.tolerance", "at least 1 item"),
        ({"luminance_k": 0}, "body.tolerance.luminance_k", "must be greater than 0"),
        ({"luminance_k": "x"}, "body.tolerance.luminance_k", "must be a number"),
    ],
)
def test_a_wrong_tolerance_is_named_as_it_was_sent(sqlite_house, tolerance, field, said):
    body = {"method": "luminance", "camera_ids": ["cam_a", "cam_b"], "tolerance": tolerance}
    (error,) = sqlite_house.post("/v1/fleet/verdict", body, status=422)["errors"]
    assert error["field"] == field
    assert said in error["message"]


def test_another_s_camera_does_not_exist(house, stranger):
    cameras, _ = add_fleet(house, ALIKE)
    ids = [camera["id"] for camera in cameras.values()]
    body = {"method": "luminance", "camera_ids": ids, "tolerance": 0.04}
    assert stranger.post("/v1/fleet/verdict", json=body).status_code == 404


def drift(house, camera, status=200, **params):
    return house.get(f"/v1/cameras/{camera['id']}/drift", status=status, **{"method": "luminance"} | params)


def test_a_camera_s_drift_has_a_date(house):
    cameras, versions = add_fleet(house, {"A": (33.1, 32.9, 32.9, 33.1, 33.0)})
    found = drift(house, cameras["A"], tolerance=0.04)
    (k,) = found["parameters"]
    assert [each["calibration_id"] for each in k["determinations"]] == versions["A"]
    assert k["determinations"][1]["at"] == "2026-01-31T00:00:00Z"
    low, high = k["slope_interval"]
    assert low < k["slope"]["value"] < high
    assert (k["slope"]["unit"], k["cost_per_year"]["unit"]) == ("DN*m2/(cd*s)/a", "%/a")
    assert k["recalibrate_by"] == found["recalibrate_by"] > (START + timedelta(days=120)).isoformat()
    assert "why" not in k


def test_without_a_date_it_says_why(house):
    cameras, _ = add_fleet(house, {"A": (33.1, 32.9), "B": (33.0, 33.1, 33.0)})
    few, open_end = (drift(house, cameras[name]) for name in "AB")
    assert "recalibrate_by" not in few
    assert "there are 2" in few["parameters"][0]["why"]
    assert "slope" not in few["parameters"][0]
    assert "No tolerance" in open_end["parameters"][0]["why"]
    assert "slope" in open_end["parameters"][0]
    assert "share less than 1" in drift(house, cameras["A"], status=422, tolerance=4)["detail"]


def test_a_version_whose_campaign_has_no_date_is_dated_by_its_publication(house):
    cameras, _ = add_fleet(house, {"A": ()})
    add_published(house, cameras["A"], 33.0, day=10, dated=False)
    (k,) = drift(house, cameras["A"])["parameters"]
    assert k["determinations"][0]["at"] == "2026-01-11T00:00:00Z"
