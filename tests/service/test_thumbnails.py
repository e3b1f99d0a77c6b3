"""A frame in a list: small whatever the frame, with its region, and sent again only if changed."""

import base64
import io

import numpy as np
import pytest
from PIL import Image
from sqlalchemy import delete

from service.frames.pictures import draw_light_thumbnail, draw_thumbnail
from store.files import reduce_preview
from store.tables import FrameRow, Roi, SmallPreview

pytestmark = pytest.mark.either_database

REGION = {"polygon": [[8, 8], [60, 8], [60, 50], [8, 50]]}
SQUARE = Roi(points=[[400, 400], [1200, 400], [1200, 1200], [400, 1200]], parts=None)


FORMATS = {"png": draw_thumbnail, "webp": lambda png, *at: draw_light_thumbnail(reduce_preview(png), *at)}
SIDES_PX = {"png": 320, "webp": 160}


def preview_of(rows, cols, noise=0):
    grey = np.linspace(0, 255, cols)[None, :] + np.random.default_rng(1).normal(0, noise + 1e-9, (rows, cols))
    out = io.BytesIO()
    Image.fromarray(np.clip(grey, 0, 255).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize(
    ("shape", "noise"), [((1200, 1600), 80), ((1600, 900), 0), ((320, 320), 80), ((40, 60), 0)]
)
def test_a_thumbnail_is_small_and_looks_like_its_frame(shape, noise, encoding):
    picture = FORMATS[encoding](preview_of(*shape, noise=noise), shape[1], None)
    with Image.open(io.BytesIO(picture)) as found:
        assert found.format.lower() == encoding
        assert max(found.size) == min(SIDES_PX[encoding], max(shape))
        assert abs(found.width / found.height - shape[1] / shape[0]) < 0.01
        grey = np.asarray(found.convert("L"), float)
    assert len(picture) <= 40_000
    columns = grey.mean(axis=0)
    assert np.corrcoef(columns, np.arange(len(columns)))[0, 1] > 0.97


@pytest.mark.parametrize(("encoding", "off"), [("png", 0), ("webp", 2)])
def test_the_region_is_drawn_where_it_is(encoding, off):
    drawn = FORMATS[encoding](preview_of(800, 800), 1600, SQUARE)
    with Image.open(io.BytesIO(drawn)) as found:
        red, _, blue = np.moveaxis(np.asarray(found.convert("RGB"), int), 2, 0)
    rows, cols = np.nonzero(red - blue > 60)
    shown = np.array([rows.min(), rows.max(), cols.min(), cols.max()]) / SIDES_PX[encoding]
    assert np.allclose(shown, [0.25, 0.75, 0.25, 0.75], atol=off / 160)


@pytest.mark.parametrize("pattern", ["white noise", "dots", "lines"])
def test_a_thumbnail_of_what_compresses_badly_is_small(pattern):
    grey = np.random.default_rng(2).integers(0, 256, (320, 320))
    grey = {"white noise": grey, "dots": 255 * (grey > 127), "lines": 255 * (grey[:1] > 127) + 0 * grey}[
        pattern
    ]
    preview = io.BytesIO()
    Image.fromarray(grey.astype(np.uint8)).save(preview, "PNG")
    assert max(len(draw(preview.getvalue(), 320, None)) for draw in FORMATS.values()) <= 40_000


def test_a_thumbnail_changes_with_the_region_only(house):
    campaign = house.campaign()
    frame = house.upload(campaign, house.frame_bytes(), role="light", scene="level-1")
    path = f"/v1/frames/{frame['id']}/thumbnail.png"
    assert house.get(path, status=404)["code"] == "preview_not_ready"
    house.work()
    first = house.http.get(path)
    assert (first.status_code, first.headers["content-type"]) == (200, "image/png")
    tag = {"If-None-Match": first.headers["etag"]}
    assert house.http.get(path, headers=tag).status_code == 304
    house.put(f"/v1/frames/{frame['id']}/roi", REGION)
    house.work()
    changed = house.http.get(path, headers=tag)
    assert changed.status_code == 200
    assert changed.content != first.content


def test_thumbnails_of_many_frames_come_together_and_stay_while_they_are_right(house, stranger):
    campaign = house.campaign()
    sent = [house.upload(campaign, house.frame_bytes(seed=seed), role="light") for seed in range(3)]
    path = f"/v1/campaigns/{campaign['id']}"

    def read_tags():
        columns = house.get(f"{path}/grid")["frames"]
        return dict(zip(columns["id"], columns["thumbnail"], strict=True))

    assert set(read_tags().values()) == {None}
    ids = [frame["id"] for frame in sent]
    assert house.get(f"{path}/thumbnails", of=ids)["items"] == []
    house.work()
    tags = read_tags()
    named = [f"{each}.{tags[each]}" for each in ids]
    answer = house.http.get(f"{path}/thumbnails", params={"of": named})
    assert "immutable" in answer.headers["cache-control"]
    items = answer.json()["items"]
    assert [(each["frame_id"], each["tag"]) for each in items] == [(each, tags[each]) for each in ids]
    for each in items:
        with Image.open(io.BytesIO(base64.b64decode(each["picture"], validate=True))) as found:
            assert (found.format, max(found.size) <= 160) == ("WEBP", True)
    # without a tag, or with one that is not right any more, it is asked for again each time
    asked = house.http.get(f"{path}/thumbnails", params={"of": ids})
    assert (asked.headers["cache-control"], asked.json()) == ("private, no-cache", answer.json())
    again = {"If-None-Match": asked.headers["etag"]}
    assert house.http.get(f"{path}/thumbnails", params={"of": ids}, headers=again).status_code == 304
    house.put(f"/v1/frames/{ids[0]}/roi", REGION)
    changed = house.http.get(f"{path}/thumbnails", params={"of": named})
    assert "immutable" not in changed.headers["cache-control"]
    before, now = ([each["picture"] for each in found.json()["items"]] for found in (answer, changed))
    assert [one == other for one, other in zip(before, now, strict=True)] == [False, True, True]
    assert [each for each in ids if read_tags()[each] != tags[each]] == ids[:1]
    # of a frame that an older stilb has read it is made
    kept = [answer.json()["items"]]
    for _ in range(2):
        with house.database.writing("test") as session:
            session.execute(delete(SmallPreview))
        kept.append(house.get(f"{path}/thumbnails", of=[*reversed(ids)])["items"][::-1])
    assert kept[1][1:] == kept[2][1:] == kept[0][1:]
    with house.database.writing("test") as session:
        assert session.query(SmallPreview).delete() == 3
    # a preview that the disk has lost is left out, and such an answer is not kept
    lost = house.get(f"/v1/frames/{ids[1]}")
    with house.database.reading() as session:
        sha256 = session.get_one(FrameRow, lost["id"]).preview_sha256
    (house.folder / "blobs" / sha256[:2] / sha256[2:4] / sha256).unlink()
    some = house.http.get(f"{path}/thumbnails", params={"of": ids})
    assert [each["frame_id"] for each in some.json()["items"]] == [ids[0], ids[2]]
    assert some.headers["cache-control"] == "no-store"
    assert stranger.get(f"/v1/frames/{ids[0]}/thumbnail.png").status_code == 404
    assert stranger.get(f"{path}/thumbnails?of={ids[0]}").status_code == 404
