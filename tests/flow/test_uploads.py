"""Uploads that break off or collide: nothing stays behind, and what had arrived is not sent again."""

import os
import socket
import struct
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import func, select
from tusclient.client import TusClient

import stilb
from stilb.transport import hash_file
from store.blobs.partials import Partial
from store.tables import Blob, FrameRow
from tests.support.blobs import files
from tests.support.fieldwork import Team
from tests.support.proxy import Proxy
from tests.support.resumable import PIECE, TUS, describe
from tests.support.waiting import wait_for

MEGABYTE = 1 << 20


@pytest.fixture
def team(embedded):
    with embedded.team() as team:
        yield team


@pytest.fixture
def campaign(team):
    return team.campaign()


def write_file(folder: Path, campaign, *, repeated: int = 400_000) -> Path:
    """Some megabytes that no other campaign has."""
    path = folder / "frame.DNG"
    path.write_bytes(campaign.id.encode() * repeated)
    return path


def frames_path(campaign):
    return f"/v1/campaigns/{campaign.id}/frames?role=light"


def begin_upload(
    team: Team, campaign, *, promised: int, sent: int, content: bytes | None = None
) -> socket.socket:
    """A connection on which an upload has begun and not ended."""
    host, port = team.url.removeprefix("http://").split(":")
    connection = socket.create_connection((host, int(port)))
    head = (
        f"POST {frames_path(campaign)} HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {team.key}\r\n"
        f"Content-Type: application/octet-stream\r\nContent-Length: {promised}\r\n\r\n"
    )
    connection.sendall(head.encode() + (content or b"x" * sent)[:sent])
    return connection


def half_written(deployment, before):
    """What is left on the way since; ``before`` holds what others left, such as a worker that was killed."""
    found = (path for path in files(deployment.blobs / "tmp") if path not in before)
    return [path for path in found if size_of(path)]


def size_of(path):
    """Return the size of a file that may go at any moment."""
    with suppress(FileNotFoundError):
        return path.stat().st_size
    return 0


def known(deployment, campaign, sha256=None):
    """How many frames the campaign has, and whether the bytes are known."""
    with deployment.database.reading() as session:
        frames = session.scalar(
            select(func.count()).select_from(FrameRow).where(FrameRow.campaign_id == campaign.id)
        )
        return frames, sha256 is not None and session.get(Blob, sha256) is not None


def test_a_service_killed_in_the_middle_of_two_uploads(embedded, team, campaign, tmp_path):
    """The client goes on where it was; of bytes without a client what was written is swept after a day."""
    before = files(embedded.blobs)
    path = write_file(tmp_path, campaign)
    sent = []

    def progress(progress):
        sent.append(progress.bytes_sent)
        if len(sent) == 8:
            # what is not made durable within that time is sent again
            time.sleep(1)
            embedded.kill("service")

    with begin_upload(team, campaign, promised=8 * MEGABYTE, sent=3 * MEGABYTE):
        embedded.wait_until(lambda: len(half_written(embedded, before)) == 1)
        frame = team.client.push(campaign.id, path, role="light", on_progress=progress)
    assert sent == sorted(sent) or min(sent[8:]) > MEGABYTE
    assert frame.sha256 == hash_file(path)
    assert known(embedded, campaign, frame.sha256) == (1, True)
    (job,) = embedded.wait_for_jobs([frame.id])
    assert (job.state, job.error["code"]) == ("failed", "not_a_raw_file")
    (left,) = half_written(embedded, before)
    # a worker begins with what nobody has written to for a day
    long_ago = left.stat().st_mtime - 2 * 24 * 3600
    os.utime(left, (long_ago, long_ago))
    embedded.kill("worker")
    embedded.wait_until(lambda: not half_written(embedded, before))
    assert {each.name for each in set(files(embedded.blobs)) - set(before)} == {frame.sha256}


def test_what_has_arrived_before_a_cut_is_not_sent_again(team, campaign, tmp_path):
    path = write_file(tmp_path, campaign)
    cuts, pieces = 0, 0
    host, port = team.url.removeprefix("http://").split(":")
    with (
        Proxy((host, int(port))) as proxy,
        stilb.Client(f"http://{proxy.address}", team.key, retries=10, backoff_s=0.05) as client,
    ):

        def progress(progress):
            nonlocal cuts, pieces
            pieces += 1
            if cuts < 5 and progress.bytes_sent > 2 * MEGABYTE * (cuts + 1):
                cuts += 1
                time.sleep(0.3)
                proxy.become("failing")
                proxy.become("open")

        frame = client.push(campaign.id, path, role="light", on_progress=progress)
    assert cuts == 5
    # of one MiB each, where begun anew each time they would be three times as many
    assert pieces <= path.stat().st_size // MEGABYTE + 2 * cuts
    assert frame.sha256 == hash_file(path)


def open_piece(team: Team, place: str, promised: int) -> socket.socket:
    """A connection on which the bytes of an upload are to follow, from its beginning."""
    host, port = team.url.removeprefix("http://").split(":")
    connection = socket.create_connection((host, int(port)))
    headers = {"Host": host, "Content-Length": promised} | PIECE | {"Upload-Offset": 0}
    lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    connection.sendall(f"PATCH {place} HTTP/1.1\r\n{lines}\r\n".encode())
    return connection


