"""Meter readings, as people write them down."""

import pytest

from service.http.middleware import MAX_BODY_BYTES

pytestmark = pytest.mark.either_database

FIRST = {"scene": "level-1", "quantity": "luminance", "value": 54.4, "unit": "cd/m2"}
SECOND = {"scene": "level-1", "quantity": "illuminance", "value": 120, "unit": "lx"}
CD_M2_PER_FL = 3.4262590996
LX_PER_FC = 10.76391


@pytest.fixture(scope="module")
def house(shared_house):
    return shared_house


def read_csv(house, text, *, status=201, encoding="utf-8", kind="text/csv; charset=utf-8"):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    answer = house.http.post(path, content=text.encode(encoding), headers={"Content-Type": kind})
    assert answer.status_code == status, answer.text
    return answer.json()


def test_one_and_a_list(house):
    campaign = house.campaign()
    path = f"/v1/campaigns/{campaign['id']}/readings"
    one = house.post(path, FIRST)
    assert (one["value"], one["unit"], one["scene"]) == (54.4, "cd/m2", "level-1")
    both = house.post(path, [FIRST, SECOND])["items"]
    assert [r["quantity"] for r in both] == ["luminance", "illuminance"]
    assert [r["id"] for r in house.get(path)["items"]] == [one["id"], *(r["id"] for r in both)]
    assert house.get(f"/v1/campaigns/{campaign['id']}")["readings"] == 3


def test_american_units_are_kept_and_converted(house):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    lambert = house.post(path, FIRST | {"value": 1, "unit": "fL"})
    candle = house.post(path, SECOND | {"value": 1, "unit": "fc"})
    assert lambert["value"] == pytest.approx(CD_M2_PER_FL, rel=1e-10)
    assert candle["value"] == pytest.approx(LX_PER_FC, rel=1e-7)
    assert (lambert["unit"], lambert["entered_unit"], lambert["entered_value"]) == ("cd/m2", "fL", 1)
    assert (candle["unit"], candle["entered_unit"]) == ("lx", "fc")


@pytest.mark.parametrize(
    "text",
    [
        "scene,quantity,value,unit\nlevel-1,luminance,54.4,cd/m²\nlevel-1,illuminance,120,lx\n",
        "scene;quantity;value;unit\nlevel-1;luminance;54,4;cd/m2\nlevel-1;illuminance;120;lx\n",
        "scene;quantity;value;unit\nlevel-1;luminance;54.4;cd/m2\nlevel-1;illuminance;120,0;lx\n",
        "scene\tquantity\tvalue\tunit\nlevel-1\tluminance\t54,4\tcd/m2\nlevel-1\tilluminance\t120\tlx\n",
        "\ufeffscene,quantity,value,unit\r\nlevel-1,luminance,54.4,cd/m2\r\nlevel-1,illuminance,120,lx\r\n",
        "scene,quantity,value,unit\rlevel-1,luminance,54.4,cd/m2\rlevel-1,illuminance,120,lx\r",
        "Value, Unit ,quantity,scene\n54.4, cd/m2 ,luminance,level-1\n\n120,lx,illuminance,level-1",
        'scene,quantity,value,unit\n"level-1",luminance,"54.4",cd/m2\nlevel-1,illuminance,120,lx\n',
        "scene,quantity,value,unit,meter_id,taken_at\nlevel-1,luminance,54.4,cd/m2,,\nlevel-1,illuminance,120,lx,,\n",
    ],
    ids=["comma", "semicolon", "mixed", "tab", "bom crlf", "cr", "order", "quoted", "empty cells"],
)
def test_every_spreadsheet_is_read(house, text):
    rows = read_csv(house, text)["items"]
    assert [(r["scene"], r["quantity"], r["value"], r["unit"]) for r in rows] == [
        ("level-1", "luminance", 54.4, "cd/m2"),
        ("level-1", "illuminance", 120.0, "lx"),
    ]


def test_a_table_is_known_by_its_type(house):
    text = "scene,quantity,value,unit\nlevel-1,luminance,54.4,cd/m2\n"
    assert len(read_csv(house, text, kind="application/csv")["items"]) == 1
    detail = read_csv(house, text, kind="application/x-www-form-urlencoded", status=400)["detail"]
    assert detail.endswith("A table is sent with Content-Type: text/csv.")


def test_a_reading_is_kept_with_a_reason_in_words(house):
    text = "scene,quantity,value,unit,reason\nlevel-1,luminance,12.8,cd/m2,a filter was on the lens\n"
    assert read_csv(house, text)["items"][0]["reason"] == "a filter was on the lens"


