"""The tab key knows what may stand there."""

import pytest


@pytest.fixture
def complete(stilb_command, monkeypatch):
    """Ask as bash does."""

    def complete(*words):
        monkeypatch.setenv("_STILB_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", " ".join(("stilb", *words)))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        told = set(stilb_command().out.split("\n")) - {""}
        monkeypatch.delenv("_STILB_COMPLETE")
        return told

    return complete


def test_names_of_the_client_are_completed_without_a_service(complete):
    assert complete("push", ".", "--role", "") >= {"light", "dark", "field"}
    assert complete("calibrate", "P", "--model", "p") == {"proportional", "power"}
    assert complete("k", "c", "--method", "g") == {"geometry"}
    assert complete("campaign", "show", "") == set()


def test_campaigns_and_cameras_are_those_of_the_service(signed_in, team, complete):
    assert signed_in("whoami").code == 0
    campaign = team.campaign()
    team.client.change_campaign(campaign.id, project_number="Ring-Road")
    assert complete("campaign", "show", "Ri") == {"Ring-Road"}
    assert complete("k", "") == {team.client.camera(campaign.camera_id).serial}