def test_a_connection_that_hangs_is_taken_over_at_once(embedded, team, campaign):
    content = campaign.id.encode() * 100_000
    with team.http() as http:
        place = http.post("/v1/uploads", headers=describe(campaign.id, content)).headers["Location"]
        with open_piece(team, place, len(content)) as hanging:
            hanging.sendall(content[:MEGABYTE])
            begun = max((embedded.data / "uploads").glob("*/[!.]*"), key=lambda each: each.stat().st_mtime)
            # not by asking the service: who asks takes the upload over
            wait_for(lambda: Partial(begun).read_offset() == MEGABYTE)
            offset = int(http.head(place, headers=TUS).headers["Upload-Offset"])
            assert offset == MEGABYTE
            hanging.sendall(content[MEGABYTE : MEGABYTE + 1000])
            time.sleep(0.5)
            rest = http.patch(place, content=content[offset:], headers=PIECE | {"Upload-Offset": str(offset)})
            assert (rest.status_code, "Content-Location" in rest.headers) == (204, True)
            assert b"409" in hanging.recv(100)


# it leaves the closing of its connections to the collector
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_client_of_others_uploads_in_pieces(embedded, team, campaign, tmp_path):
    path = write_file(tmp_path, campaign, repeated=100_000)
    others = TusClient(f"{team.url}/v1/uploads", headers={"Authorization": f"Bearer {team.key}"})
    said = {"campaign_id": campaign.id, "role": "light", "filename": path.name}
    begun = others.uploader(str(path), chunk_size=MEGABYTE, metadata=said, upload_checksum=False)
    begun.upload_chunk()
    assert begun.offset == MEGABYTE
    # another run of the program, which knows the address alone
    others.uploader(str(path), chunk_size=MEGABYTE, url=begun.url).upload()
    assert known(embedded, campaign, hash_file(path)) == (1, True)


def test_the_same_small_files_from_two_clients_of_which_one_is_killed(embedded, team, campaign, tmp_path):
    """Each becomes one frame with one job, whoever brought it; one that is refused takes none along."""
    before, uploads = files(embedded.blobs), []
    for number in range(20):
        path = tmp_path / f"{number}.dng"
        path.write_bytes(f"{campaign.id} {number} ".encode() * 50)
        uploads.append(stilb.Upload(campaign_id=campaign.id, path=path, role="light"))
    wrong = replace(uploads[0], scene="x" * 1000)
    with ThreadPoolExecutor(1) as pool:
        pushing = pool.submit(team.client.push_each, [*uploads[:10], wrong, *uploads[10:]])
        killed = []
        for number, upload in enumerate(uploads):
            content = upload.path.read_bytes()
            sent = len(content) // (2 if number % 4 == 0 else 1)
            killed.append(begin_upload(team, campaign, promised=len(content), sent=sent, content=content))
        for connection in killed:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            connection.close()
        told = pushing.result(60)
    refused = told.pop(10)
    assert (refused.status, "scene" in str(refused)) == (422, True)
    ids = [frame.id for frame in told]
    assert [frame.sha256 for frame in told] == [hash_file(upload.path) for upload in uploads]
    assert len(set(ids)) == 20
    assert known(embedded, campaign) == (20, False)
    assert sorted(job.subject_id for job in embedded.wait_for_jobs(ids)) == sorted(ids)
    embedded.wait_until(lambda: not half_written(embedded, before))


FORM = b'--stilb\r\nContent-Disposition: form-data; name="file"; filename="f"\r\n\r\n', b"\r\n--stilb--\r\n"


@pytest.mark.parametrize(
    ("kind", "start", "end"),
    [("application/octet-stream", b"", b""), ("multipart/form-data; boundary=stilb", *FORM)],
    ids=["raw", "multipart"],
)
def test_memory_stays_flat_however_large_the_file(embedded, team, campaign, shots, kind, start, end):
    team.push(campaign, shots[:2])
    size = 150 * MEGABYTE

    def body():
        yield start
        for number in range(size // MEGABYTE):
            yield number.to_bytes(8, "big") * (MEGABYTE // 8)
        yield end

    proc = Path(f"/proc/{embedded.pid('service')}")
    (proc / "clear_refs").write_text("5")  # the peak begins anew
    before = resident_peak(proc)
    headers = {"Content-Length": str(size + len(start) + len(end)), "Content-Type": kind}
    with team.http() as http:
        answer = http.post(frames_path(campaign), content=body(), headers=headers)
    assert answer.status_code == 201, answer.text
    assert answer.json()["size_bytes"] == size
    assert resident_peak(proc) - before < 40 * MEGABYTE


def test_fifty_slow_uploads_take_little_memory_each(embedded, team, campaign):
    content = campaign.id.encode() * 200_000
    proc = Path(f"/proc/{embedded.pid('service')}")
    with team.http() as http, ExitStack() as stack:
        begun = [describe(campaign.id, content + bytes([number])) for number in range(50)]
        places = [http.post("/v1/uploads", headers=each).headers["Location"] for each in begun]
        (proc / "clear_refs").write_text("5")  # the peak begins anew
        before = resident_peak(proc)
        lines = [stack.enter_context(open_piece(team, place, len(content))) for place in places]
        # in turns, so that all of them are under way at once
        for at in range(0, 3 * MEGABYTE, MEGABYTE):
            for line in lines:
                line.sendall(content[at : at + MEGABYTE])
        arrived = len(places) * 3 * MEGABYTE
        uploads = embedded.data / "uploads"
        embedded.wait_until(lambda: sum(path.stat().st_size for path in files(uploads)) >= arrived)
        peak = resident_peak(proc)
        for place in places:
            http.delete(place, headers=TUS)
    assert peak - before < len(places) * 4 * MEGABYTE


def resident_peak(proc: Path) -> int:
    lines = (proc / "status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024
