"""Heads and streams over a real connection."""

import http.client
import json
from contextlib import closing

import httpx

from tests.support.frames import write_frame


def read_states(lines):
    return (json.loads(line.removeprefix("data: ")) for line in lines if line.startswith("data: "))


def test_a_campaign_is_followed_as_it_changes(team, tmp_path):
    campaign = team.campaign()
    key = {"Authorization": f"Bearer {team.key}"}
    with httpx.stream("GET", f"{team.url}/v1/campaigns/{campaign.id}/events", headers=key) as stream:
        states = read_states(stream.iter_lines())
        first = next(states)
        frame = team.client.push(campaign.id, write_frame(tmp_path / "a.DNG"), role="dark")
        assert next(states)["revision"] > first["revision"]
    check_heads(team, campaign, frame)


def check_heads(team, campaign, frame):
    """A head is the GET's own, and the line is of use afterwards; that of a stream awaits no change."""
    key = {"Authorization": f"Bearer {team.key}"}
    paths = ("/docs/pictures/concept.svg", f"/v1/campaigns/{campaign.id}", f"/v1/frames/{frame.id}/content")
    host = team.url.removeprefix("http://")
    with closing(http.client.HTTPConnection(host, timeout=60)) as line:
        line.connect()
        first = line.sock
        for path in paths:
            told = []
            for method in ("HEAD", "GET", "HEAD"):
                line.request(method, path, headers=key)
                answer = line.getresponse()
                told.append((answer.status, answer.headers["Content-Type"], answer.headers["Content-Length"]))
                assert len(answer.read()) == (int(told[-1][2]) if method == "GET" else 0)
            assert told == [told[0]] * 3
            assert told[0][0] == 200
        assert line.sock is first
        line.request("HEAD", f"/v1/campaigns/{campaign.id}/events", headers=key)
        assert line.getresponse().headers["Content-Type"].startswith("text/event")
