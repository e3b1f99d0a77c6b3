"""A frame of the field, measured with a version that the test names, and its map."""

import io
import json

import tifffile


def field_frame(house, campaign_id, *, iso=3200, seed=9):
    content = house.frame_bytes(signal_dn=300.0, exposure_time_s=0.01, f_number=4.0, iso=iso, seed=seed)
    frame = house.upload({"id": campaign_id}, content, role="field", filename=f"field-{iso}-{seed}.DNG")
    house.work()
    return frame


def measure(house, frame, version, **more):
    return house.measure(frame_id=frame["id"], calibration_id=version["id"], **more)


def read_map(house, measurement):
    """The planes of its map, what the map tells of itself, and the tags by name."""
    content = house.http.get(measurement["links"]["map_tif"]).content
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        page = file.pages.first
        tags = {tag.name: tag.value for tag in page.tags.values()}
        return file.asarray(), json.loads(page.description), tags
