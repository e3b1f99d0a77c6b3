"""From a camera to its coefficients in force, over real processes and real HTTP."""

from tests.support.campaigns import ISOS, K_TRUE
from tests.support.fieldwork import CHANNELS, figures_of


def test_a_campaign_becomes_coefficients_in_force(composed, shots, quiet_figures):
    """Of both deployments to the last bit; `up` publishes in test_printed.py."""
    with composed.team() as team:
        campaign = team.campaign()
        team.push(campaign, shots)
        version = team.client.calibrate(campaign.id)  # as documented: it waits until the frames are read
        for frame in team.client.frames(campaign.id):
            assert frame.state == "extracted"
            assert [row["channel"] for row in frame.raw["statistics"]] == CHANNELS
        assert (version.state, version.version) == ("draft", 1)
        team.client.publish(version.id, valid_from="2026-05-01T00:00:00Z", reason="first")
        in_force = team.client.coefficients(campaign.camera_id, at="2026-06-01T00:00:00Z")
    ks = [c for c in in_force if c.name == "luminance_k"]
    assert [k.iso for k in ks] == list(ISOS)
    assert all(abs(k.value - K_TRUE) <= 3 * k.standard_uncertainty for k in ks)
    assert {c.calibration_id for c in in_force} == {version.id}
    assert figures_of(version) == quiet_figures
