"""A list leaves only what was asked for, page after page."""

from types import SimpleNamespace

import pytest
from sqlalchemy import select

from service.http.paging import Paging
from store.tables import Camera


@pytest.fixture(scope="module")
def lists(sqlite_house):
    http = sqlite_house.http
    cameras = [
        http.post("/v1/cameras", json={"make": "DJI", "model": model, "serial": serial}).json()["id"]
        for model, serial in [("L1D", "1"), ("L1D", "2"), ("L2D", "1")]
    ]
    for number in ("N-1", "N-2", "N-1"):
        body = {"camera_id": cameras[0], "method": "luminance", "project_number": number}
        assert http.post("/v1/campaigns", json=body).status_code == 201
    return http


@pytest.mark.parametrize(
    ("path", "count"),
    [
        ("/v1/cameras?serial=1", 2),
        ("/v1/cameras?model=L1D&serial=1", 1),
        ("/v1/cameras?serial=3", 0),
        ("/v1/campaigns?project_number=N-1", 2),
        ("/v1/campaigns?project_number=N-1&method=noise", 0),
        ("/v1/campaigns?camera_id=cam_none", 0),
        ("/v1/meters?serial=none", 0),
        ("/v1/panels?serial=none", 0),
        ("/v1/rigs?name=none", 0),
    ],
)
def test_a_list_has_only_what_was_asked_for(lists, path, count):
    assert len(lists.get(path).json()["items"]) == count


def test_a_field_that_the_rows_do_not_have_is_not_passed_over():
    class Misnamed(Paging):
        colour: str | None = None

    with pytest.raises(AttributeError, match="colour"):
        Misnamed(request=None).send_own(None, SimpleNamespace(organisation_id="org_1"), select(Camera), str)


def test_the_next_page_is_asked_for_in_the_same_way(lists):
    first = lists.get("/v1/campaigns?project_number=N-1&limit=1").json()
    second = lists.get(first["next"]).json()
    assert [item["project_number"] for page in (first, second) for item in page["items"]] == ["N-1", "N-1"]
    assert second["next"] is None


@pytest.fixture(scope="module")
def cursors(sqlite_house):
    """Every address that takes a cursor, and a cursor of another list."""
    ids = {"campaign_id": sqlite_house.campaign()["id"], "camera_id": sqlite_house.camera()["id"]}
    sqlite_house.post("/v1/meters", {"kind": "luminance", "make": "a", "model": "b", "serial": "1"})
    sqlite_house.post("/v1/meters", {"kind": "luminance", "make": "a", "model": "b", "serial": "2"})
    other = sqlite_house.get("/v1/meters", limit=1)["next"].rpartition("cursor=")[2]
    paths = sqlite_house.get("/openapi.json")["paths"]
    taking = [
        path.format(**ids)
        for path, methods in paths.items()
        if any(each["name"] == "cursor" for each in methods.get("get", {}).get("parameters", ()))
    ]
    return taking, other


def test_a_cursor_that_the_list_did_not_give_is_refused(sqlite_house, cursors):
    paths, other = cursors
    assert len(paths) > 15
    for path in paths:
        for cursor in ("abc", "7", "W10", "%00", other):
            if cursor == other and path == "/v1/meters":
                continue
            answer = sqlite_house.http.get(f"{path}?cursor={cursor}")
            assert answer.status_code == 422, (path, cursor, answer.text)
            assert answer.json()["errors"][0]["field"] == "query.cursor", path
