"""Results that differ by the rounding of another processor are of the same version."""

from dataclasses import replace

from radiometry import methods
from store.fits import make_version, read_params, write_version
from store.queries.evidence import gather
from store.tables import Calibration, Campaign
from tests.support.campaigns import calibrate, upload_campaign


def test_another_kernel_makes_no_other_version(house):
    campaign = upload_campaign(house)
    version = calibrate(house, campaign)
    with house.database.writing("test") as session:
        row, made = session.get_one(Campaign, campaign["id"]), session.get_one(Calibration, version["id"])
        params, evidence = read_params(row, made.parameters), gather(session, row)
        fitted = methods.get_method("luminance").fit(evidence.frames, evidence.readings, params)
        iso, *others = fitted.iso_fits
        k = replace(iso.coefficient, luminance_k=iso.coefficient.luminance_k * (1 + 1e-15))
        rounded = replace(fitted, iso_fits=(replace(iso, coefficient=k), *others))
        new = make_version(session, row, evidence, params, rounded, by="another worker")
        found = write_version(session, new)
        assert (found.id, found.result == made.result) == (version["id"], True)
