"""A frame in a list: small whatever the frame, with its region, and sent again only if changed."""

import io

import numpy as np
import pytest
from PIL import Image

from service.thumbnails import draw_thumbnail
from store.tables import Roi

REGION = (255, 120, 0)
SQUARE = Roi(points=[[400, 400], [1200, 400], [1200, 1200], [400, 1200]], parts=None)


def preview_of(rows, cols, noise=0):
    grey = np.linspace(0, 255, cols)[None, :] + np.random.default_rng(1).normal(0, noise + 1e-9, (rows, cols))
    out = io.BytesIO()
    Image.fromarray(np.clip(grey, 0, 255).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


@pytest.mark.parametrize("noise", [0, 5, 80])
@pytest.mark.parametrize("shape", [(1600, 1600), (1200, 1600), (1600, 900), (40, 60)])
def test_a_thumbnail_is_small_and_looks_like_its_frame(shape, noise):
    png = draw_thumbnail(preview_of(*shape, noise=noise), shape[1], None)
    with Image.open(io.BytesIO(png)) as found:
        assert max(found.size) == min(320, max(shape))
        assert abs(found.width / found.height - shape[1] / shape[0]) < 0.01
        grey = np.asarray(found.convert("L"), float)
    assert len(png) <= 40_000
    columns = grey.mean(axis=0)
    assert np.corrcoef(columns, np.arange(len(columns)))[0, 1] > 0.97


def test_the_region_is_drawn_where_it_is():
    with Image.open(io.BytesIO(draw_thumbnail(preview_of(800, 800), 1600, SQUARE))) as found:
        picture = np.asarray(found.convert("RGB"))
    rows, cols = np.nonzero((picture == REGION).all(axis=2))
    assert (rows.min(), rows.max(), cols.min(), cols.max()) == (80, 240, 80, 240)


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
    house.http.put(f"/v1/frames/{frame['id']}/roi", json={"polygon": [[8, 8], [60, 8], [60, 50], [8, 50]]})
    house.work()
    changed = house.http.get(path, headers=tag)
    assert changed.status_code == 200
    assert changed.content != first.content


def test_a_stranger_sees_no_thumbnail(house, stranger):
    frame = house.upload(house.campaign(), house.frame_bytes(), role="light")
    house.work()
    assert stranger.get(f"/v1/frames/{frame['id']}/thumbnail.png").status_code == 404
