"""Changes are told as they happen, over a connection that may be cut."""

import http.client
import json
from contextlib import closing

import pytest

import stilb
from stilb.commands.output import Exit
from tests.support.frames import write_frame


def test_a_campaign_is_followed_and_a_job_to_its_end(team, signed_in, tmp_path):
    campaign = team.campaign()
    events = team.client.campaign_events(campaign.id)
    first = next(events)
    frame = team.client.push(campaign.id, write_frame(tmp_path / "a.DNG"), role="dark")
    assert next(events)["revision"] > first["revision"]
    states = [event["state"] for event in team.client.job_events(frame.job_id)]
    assert states[-1] == "succeeded"
    ended = signed_in("events", frame.job_id, "--json")
    assert (ended.code, ended.json["state"]) == (Exit.DONE, "succeeded")
    other = team.client.push(campaign.id, write_frame(tmp_path / "b.DNG", serial="B2"), role="dark")
    refused = signed_in("events", other.job_id)
    assert (refused.code, refused.out.splitlines()[-1].split()[1]) == (Exit.FINDINGS, "failed")
    check_heads(team, campaign, frame)
    events.close()


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


def test_a_cut_stream_goes_on_after_the_last_event(service, client):
    def event(mark, revision):
        return (
            f"id: {mark}\nevent: campaign\ndata: {json.dumps({'id': 'c', 'revision': revision})}\n\n".encode()
        )

    stream = {"Content-Type": "text/event-stream"}
    service.will_answer(b"retry: 3000\n\n:\n\n" + event(4, 4), headers=stream, withheld=9)
    service.will_refuse(503, "service_stopping", retryable=True)
    service.will_answer(event(5, 5) + b'event: end\ndata: {"code": "unauthenticated"}\n\n', headers=stream)
    events = client.campaign_events("c")
    assert [next(events)["revision"], next(events)["revision"]] == [4, 5]
    with pytest.raises(stilb.Problem, match="revoked"):
        next(events)
    assert [asked.headers.get("last-event-id") for asked in service.asked] == [None, "4", "4"]
    service.will_refuse(404, "not_found")
    with pytest.raises(stilb.Problem, match="not_found"):
        next(client.campaign_events("of nobody"))
