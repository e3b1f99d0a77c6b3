"""A push ends with a signed receipt, which is verified without the service."""

import json

import pytest

from stilb.commands.output import Exit
from tests.support.frames import write_frame


@pytest.fixture
def card(tmp_path):
    for name in ("dark", "level-1"):
        (tmp_path / "card" / name).mkdir(parents=True)
        write_frame(tmp_path / "card" / name / "1.DNG", signal_dn=900.0)
    (tmp_path / "card" / "log.txt").write_text("flown at noon")
    return tmp_path / "card"


def test_a_push_writes_a_receipt_that_is_verified_offline(signed_in, team, card, tmp_path, config):
    campaign, kept = team.campaign(), tmp_path / "receipts" / "card.json"
    push = ("push", card, "--campaign", campaign.id, "--no-wait", "--json", "--receipt", kept)
    assert signed_in(*push).json["receipt"] == str(kept)
    told = signed_in("receipt", "verify", kept)
    assert (told.code, "2 files" in told.out, "log.txt: not covered, not sent" in told.out) == (0, True, True)
    assert signed_in("receipt", "verify", kept, "--card", card / "dark").code == Exit.FINDINGS
    assert signed_in("receipt", "verify", kept, "--card", card).out.count("log.txt") == 1
    (card / "log.txt").unlink()
    # ours: what init writes, and a receipt that was written to the card itself
    (card / "campaign.toml").write_text("[camera]")
    copy = card / "receipt.json"
    copy.write_bytes(kept.read_bytes())
    told = signed_in("receipt", "verify", copy, "--card", card)
    assert (told.code, "campaign.toml" in told.out) == (Exit.DONE, False)
    copy.unlink()
    assert signed_in("receipt", "verify", kept, "--card", card).code == Exit.DONE
    (card / "dark" / "1.DNG").write_bytes(b"another")
    told = signed_in("receipt", "verify", kept, "--card", card, "--json")
    assert (told.code, told.json["differences"]) == (1, ["dark/1.DNG: not the file of the receipt"])

    # the key as a file, for whoever has never seen the service
    keys = tmp_path / "keys.json"
    keys.write_text(signed_in("receipt", "keys", "--json").out)
    (config / "signing-keys.json").unlink()
    assert signed_in("receipt", "verify", kept).code == Exit.USAGE
    assert signed_in("receipt", "verify", kept, "--key", keys).code == Exit.DONE
    signed = json.loads(kept.read_text())
    signed["receipt"]["files"][0]["name"] = "dark/2.DNG"
    kept.write_text(json.dumps(signed))
    assert signed_in("receipt", "verify", kept, "--key", keys).code == Exit.FINDINGS


def test_no_receipt_where_a_file_did_not_arrive(signed_in, team, card, monkeypatch):
    def fail(*_):
        raise OSError("cannot be read")

    monkeypatch.setattr("stilb.field.push.Journal.hash_of", fail)
    ended = signed_in("push", card, "--campaign", team.campaign().id, "--no-wait", "--json")
    assert ended.code == Exit.FINDINGS
    assert "receipt" not in ended.json
