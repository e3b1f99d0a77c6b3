"""Is the audit trail whole, and do the rows stand as it says? ``python -m verify.audit [seq:hash]``.

Whoever can rewrite the database can recompute every hash: only a head that was noted elsewhere tells that.
"""

import argparse
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from heapq import merge
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, Date, collate, func, inspect, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from store import files, settings
from store.audit import digest_row, digest_value, name_part
from store.audit_check import Head, check_audit
from store.database import OTHER_SCHEMA_EXIT, Database, SchemaDiffers, require_own_schema, summarise
from store.tables import AuditEntry
from store.tables.base import Audited, AuditedTogether, Base, UtcDateTime, utc_now

_ROWS_AT_ONCE = 1000
_MISSING = object()
_Key = tuple[Any, ...]
_MOST_LINES = 20


@dataclass
class RowsReport:
    """Rows that are not as the trail says."""

    faults: list[str] = field(default_factory=list)
    compared: int = 0
    unrecorded: int = 0  # rows that the trail knows in part, as they are older than what it records today


def check_rows(database: Database) -> RowsReport:
    """Compare every audited row with its entries, in one snapshot."""
    report = RowsReport()
    with database.reading(snapshot=True) as session:
        tables: list[type[Base]] = [mapper.class_ for mapper in Base.registry.mappers]
        for table in sorted(tables, key=lambda each: each.__tablename__):
            if issubclass(table, Audited) or issubclass(table, AuditedTogether):
                _Comparison(session, table, report).run()
    return report


class _Comparison:
    """One table beside its entries: both in the order of their ids, so that neither is held as a whole."""

    def __init__(self, session: Session, table: type[Base], report: RowsReport) -> None:
        self._session, self._table = session, table
        self._name = table.__tablename__
        self._report = report
        self._columns = list(inspect(table).columns)
        mapper = inspect(table)
        self._first, *self._rest = (mapper.get_property_by_column(each).key for each in mapper.primary_key)
        self._recorded_from = session.scalar(
            select(func.min(AuditEntry.at)).where(AuditEntry.subject_type == self._name)
        )

    def run(self) -> None:
        """Walk through both; a row that was edited into something unreadable ends the walk."""
        try:
            self._walk()
        except (ValueError, TypeError) as error:
            self._report.faults.append(f"{self._name}: a row cannot be read, it was edited: {error}")

    def _walk(self) -> None:
        both = merge(self._rows(), self._entries(), key=itemgetter(0))
        for key, group in groupby(both, key=itemgetter(0)):
            found = [each for _, each in group]
            rows = [each for each in found if isinstance(each, self._table)]
            self._compare(key, rows, [each for each in found if not isinstance(each, self._table)])

    def _rows(self) -> Iterator[tuple[str, Any]]:
        (first, *_) = inspect(self._table).primary_key
        found = select(self._table).order_by(self._ordered(first))
        for row in self._session.scalars(found, execution_options={"yield_per": _ROWS_AT_ONCE}):
            self._session.expunge(row)
            yield str(getattr(row, self._first)), row

    def _entries(self) -> Iterator[tuple[str, Any]]:
        found = (
            select(AuditEntry.subject_id, AuditEntry.action, AuditEntry.before, AuditEntry.after)
            .where(AuditEntry.subject_type == self._name)
            .where(AuditEntry.action.in_([f"{self._name}.{verb}" for verb in ("create", "change", "delete")]))
            .order_by(self._ordered(AuditEntry.subject_id), AuditEntry.seq)
        )
        for entry in self._session.execute(found, execution_options={"yield_per": _ROWS_AT_ONCE}):
            yield entry.subject_id, entry

    def _ordered(self, column: Any) -> ColumnElement[Any]:  # noqa: ANN401  a column
        # as Python compares text, whatever the database's language
        return column if self._session.get_bind().dialect.name == "sqlite" else collate(column, "C")

    def _compare(self, subject_id: str, rows: list[Any], entries: list[Any]) -> None:
        self._report.compared += len(rows)
        if issubclass(self._table, AuditedTogether):
            self._compare_together(subject_id, rows, entries)
            return
        states = _replay(entries, self._rest)
        for row in rows:
            if (state := states.pop(tuple(getattr(row, name) for name in self._rest), None)) is None:
                self._miss(subject_id, row, has_entries=bool(states))
            else:
                self._differ(subject_id, row, state)
        for _ in states:
            self._fault(subject_id, "is missing: deleted without an entry")

    def _differ(self, subject_id: str, row: Any, state: "_State") -> None:  # noqa: ANN401
        partly = False
        for column in self._columns:
            name, value = column.key, getattr(row, column.key)
            if name in row.__audit_without__:
                continue
            if name in row.__audit_digests__:
                known = state.values.get(f"{name}_sha256", _MISSING)
                partly = partly or (known is _MISSING and value is not None)
                if known is not _MISSING and digest_value(value) != known:
                    self._fault(subject_id, f"{name} is not what the trail says: edited")
            elif type(said := state.values.get(name)) is type(value) and said == value:
                continue  # as nearly all are
            elif not any(_is_same(value, known, column) for known in state.candidates(name)):
                self._fault(subject_id, f"{name} is {value!r:.80}, the trail says {said!r:.80}: edited")
        self._report.unrecorded += partly

    def _compare_together(self, subject_id: str, rows: list[Any], entries: list[Any]) -> None:
        known: dict[str, tuple[str, list[str]]] = {}
        for _, _, _, after in entries:
            known |= {part: (digest, after["columns"]) for part, digest in after["rows"].items()}
        for row in rows:
            digest, names = known.pop(name_part(row), ("", []))
            if not digest:
                self._miss(subject_id, row, has_entries=bool(entries))
            elif digest_row(row, names) != digest:
                self._fault(f"{subject_id} {name_part(row)}", "is not what the trail says: edited")
        for part in known:
            self._fault(f"{subject_id} {part}", "is missing: deleted")

    def _miss(self, subject_id: str, row: Any, *, has_entries: bool) -> None:  # noqa: ANN401
        """A row without an entry: from before its table was recorded, or inserted by somebody."""
        recorded_late = issubclass(self._table, AuditedTogether) or self._name in _RECORDED_LATE
        is_older = self._recorded_from is None or _born(subject_id) < self._recorded_from
        if recorded_late and is_older and not has_entries:
            self._report.unrecorded += 1
        else:
            part = f" {name_part(row)}" if name_part(row) else ""
            self._fault(f"{subject_id}{part}", "has no entry: inserted without one")

    def _fault(self, subject_id: str, what: str) -> None:
        self._report.faults.append(f"{self._name} {subject_id}: {what}")


