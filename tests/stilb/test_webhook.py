"""Webhooks from the command line."""


def test_a_webhook_is_added_tested_listed_and_removed(signed_in):
    told = signed_in("webhook", "add", "https://board.invalid/hook", "--event", "job.failed", "--json")
    assert told.code == 0, told.err
    made = told.json
    assert made["secret"].startswith("whsec_")
    assert signed_in("webhook", "test", made["id"]).code == 0
    (sent,) = signed_in("webhook", "log", made["id"], "--json").json["items"]
    assert (sent["event"], sent["state"]) == ("webhook.test", "queued")
    assert "queued" in signed_in("webhook", "retry", made["id"], sent["id"]).out
    assert "in use" in signed_in("webhook", "list").out
    assert signed_in("webhook", "enable", made["id"]).code == 0
    assert signed_in("webhook", "remove", made["id"]).code == 0
    assert signed_in("webhook", "list", "--json").json == {"items": []}
