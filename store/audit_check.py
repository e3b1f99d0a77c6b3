"""The check that the audit trail is whole.

An entry that was edited, deleted, inserted or moved breaks the chain, a cut-off end does not match the head.
Whoever can rewrite the database can recompute every hash: only a head that was noted elsewhere tells that.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from typing import Any

from sqlalchemy import ColumnElement, func, select, text
from sqlalchemy.orm import Session

from radiometry.records import Record
from store.audit import digest
from store.database import Database
from store.tables import AuditChain, AuditEntry, AuditHead, Organisation

_PAGE = 1000
_FIRST = "0" * 64
_COLUMNS = tuple(AuditEntry.__table__.columns)


class Head(Record):
    """The last links of all chains, as they are noted down: ``seq:sha256``, a number and a hash."""

    seq: int
    sha256: str
    entries: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{self.seq}:{self.sha256}"


class Fault(Exception):  # noqa: N818  it says what was found
    """The first place where the chain breaks, and how."""

    def __init__(self, seq: int, what: str) -> None:
        super().__init__(what)
        self.seq, self.what = seq, what


def check_audit(database: Database, noted: Head | None = None) -> tuple[Head, Fault | None]:
    """Walk the chains of one snapshot: the last links that hold, and the first fault; ``noted``: a head."""
    # the number up to which all entries are there: numbers are drawn before the commit
    with database.reading(snapshot=True) as session:
        if not database.is_sqlite:
            session.execute(text("LOCK TABLE audit_chain IN EXCLUSIVE MODE"))
        settled = session.scalar(select(func.max(AuditEntry.seq))) or 0
    with database.reading(snapshot=True) as session:
        trail = _Trail(session.scalars(select(AuditHead)).one_or_none())
        head = None
        try:
            for entry in _walk(session):
                if noted is not None and trail.last <= noted.seq < entry["seq"]:
                    _compare(trail.head, noted)
                if trail.last <= settled < entry["seq"]:
                    head = trail.head
                trail.follow(entry)
            trail.end(session)
            if noted is not None and noted.seq >= trail.last:
                _compare(trail.head, noted)
        except Fault as fault:
            return trail.head, fault
        return head or trail.head, None


def check_chain(
    session: Session, organisation_id: str, *, after: int, most: int
) -> tuple[Head, Fault | None, bool]:
    """Check the next entries of one organisation's chain, of a snapshot, after the entry `after` (0: all).

    Of entries older than the organisation's own chain only their own hash is checked: what lies between them
    belongs to others. Answers the last link that holds, the first fault, and whether the chain's end was met.
    """
    own = AuditEntry.organisation_id == organisation_id
    row = session.scalars(select(AuditHead)).one()
    closed = last = Head(seq=row.seq, sha256=row.sha256)
    try:
        if after:
            sha256 = session.scalar(select(AuditEntry.sha256).where(own, AuditEntry.seq == after))
            if sha256 is None:
                raise Fault(after, f"entry {after} is missing: deleted or moved")  # noqa: TRY301
            last = last if after <= closed.seq else Head(seq=after, sha256=sha256)
        entries = _read(session, after, most + 1, own)
        for count, entry in enumerate(entries[:most], 1):
            followed = _follow(last, entry, linked=entry["seq"] > closed.seq)
            last = replace(followed if entry["seq"] > closed.seq else closed, entries=count)
            after = entry["seq"]
        if len(entries) > most:
            return replace(last, seq=after), None, False
        chain = session.get(AuditChain, organisation_id, populate_existing=True)
        _compare_end(last, chain, "")
    except Fault as fault:
        return last, fault, True
    return last, None, True


class _Trail:
    """How far the walk has come: in the common chain, and in that of each organisation."""

    def __init__(self, closed: AuditHead | None) -> None:
        self._has_head = closed is not None
        self._common = Head(seq=0, sha256=_FIRST)
        self._closed = Head(seq=closed.seq, sha256=closed.sha256) if closed else self._common
        self._chains: dict[str, Head] = {}
        self._entries = self.last = 0

    @property
    def head(self) -> Head:
        """Return one hash of all last links; while there is only the common chain, its own."""
        sha256 = self._common.sha256
        if self._chains:
            links = [[name, each.seq, each.sha256] for name, each in sorted(self._chains.items())]
            sha256 = hashlib.sha256(json.dumps([sha256, *links]).encode()).hexdigest()
        return Head(seq=self.last, sha256=sha256, entries=self._entries)

    def follow(self, entry: Mapping[str, Any]) -> None:
        seq = entry["seq"]
        if seq <= self._closed.seq:
            if seq != self._common.seq + 1:
                missing = _name(self._common.seq + 1, seq - 1)
                raise Fault(self._common.seq + 1, f"{missing} missing: deleted, or moved elsewhere")
            self._common = _follow(self._common, entry)
        else:
            self._end_common()
            name = entry["organisation_id"] or ""
            self._chains[name] = _follow(self._chains.get(name, self._closed), entry)
        self.last, self._entries = seq, self._entries + 1

    def end(self, session: Session) -> None:
        """Compare the ends with the chains' own rows; every organisation must have one."""
        self._end_common()
        names = {"", *session.scalars(select(Organisation.id)), *self._chains}
        rows = {row.name: row for row in session.scalars(select(AuditChain))}
        for name in sorted(names | rows.keys()):
            last = self._chains.get(name, self._closed)
            _compare_end(last, rows.get(name), f" of {name}" if name else "")

    def _end_common(self) -> None:
        _compare_end(self._common, self._closed if self._has_head else None, "")


