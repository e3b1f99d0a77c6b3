"""Files of real cameras through upload and worker, with the outcomes that their README states."""

import pytest

from tests.support.data import data_file

pytestmark = pytest.mark.either_database

# exposures as a field team would have noted them
TYPED = {"exposure_time_s": 0.01, "f_number": 4, "iso": 400}


def upload(house, name, *, camera, roi=None, **query):
    made = house.post("/v1/cameras", camera)
    campaign = house.campaign(camera_id=made["id"])
    if roi:
        house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=roi)
    content = data_file(f"dng/{name}").read_bytes()
    frame = house.upload(campaign, content, role="light", filename=name, **query)
    house.work()
    assert house.http.get(f"/v1/frames/{frame['id']}/content").content == content
    return house.get(f"/v1/frames/{frame['id']}")


def camera_in(house, name):
    """What the file says of its camera, as somebody who registers it would copy it."""
    header = house.worker.decoders.read_header(data_file(f"dng/{name}"))
    return {
        "make": header.make or "unknown",
        "model": header.model or "unknown",
        "serial": header.serial or "1",
    }


@pytest.mark.parametrize(
    "name", ["blackmagic_bigendian_ljpeg_tiled.dng", "canon_14bit_packed_activearea_zero_exif.dng"]
)
def test_a_frame_that_does_not_say_its_exposure_is_refused(house, name):
    refusal = upload(house, name, camera=camera_in(house, name))["refusal"]
    assert refusal["code"] == "exposure_missing"
    assert "typed in" in refusal["detail"]


def measure(house, name):
    header = house.worker.decoders.read_header(data_file(f"dng/{name}"))
    roi = {"imagej": f"makeRectangle(0,0,{header.width_px},{header.height_px})"}
    frame = upload(house, name, camera=camera_in(house, name), roi=roi, **TYPED)
    assert frame["state"] == "extracted", frame.get("refusal")
    return frame, {row["channel"]: row for row in frame["statistics"]}


def test_a_whole_frame_measures_as_it_was_measured_elsewhere(house):
    frame, rows = measure(house, "blackmagic_bigendian_ljpeg_tiled.dng")
    assert (frame["cfa"], frame["black_level_dn"], frame["white_level_dn"]) == ("GBRG", 256.0, 51080.0)
    assert (rows["grey"]["min_dn"], rows["grey"]["max_dn"]) == (241, 22473)
    assert rows["grey"]["mean_dn"] == pytest.approx(731.32, abs=0.005)
    means = sorted(rows[channel]["mean_dn"] for channel in ("R", "G1", "G2", "B"))
    assert means == pytest.approx([517.5818, 778.6991, 790.2963, 838.7027], abs=5e-5)


def test_a_frame_is_measured_within_its_active_area(house):
    frame, rows = measure(house, "canon_14bit_packed_activearea_zero_exif.dng")
    assert (frame["height_px"], frame["width_px"]) == (1182 - 26, 1886 - 152)
    assert (frame["black_level_dn"], frame["white_level_dn"]) == (2056.0, 15000.0)
    # the darkest sites of the file, 1702, lie outside
    assert (rows["grey"]["min_dn"], rows["grey"]["max_dn"]) == (1958, 12128)


def test_image_data_that_is_cut_away_is_refused_as_truncated(house):
    camera = {"make": "Canon", "model": "Canon EOS 350D DIGITAL", "serial": "012345678"}
    refusal = upload(house, "truncated_libraw_reads_zeros.dng", camera=camera)["refusal"]
    assert refusal["code"] == "truncated"
    assert refusal["detail"].endswith("Copy it from the camera's card again and compare the file sizes.")


def test_a_single_pixel_is_refused(house):
    camera = {"make": "a", "model": "b", "serial": "c"}
    refusal = upload(house, "one_pixel.dng", camera=camera)["refusal"]
    assert refusal["code"] == "frame_too_small"
    assert "1 x 1 pixels" in refusal["detail"]
