"""A whole small campaign, uploaded: what a fit needs and no more."""

from tests.support.house import House

K_TRUE = 2.0
LEVELS = {"level-1": 40.0, "level-2": 20.0, "level-3": 8.0, "level-4": 3.0}
SETTINGS = ((0.01, 4.0), (0.02, 5.6), (0.02, 4.0))
ISOS = (3200, 6400)
ROI = {"polygon": [[8, 8], [88, 8], [88, 56], [8, 56]]}


def upload_campaign(house: House, *, isos=ISOS, roi=ROI, readings=True, seed=1) -> dict:
    """Light frames of a proportional sensor at several levels and settings, dark frames, readings."""
    campaign = house.campaign()
    if roi:
        answer = house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=roi)
        assert answer.status_code == 200, answer.text
    for iso in isos:
        for index, (exposure_time_s, f_number) in enumerate(SETTINGS):
            dark = house.frame_bytes(
                signal_dn=0.0,
                iso=iso,
                exposure_time_s=exposure_time_s,
                f_number=f_number,
                seed=seed + 7 * index + iso,
            )
            house.upload(campaign, dark, role="dark", filename=f"dark-{iso}-{index}.DNG")
            for number, (scene, luminance) in enumerate(LEVELS.items()):
                signal = K_TRUE * exposure_time_s * iso * luminance / f_number**2
                light = house.frame_bytes(
                    signal_dn=signal,
                    iso=iso,
                    exposure_time_s=exposure_time_s,
                    f_number=f_number,
                    seed=seed + 100 * number + index + iso,
                )
                name = f"{scene}-{iso}-{index}.DNG"
                house.upload(campaign, light, role="light", scene=scene, filename=name)
    if readings:
        rows = [
            {"scene": scene, "quantity": "luminance", "value": value * factor, "unit": "cd/m2"}
            for scene, value in LEVELS.items()
            for factor in (0.998, 1.002)
        ]
        house.post(f"/v1/campaigns/{campaign['id']}/readings", rows)
    return campaign


def calibrate(house: House, campaign: dict, **params) -> dict:
    """Extract what waits, fit, and give the version."""
    house.work()
    return house.fit(campaign, **params)


def calibrated_campaign(house: House, *, isos=ISOS, **params) -> dict:
    """The version that the campaign gives."""
    return calibrate(house, upload_campaign(house, isos=isos), **params)


def published_campaign(house: House, *, isos=ISOS, valid_from="2026-05-01T00:00:00Z", reason="first") -> dict:
    """The version that the campaign gives, from then on in force; as it was before it was published."""
    version = house.stage(calibrated_campaign, isos=isos)
    publication = {"valid_from": valid_from, "reason": reason}
    house.post(f"/v1/calibrations/{version['id']}/publish", publication, status=200)
    return version