def _follow(last: Head, entry: Mapping[str, Any], *, linked: bool = True) -> Head:
    seq = entry["seq"]
    if digest(entry) != entry["sha256"]:
        raise Fault(seq, f"entry {seq} does not have its hash: its content was edited, or it was moved")
    if linked and entry["previous_sha256"] != last.sha256:
        why = "one of them was rewritten, inserted or moved, or one between them was deleted"
        raise Fault(seq, f"entry {seq} does not continue entry {last.seq}: {why}")
    return Head(seq=seq, sha256=entry["sha256"])


def _name(first: int, last: int) -> str:
    return f"entry {first} is" if first == last else f"entries {first} to {last} are"


def _compare(last: Head, noted: Head) -> None:
    if noted.seq > last.seq:
        message = f"the trail ends at entry {last.seq}, the noted head was entry {noted.seq}: cut off"
        raise Fault(last.seq + 1, message)
    if noted != last:
        message = f"entry {noted.seq} has another hash than the noted head: the trail up to it was rewritten"
        raise Fault(noted.seq, message)


def _compare_end(last: Head, head: Head | AuditChain | None, whose: str) -> None:
    seq, after = last.seq, last.seq + 1
    if head is None:
        raise Fault(after, f"the head's row{whose} is missing: whether entries are missing cannot be told")
    if head.seq > seq:
        missing = f"entries{whose} from {after} to {head.seq} are" if whose else _name(after, head.seq)
        raise Fault(after, f"{missing} missing: deleted at the end")
    if head.seq < seq:
        raise Fault(seq, f"entry {seq}{whose} lies beyond the head: inserted at the end")
    if head.sha256 != last.sha256:
        raise Fault(seq, f"entry {seq}{whose} does not match the head: one of the two was rewritten")


def _walk(session: Session) -> Iterator[Mapping[str, Any]]:
    after: int | None = None
    while page := _read(session, after, _PAGE):
        yield from page
        after = page[-1]["seq"]


def _read(
    session: Session, after: int | None, limit: int, *where: ColumnElement[bool]
) -> list[Mapping[str, Any]]:
    rows = select(*_COLUMNS).where(*where).order_by(AuditEntry.seq).limit(limit)
    if after is not None:
        rows = rows.where(AuditEntry.seq > after)
    try:
        return [dict(row) for row in session.execute(rows).mappings()]
    except (ValueError, TypeError) as error:
        # a value that is none of its type, which no entry of ours has: find its row
        if limit > 1:
            return _read(session, after, limit // 2, *where)
        seq = (after or 0) + 1
        raise Fault(seq, f"entry {seq} cannot be read, it was edited: {error}") from error
