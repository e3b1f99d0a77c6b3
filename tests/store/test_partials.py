"""Uploads in pieces on the disk: what counts, and who may write."""

import errno
import os

import pytest

from store.blobs import StorageUnavailable
from store.blobs.partials import _STATE, LASTS_S, Facts, OtherOffset, Partials, Superseded

OWNED = {"organisation_id": "org_1", "key_id": "key_1", "campaign_id": "cmp_1"}
FACTS = Facts(**OWNED, size_bytes=6, sha256="0" * 64, said={"role": "light"}, expires_at=2e10)


@pytest.fixture
def partials(tmp_path):
    return Partials(tmp_path)


def test_only_what_is_kept_counts(partials):
    partial = partials.begin("token", FACTS)
    with partial.claim() as claim:
        claim.write([b"ab"])
        claim.keep()
        claim.write([b"cd"])
    assert partial.read_offset() == 2
    with partial.claim(2) as claim:
        claim.write([b"CD", b"ef"])
        claim.keep()
    with partial.whole() as (facts, pieces):
        assert (facts, b"".join(pieces)) == (FACTS, b"abCDef")


def test_bytes_are_on_the_disk_before_their_count_is(partials, monkeypatch):
    partial, seen, sync = partials.begin("token", FACTS), [], os.fdatasync

    def record(fd):
        seen.append((partial.read_offset(), os.pread(fd, 6, os.fstat(fd).st_size - 2)))
        sync(fd)

    def cut(_fd):
        raise OSError(errno.EIO, "the disk is gone")

    with partial.claim() as claim:
        monkeypatch.setattr(os, "fdatasync", record)
        claim.write([b"ab"])
        claim.keep()
        assert seen == [(0, b"ab"), (2, b"ab")]
        monkeypatch.setattr(os, "fdatasync", cut)
        claim.write([b"cd"])
        with pytest.raises(StorageUnavailable, match="gone"):
            claim.keep()
    assert partial.read_offset() == 2


def test_a_claim_ends_the_one_before(partials):
    partial = partials.begin("token", FACTS)
    with partial.claim() as first:
        first.write([b"ab"])
        first.keep()
        first.write([b"xx"])
        with partial.claim(2) as second:
            for late in (lambda: first.write([b"yy"]), first.keep):
                with pytest.raises(Superseded):
                    late()
            second.write([b"cdef"])
            second.keep()
    with partial.whole() as (_, pieces):
        assert b"".join(pieces) == b"abcdef"


def test_a_claim_at_another_offset_ends_nobody(partials):
    partial = partials.begin("token", FACTS)
    with partial.claim() as claim:
        claim.write([b"ab"])
        with pytest.raises(OtherOffset, match="0"):
            partial.claim(2)
        claim.keep()
    assert partial.read_offset() == 2


def test_one_token_is_one_upload_until_it_is_a_frame(partials):
    first = partials.begin("token", FACTS)
    with first.claim() as claim:
        claim.write([b"abcdef"])
        claim.keep()
    assert partials.begin("token", FACTS).read_offset() == 6
    first.become("frm_1")
    assert partials.find("token", "org_1").read_facts().frame_id == "frm_1"
    assert partials.find("token", "org_2") is None
    assert (partials.count("org_1"), partials.begin("token", FACTS).read_offset()) == (0, 0)
    assert [facts.size_bytes for facts in partials.list_facts("org_1")] == [6]


def test_what_has_expired_is_not_found_and_is_swept(partials, monkeypatch):
    done = partials.begin("done", FACTS)
    done.become("frm_1")
    partials.begin("under way", FACTS)
    assert partials.sweep() == 0
    monkeypatch.setattr("time.time", lambda: FACTS.expires_at + LASTS_S)
    assert partials.find("under way", "org_1") is None
    assert (partials.sweep(), partials.sweep(), partials.count("org_1")) == (2, 0, 0)


def test_who_reads_while_it_becomes_a_frame_reads_one_state_or_the_other(partials, monkeypatch):
    begun = partials.begin("token", FACTS)

    class Interrupted:
        """The file becomes a frame as soon as its head has been looked at."""

        size, pack, told = _STATE.size, _STATE.pack, False

        def unpack(self, head):
            found = _STATE.unpack(head)
            if not self.told:
                self.told = True
                begun.become("frm_1")
            return found

    monkeypatch.setattr("store.blobs.partials._STATE", Interrupted())
    assert begun.read_facts().frame_id in {"", "frm_1"}
    assert begun.read_facts().frame_id == "frm_1"
