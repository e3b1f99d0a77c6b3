"""A card's manifest, and the receipt for which the card may be formatted."""

import base64
import hashlib
import json
import stat

import pytest
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.serialization import load_pem_public_key

from service.campaigns.manifests import MOST_FILES
from service.http.middleware import MAX_BODY_BYTES
from service.http.signatures import Signer

pytestmark = pytest.mark.either_database


@pytest.fixture(scope="module")
def house(shared_house):
    return shared_house


def entry(name, content):
    return {"name": name, "size_bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def send(house, campaign, files, **more):
    return house.post(f"/v1/campaigns/{campaign['id']}/manifest", {"files": files, **more}, status=200)


def verify(signed, pem):
    text = json.dumps(signed["receipt"], sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    load_pem_public_key(pem.encode()).verify(base64.b64decode(signed["signature"]["value"]), text.encode())


def test_a_receipt_attests_what_is_stored_and_says_what_else_is_known(house):
    campaign = house.campaign(project_number="Ü-1")
    place = f"/v1/campaigns/{campaign['id']}/receipt"
    assert house.get(place, status=409)["code"] == "manifest_incomplete"
    raw, broken = house.frame_bytes(seed=71), b"no raw file, but every byte of it"
    files = [entry("a/1.DNG", raw), entry("b/copy.DNG", raw), entry("ü/2.DNG", broken)]
    others = [{"name": "MISC/log.txt", "size_bytes": 5}]
    largest = {"name": "DCIM/100MEDIA/DJI_0001.DNG", "size_bytes": 1 << 30, "sha256": 64 * "a"}
    assert MOST_FILES * len(json.dumps(largest)) < MAX_BODY_BYTES
    house.upload(campaign, raw, role="light", scene="level-1")
    first = send(house, campaign, files, others=others)
    assert (first["stored"], first["complete"], "receipt" in first) == (2, False, False)
    assert [(each["name"], each["reason"]) for each in first["missing"]] == [("ü/2.DNG", "not_received")]
    refused = house.get(place, status=409)
    assert refused["missing"] == first["missing"]

    house.upload(campaign, broken, role="dark")
    house.work()
    frame = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"][0]
    house.http.patch(f"/v1/frames/{frame['id']}", json={"withdrawn": True}).raise_for_status()
    again = send(house, campaign, files, others=others)
    assert (again["id"], again["complete"], again["missing"]) == (first["id"], True, [])
    signed = house.get(again["receipt"])
    receipt = signed["receipt"]
    counts = [receipt[f"{name}_count"] for name in ("files", "distinct_files", "refused", "withdrawn")]
    assert counts == [3, 2, 1, 1]
    assert (receipt["size_bytes"], receipt["distinct_size_bytes"]) == (
        2 * len(raw) + len(broken),
        len(raw) + len(broken),
    )
    said = [{**file} for file in receipt["files"]]
    assert [file["name"] for file in said] == [file["name"] for file in files]
    assert ["withdrawn_at" in file for file in said] == [True, True, False]
    assert [file.get("same_as") for file in said] == [None, "a/1.DNG", None]
    assert [file["state"] == "refused" for file in said] == ["refusal_code" in file for file in said]
    assert said[2]["state"] == "refused"
    assert receipt["not_covered"] == others

    (key,) = house.http.get("/v1/signing-keys", headers={"Authorization": ""}).json()["items"]
    assert key["id"] == receipt["key_id"] == signed["signature"]["key_id"]
    verify(signed, key["public_key"])
    receipt["files_count"] = 4
    with pytest.raises(InvalidSignature):
        verify(signed, key["public_key"])


def test_a_lost_file_and_a_wrong_size_are_not_attested(house):
    campaign = house.campaign()
    content, other = house.frame_bytes(seed=72), house.frame_bytes(seed=73)
    for each in (content, other):
        house.upload(campaign, each, role="dark")
    files = [entry("a", content), entry("b", other) | {"size_bytes": 1}]
    sha256 = files[0]["sha256"]
    (house.folder / "blobs" / sha256[:2] / sha256[2:4] / sha256).unlink()
    answer = send(house, campaign, files)
    assert [each["reason"] for each in answer["missing"]] == ["damaged", "size_differs"]
    house.upload(campaign, content, status=200, role="dark")
    assert [each["name"] for each in send(house, campaign, files)["missing"]] == ["b"]


def test_others_cannot_ask_and_an_uploader_can(house, stranger):
    campaign = house.campaign()
    content = house.frame_bytes(seed=74)
    house.upload(campaign, content, role="dark")
    manifest = send(house, campaign, [entry("a", content)])
    assert stranger.get(manifest["receipt"]).status_code == 404
    place = f"/v1/campaigns/{campaign['id']}"
    assert stranger.post(f"{place}/manifest", json={"files": [entry("a", content)]}).status_code == 404
    elsewhere = house.campaign(project_number="other")
    assert house.get(f"/v1/campaigns/{elsewhere['id']}/receipt", status=404, manifest_id=manifest["id"])
    for scope, status in (("upload", 200), ("read", 200), ("publish", 403)):
        with house.with_scopes(scope) as client:
            assert client.get(manifest["receipt"]).status_code == status


def test_a_rotated_key_leaves_the_old_public_key(house):
    house.get("/v1/signing-keys")
    kept = house.folder / "signing-key"
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    before = house.get("/v1/signing-keys")["items"]
    Signer(bytes(32), house.database).enrol()
    Signer(bytes(32), house.database).enrol()
    after = house.get("/v1/signing-keys")["items"]
    assert after[1:] == before
