"""Uploads in pieces, as a client of tus 1.0.0 sends them."""

import base64
import hashlib

TUS = {"Tus-Resumable": "1.0.0"}
PIECE = TUS | {"Content-Type": "application/offset+octet-stream"}


def metadata(**said):
    """What is said of a file, in the header's form; None is not said."""
    return ",".join(
        f"{name} {base64.b64encode(str(value).encode()).decode()}"
        for name, value in said.items()
        if value is not None
    )


def describe(campaign_id, content, **said):
    """The headers that begin an upload."""
    sha256 = hashlib.sha256(content).hexdigest()
    named = {"campaign_id": campaign_id, "sha256": sha256, "role": "light", "filename": "a.DNG"} | said
    return TUS | {"Upload-Length": str(len(content)), "Upload-Metadata": metadata(**named)}


def begin_upload(house, campaign_id, content, **said) -> str:
    """The address of an upload of which nothing has arrived."""
    answer = house.http.post("/v1/uploads", headers=describe(campaign_id, content, **said))
    assert answer.status_code == 201, answer.text
    return answer.headers["Location"]