def test_each_bad_row_is_named_by_its_line_and_none_is_kept(house):
    text = (
        "scene;quantity;value;unit\nlevel-1;luminance;54,4;cd/m2\nlevel-2;luminance;n/a;cd/m2\n"
        "level-3;luminance;NaN;cd/m2\n;luminance;1;cd/m2\nlevel-5;luminance;1;lx\nlevel-6;light;-1;cd/m2\n"
    )
    problem = read_csv(house, text, status=422)
    assert [(e["field"], e["message"]) for e in problem["errors"]] == [
        ("line 3.value", "must be a number"),
        ("line 4.value", "must be a number"),
        ("line 5.scene", "is missing"),
        ("line 6", "lx is no unit of luminance: use cd/m2 or fL"),
        ("line 7.quantity", "must be 'luminance' or 'illuminance'"),
        ("line 7.value", "must be greater than 0"),
    ]
    assert problem["detail"].endswith("; and 1 more")
    campaign = house.get("/v1/campaigns", limit=1000)["items"][-1]
    assert house.get(f"/v1/campaigns/{campaign['id']}/readings")["items"] == []


@pytest.mark.parametrize(
    ("text", "detail"),
    [
        ("", "line 1: must name each of the columns scene, quantity, value, unit"),
        ("scene,value\na,1\n", "it names 'scene', 'value'"),
        ("scene,scene,quantity,value,unit\na,b,luminance,1,cd/m2\n", "once"),
        ("scene,quantity,value,unit,colour\na,luminance,1,cd/m2,red\n", "'colour'"),
        ("scene,quantity,value,unit\n", "must hold 1 to 10000 readings"),
        ("scene,quantity,unit,value\na,luminance,cd/m2,54,4\n", "line 2: has more cells than line 1 names"),
        ("scene\tquantity\tvalue\tunit\na\tluminance\t1,234\tcd/m2\n", "line 2.value: must be a number"),
        ("scene,quantity,value,unit\na,luminance,1,cd/m2\n" * 11_000, "must hold 1 to 10000 readings"),
    ],
)
def test_a_table_that_cannot_be_meant_is_refused(house, text, detail):
    problem = read_csv(house, text, status=422)
    assert problem["code"] == "validation_failed"
    assert detail in problem["detail"]


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_another_encoding_is_named(house, encoding):
    text = "scene,quantity,value,unit\nTürme,luminance,1,cd/m2\n"
    problem = read_csv(house, text, status=400, encoding=encoding)
    assert problem["detail"] == "The CSV is not UTF-8. Save it as CSV UTF-8."


def test_a_cell_without_end(house):
    problem = read_csv(house, "scene,quantity,value,unit\n" + "x" * 200_000, status=400)
    assert problem["detail"].startswith("The CSV cannot be read")
    assert read_csv(house, " " * (MAX_BODY_BYTES + 1), status=413)["code"] == "upload_too_large"


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ([FIRST, FIRST | {"value": -1}], "body.1.value"),
        (FIRST | {"value": "54,4"}, "body.value"),
        (FIRST | {"meter": "x"}, "body.meter"),
        (FIRST | {"unit": "lx"}, "body"),
        ([], "body"),
        ([[]], "body.0"),
        (7, "body"),
    ],
)
def test_a_bad_reading_is_named(house, body, field):
    problem = house.post(f"/v1/campaigns/{house.campaign()['id']}/readings", body, status=422)
    assert problem["errors"][0]["field"] == field


def test_a_reading_names_its_meter(house):
    meter = house.post(
        "/v1/meters", {"kind": "luminance", "make": "G", "model": "S", "serial": "1"}, status=201
    )
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    assert house.post(path, FIRST | {"meter_id": meter["id"]})["meter_id"] == meter["id"]
    assert house.post(path, FIRST | {"meter_id": "met_no"}, status=404)["code"] == "not_found"
    problem = house.post(path, [FIRST, SECOND | {"meter_id": meter["id"]}], status=422)
    assert problem["detail"] == "meter_id: is that of a meter of luminance; the reading is of illuminance"


def test_a_withdrawn_reading_counts_no_more_and_stays_in_the_record(house):
    campaign = house.campaign()
    path = f"/v1/campaigns/{campaign['id']}/readings"
    reading = house.post(path, FIRST)
    withdrawn = house.http.delete(f"/v1/readings/{reading['id']}").json()
    assert withdrawn["withdrawn_at"]
    assert house.http.delete(f"/v1/readings/{reading['id']}").json() == withdrawn
    assert house.get(path)["items"] == [withdrawn]
    assert house.get(f"/v1/campaigns/{campaign['id']}")["readings"] == 0


