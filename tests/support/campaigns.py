"""A whole small campaign, uploaded: what a fit needs and no more."""

from tests.support.house import House

K_TRUE = 2.0
LEVELS = {"level-1": 40.0, "level-2": 20.0, "level-3": 8.0, "level-4": 3.0}
SETTINGS = ((0.01, 4.0), (0.02, 5.6), (0.02, 4.0))
ISOS = (3200, 6400)
ROI = {"polygon": [[8, 8], [88, 8], [88, 56], [8, 56]]}


def list_readings(levels=LEVELS, *, factors=(0.998, 1.002), **named) -> list[dict]:
    """Readings of each scene, a little apart; ``named`` : what else each of them states."""
    return [
        {"scene": scene, "quantity": "luminance", "value": value * factor, "unit": "cd/m2", **named}
        for scene, value in levels.items()
        for factor in factors
    ]


def upload_campaign(house: House, *, isos=ISOS, roi=ROI, readings=True, seed=1) -> dict:
    """Light frames of a proportional sensor at several levels and settings, dark frames, readings."""
    campaign = house.campaign()
    if roi:
        house.put(f"/v1/campaigns/{campaign['id']}/roi", roi)
    for iso in isos:
        for index, (exposure_time_s, f_number) in enumerate(SETTINGS):
            settings = {"exposure_time_s": exposure_time_s, "f_number": f_number, "iso": iso}
            dark = house.frame_bytes(signal_dn=0.0, seed=seed + 7 * index + iso, **settings)
            house.upload(campaign, dark, role="dark", filename=f"dark-{iso}-{index}.DNG")
            for number, (scene, luminance) in enumerate(LEVELS.items()):
                signal = K_TRUE * exposure_time_s * iso * luminance / f_number**2
                seed_of = seed + 100 * number + index + iso
                light = house.frame_bytes(signal_dn=signal, seed=seed_of, **settings)
                name = f"{scene}-{iso}-{index}.DNG"
                house.upload(campaign, light, role="light", scene=scene, filename=name)
    if readings:
        house.post(f"/v1/campaigns/{campaign['id']}/readings", list_readings())
    return campaign


def calibrate(house: House, campaign: dict, **params) -> dict:
    """Extract what waits, fit, and give the version."""
    house.work()
    return house.fit(campaign, **params)


def calibrated_campaign(house: House, *, isos=ISOS, **params) -> dict:
    """The version that the campaign gives."""
    return calibrate(house, upload_campaign(house, isos=isos), **params)


def published_campaign(house: House, *, isos=ISOS, **publication) -> dict:
    """The version that the campaign gives, in force; as it was before it was published."""
    version = house.stage(calibrated_campaign, isos=isos)
    house.publish(version, **publication)
    return version