_RECORDED_LATE = frozenset({"extraction"})  # tables that were not audited from the first day on


@dataclass
class _State:
    values: dict[str, Any]
    perhaps: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    """What an entry says that may be about this row: early ones did not say which of several."""

    def candidates(self, name: str) -> list[Any]:
        return [self.values.get(name, _MISSING), *self.perhaps.get(name, ())]


def _replay(entries: list[Any], key: list[str]) -> dict[_Key, _State]:
    """The rows that the entries of one subject leave behind, by the rest of their key."""
    states: dict[_Key, _State] = {}
    for _, action, before, after in entries:
        verb = action.rpartition(".")[2]
        said = before if verb == "delete" else after
        if verb != "create" and not set(key) <= said.keys():
            for state in states.values():
                for name, value in after.items():
                    state.perhaps[name].append(value)
            continue
        which = tuple(said[name] for name in key)
        if verb == "delete":
            states.pop(which, None)
        else:
            states.setdefault(which, _State({})).values.update(after)
    return states


def _is_same(value: Any, known: Any, column: Any) -> bool:  # noqa: ANN401
    if known is _MISSING:
        # absent in an entry is None, or the default of a column that was added later
        default = column.default.arg if column.default is not None and column.default.is_scalar else _MISSING
        return value is None or value in ([], {}) or value == default
    if isinstance(value, datetime) and isinstance(column.type, UtcDateTime):
        return isinstance(known, str) and datetime.fromisoformat(known) == value
    if isinstance(value, date) and isinstance(column.type, Date):
        return bool(known == value.isoformat())
    return (type(value) is not bool and type(known) is not bool and value == known) or value is known


def _born(row_id: str) -> datetime:
    """When an id was made: it begins with the microseconds since 1970."""
    try:
        return datetime.fromtimestamp(int(row_id.partition("_")[2][:14], 16) / 1e6, UTC)
    except (ValueError, OverflowError, OSError):
        return utc_now()  # none of ours


def main(arguments: list[str] | None = None) -> int:
    """Check, print the head, give the exit code."""
    parser = argparse.ArgumentParser(prog="stilb-server audit", description=__doc__)
    parser.add_argument("head", nargs="?", type=_read_head, help="a head noted before, seq:hash")
    noted = parser.parse_args(arguments).head
    database = Database(settings.read_settings().effective_database_url, answer_within_s=None)
    try:
        if database.is_sqlite and not Path(database.url.database or "").is_file():
            return _fail(f"there is no database {database.url.database}; STILB_DATA names its folder")
        with database.reading() as session:
            # what another stilb wrote would be taken for changed or missing, or not be looked at
            require_own_schema(session)
        last, fault = check_audit(database, noted)
        rows = check_rows(database) if fault is None else RowsReport()
        with database.reading() as session:
            damaged = files.count_damaged(session)
    except SQLAlchemyError as error:
        code = OTHER_SCHEMA_EXIT if isinstance(error, SchemaDiffers) else 1
        return _fail(f"the audit trail cannot be read: {summarise(error)}", code)
    finally:
        database.dispose()
    if fault is not None:
        return _fail(f"the audit trail is broken at entry {fault.seq}: {fault.what}")
    if rows.faults:
        for line in rows.faults[:_MOST_LINES]:
            _fail(line)
        more = f", of which {_MOST_LINES} are named above" if len(rows.faults) > _MOST_LINES else ""
        return _fail(f"{len(rows.faults)} rows or fields are not as the audit trail left them{more}")
    for damage, count in damaged.items():
        _fail(f"stored files that are {damage}: {count}; the same upload heals each")
    if damaged:
        return 1
    print(f"the audit trail is whole: {last.entries} entries")  # noqa: T201
    print(f"the rows are as it left them: {rows.compared} compared")  # noqa: T201
    if rows.unrecorded:
        print(f"not covered: {rows.unrecorded} of them, or a part of each, are older than their record")  # noqa: T201
    later = f"`make audit HEAD={last}` or `stilb-server audit {last}` compares it later"
    print(f"head {last}\nNote the head elsewhere: {later}.")  # noqa: T201
    return 0


def _read_head(text: str) -> Head:
    if not re.fullmatch(r"\d{1,18}:[0-9a-f]{64}", text):
        raise argparse.ArgumentTypeError("a head looks like 123:<64 hexadecimal digits>")
    seq, _, sha256 = text.partition(":")
    return Head(seq=int(seq), sha256=sha256)


def _fail(message: str, code: int = 1) -> int:
    print(f"stilb: {message}", file=sys.stderr)  # noqa: T201
    return code


if __name__ == "__main__":
    sys.exit(main())