def values(house, path):
    return [each["value"] for each in house.get(path)["items"] if "withdrawn_at" not in each]


def test_a_reading_is_replaced_once_and_stays_in_the_record(house):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    mistyped = house.post(path, FIRST | {"value": 12.8, "replaces": ""})
    right = house.post(path, FIRST | {"value": 1.28, "replaces": mistyped["id"]})
    repeat = house.post(path, FIRST | {"value": 1.3})
    assert values(house, path) == [1.28, 1.3]
    (old,) = [each for each in house.get(path)["items"] if each["id"] == mistyped["id"]]
    assert old["withdrawn_at"] == right["created_at"]
    late = house.post(path, [FIRST | {"value": 1.2, "replaces": mistyped["id"]}, SECOND], status=409)
    assert late["code"] == "changed_meanwhile"
    assert "The reading of level-1 was changed by" in late["detail"]
    assert "it is now 1.28 cd/m2" in late["detail"]
    both = [FIRST | {"value": value, "replaces": each["id"]} for value, each in ((2.0, right), (2.1, repeat))]
    assert [each["value"] for each in house.post(path, both)["items"]] == values(house, path) == [2.0, 2.1]


def test_two_first_readings_of_a_scene_are_not_averaged(house):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    house.post(path, FIRST | {"value": 3.3, "replaces": ""})
    house.post(path, SECOND | {"replaces": ""})
    late = house.post(path, FIRST | {"value": 3.5, "replaces": ""}, status=409)
    assert "it is now 3.3 cd/m2" in late["detail"]
    assert values(house, path) == [3.3, 120.0]
    gone = house.http.delete(f"/v1/readings/{house.get(path)['items'][0]['id']}").json()
    late = house.post(path, FIRST | {"value": 3.5, "replaces": gone["id"]}, status=409)
    assert "it is withdrawn" in late["detail"]


def test_only_a_reading_of_the_campaign_is_replaced(house, stranger):
    """Not even who changed another one is told, whoever's it is."""
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    own = house.post(path, FIRST)
    other = f"/v1/campaigns/{house.campaign(place='elsewhere')['id']}/readings"
    foreign = f"/v1/campaigns/{stranger_campaign(stranger)}/readings"
    for asked, place, replaced in (
        (house.http, path, "rdg_nothing"),
        (house.http, path, "rdg_\0"),
        (house.http, other, own["id"]),
        (stranger, foreign, own["id"]),
    ):
        answer = asked.post(place, json=SECOND | {"replaces": replaced})
        assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), replaced
        assert "changed" not in answer.text
    twice = [FIRST | {"value": value, "replaces": own["id"]} for value in (1.0, 2.0)]
    house.post(path, twice, status=409)
    assert values(house, path) == [FIRST["value"]]


def stranger_campaign(stranger):
    camera = stranger.post("/v1/cameras", json={"make": "DJI", "model": "X", "serial": "1"}).json()["id"]
    campaign = {"camera_id": camera, "method": "luminance"}
    return stranger.post("/v1/campaigns", json=campaign).json()["id"]


def meter(house, kind, serial="1"):
    body = {"kind": kind, "make": "Gossen", "model": "M", "serial": serial + kind}
    return house.http.post("/v1/meters", json=body).json()["id"]


def send_csv(house, text, *meters):
    path = f"/v1/campaigns/{house.campaign()['id']}/readings"
    return house.http.post(
        path, content=text, params={"meter_id": meters}, headers={"Content-Type": "text/csv"}
    )


def test_readings_that_name_no_meter_take_the_one_of_their_quantity(house):
    luminance, illuminance, own = (
        meter(house, "luminance"),
        meter(house, "illuminance"),
        meter(house, "luminance", "2"),
    )
    rows = ("a,luminance,1,cd/m2,", "a,illuminance,2,lx,", f"a,luminance,3,fL,{own}")
    text = "\n".join(["scene,quantity,value,unit,meter_id", *rows])
    answer = send_csv(house, text, luminance, illuminance)
    assert [row["meter_id"] for row in answer.json()["items"]] == [luminance, illuminance, own]
    answer = send_csv(house, text, illuminance)
    assert [row.get("meter_id") for row in answer.json()["items"]] == [None, illuminance, own]


def test_two_meters_of_a_kind_or_an_unknown_one_are_refused(house):
    text = "scene,quantity,value,unit\na,luminance,1,cd/m2\n"
    twice = send_csv(house, text, meter(house, "luminance"), meter(house, "luminance", "2"))
    assert (twice.status_code, twice.json()["errors"][0]["field"]) == (422, "query.meter_id")
    assert send_csv(house, text, "met_of_another").json()["code"] == "not_found"
