"""A frame of the field, measured with a version that the test names."""


def field_frame(house, campaign_id, *, iso=3200, seed=9):
    content = house.frame_bytes(signal_dn=300.0, exposure_time_s=0.01, f_number=4.0, iso=iso, seed=seed)
    frame = house.upload({"id": campaign_id}, content, role="field", filename=f"field-{iso}-{seed}.DNG")
    house.work()
    return frame


def measure(house, frame, version):
    body = {"frame_id": frame["id"], "calibration_id": version["id"]}
    return house.measure(**body)
