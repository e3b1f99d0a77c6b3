"""Audit trail: each flush notes the changes of audited rows, and the end of a transaction chains them."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from datetime import date, datetime
from typing import Any

from sqlalchemy import Column, ColumnElement, Float, func, insert, inspect, literal, select, text, update
from sqlalchemy.orm import Session

from store.tables.audit import AuditChain, AuditEntry, AuditHead
from store.tables.base import Audited, AuditedTogether, Base, utc_now
from store.tables.organisation import Organisation

_COVERED = (
    *("seq", "organisation_id", "actor", "action", "subject_type", "subject_id", "before", "after"),
    "previous_sha256",
)

_LAST_NUMBER = func.coalesce(
    select(func.max(AuditEntry.seq)).scalar_subquery(), select(AuditHead.seq).scalar_subquery()
)
_DRAWN_NUMBERS = text("SELECT nextval('audit_entry_number') FROM generate_series(1, :count)")


def record_changes(session: Session, _context: object) -> None:
    """Note an audit entry for each audited row that a flush has just inserted, changed or deleted."""
    entries = [_entry(session, row, "create") for row in session.new if isinstance(row, Audited)]
    changed = (row for row in session.dirty if isinstance(row, Audited) and session.is_modified(row))
    entries += [_entry(session, row, "change") for row in changed]
    entries += [_entry(session, row, "delete") for row in session.deleted if isinstance(row, Audited)]
    entries += _entries_together(session, [row for row in session.new if isinstance(row, AuditedTogether)])
    session.info.setdefault("audit_entries", []).extend(entries)
    for founded in [row.id for row in session.new if isinstance(row, Organisation)]:
        start = select(literal(founded), AuditHead.seq, AuditHead.sha256)
        session.execute(insert(AuditChain).from_select(["name", "seq", "sha256"], start))


def record_act(
    session: Session, action: str, subject: Base, before: dict[str, Any], after: dict[str, Any]
) -> None:
    """Note what a person did to a row whose own changes are too many to be audited."""
    entry = _named(session, subject, action, before, after)
    session.info.setdefault("audit_entries", []).append(entry)


def append_entries(session: Session) -> None:
    """Chain and write what was noted: last of all, as a chain's head is locked after every other row."""
    if not (entries := session.info.pop("audit_entries", [])):
        return
    mine = AuditChain.name == (session.info["organisation_id"] or "")
    sha256, *numbers = _lock_chain(session, mine, len(entries))
    for entry, seq in zip(entries, numbers, strict=True):
        entry |= {"seq": seq, "previous_sha256": sha256}
        sha256 = entry["sha256"] = digest(entry)
    connection = session.connection()
    connection.execute(insert(AuditEntry), entries)
    last = {"seq": entries[-1]["seq"], "sha256": sha256}
    connection.execute(update(AuditChain).where(mine), last)


def _lock_chain(session: Session, mine: ColumnElement[bool], count: int) -> list[Any]:
    """Return a chain's last link, and the next numbers, drawn behind its lock: they rise in each chain."""
    link = select(AuditChain.sha256).where(mine)
    if session.get_bind().dialect.name == "sqlite":
        # its one writer
        sha256, number = session.execute(link.add_columns(_LAST_NUMBER)).one()
        return [sha256, *range(number + 1, number + 1 + count)]
    sha256 = session.scalars(link.with_for_update()).one()
    return [sha256, *session.scalars(_DRAWN_NUMBERS, {"count": count})]


def digest(entry: Mapping[str, Any]) -> str:
    """The hash of an entry: over its place, its content and the hash before it."""
    covered = {name: entry[name] for name in _COVERED} | {"at": entry["at"].isoformat()}
    return hashlib.sha256(json.dumps(covered, sort_keys=True).encode()).hexdigest()


def digest_value(value: Any) -> str:  # noqa: ANN401
    """The hash of what a column holds, as it comes back from either database."""
    kept = json.loads(json.dumps(_plain(value)))
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def digest_row(row: Base, names: Iterable[str]) -> str:
    columns = inspect(type(row)).columns
    return digest_value({name: _as_column_keeps(columns[name], getattr(row, name)) for name in names})


def name_part(row: Base) -> str:
    """Which part of its whole a row is: its key without the whole's."""
    return "/".join(map(str, inspect(row).mapper.primary_key_from_instance(row)[1:]))


def _as_column_keeps(column: Column[Any], value: Any) -> Any:  # noqa: ANN401
    # a whole number comes back from a column of floats as one, and a negative zero as zero
    return float(value) + 0.0 if isinstance(column.type, Float) and value is not None else value


def _entries_together(session: Session, rows: list[Any]) -> list[dict[str, Any]]:
    parts: dict[tuple[type[Base], str], list[Base]] = defaultdict(list)
    for row in rows:
        parts[type(row), str(inspect(row).mapper.primary_key_from_instance(row)[0])].append(row)
    entries = []
    for (kind, _), of_one in parts.items():
        # the columns are named, because a later version's table may have more
        names = sorted(attribute.key for attribute in inspect(kind).column_attrs)
        said = {"columns": names, "rows": {name_part(row): digest_row(row, names) for row in of_one}}
        entries.append(_named(session, of_one[0], "create", {}, said))
    return entries


def _entry(session: Session, row: Audited, verb: str) -> dict[str, Any]:
    return _named(session, row, verb, *_difference(row, verb))  # type: ignore[arg-type]


def _named(
    session: Session, row: Base, verb: str, before: dict[str, Any], after: dict[str, Any]
) -> dict[str, Any]:
    table = row.__tablename__
    key = inspect(row).mapper.primary_key_from_instance(row)
    return {
        "organisation_id": session.info["organisation_id"],
        "at": utc_now(),
        "actor": session.info["actor"],
        "action": f"{table}.{verb}",
        "subject_type": table,
        "subject_id": str(key[0]),
        "before": before,
        "after": after,
    }


def _difference(row: Audited, verb: str) -> tuple[dict[str, Any], dict[str, Any]]:
    state = inspect(row)
    names = [a.key for a in state.mapper.column_attrs if a.key not in row.__audit_without__]
    if verb == "create":
        return {}, _said(row, {name: getattr(row, name) for name in names if getattr(row, name) is not None})
    if verb == "delete":
        return _said(row, {name: getattr(row, name) for name in names}), {}
    changes = {name: state.attrs[name].history for name in names if state.attrs[name].history.has_changes()}
    before = {name: history.deleted[0] for name, history in changes.items() if history.deleted}
    after = {name: history.added[0] for name, history in changes.items() if history.added}
    keys = [state.mapper.get_property_by_column(column).key for column in state.mapper.primary_key]
    # the entry is named after the first part of the key: which of several rows it is, the others say
    which = {name: getattr(row, name) for name in keys[1:]}
    return _said(row, which | before), _said(row, which | after)


def _said(row: Audited, values: Mapping[str, Any]) -> dict[str, Any]:
    hashed = row.__audit_digests__
    said = {name: _plain(value) for name, value in values.items() if name not in hashed}
    return said | {f"{name}_sha256": digest_value(each) for name, each in values.items() if name in hashed}


def _plain(value: Any) -> Any:  # noqa: ANN401
    return value.isoformat() if isinstance(value, (date, datetime)) else value
