"""Do the rows stand as the audit trail says? Their entries are replayed and compared with what is there.

A row that was edited, inserted or deleted without an entry is found. Rows from before their content was
recorded (hashes of results, statistics, coefficients) are counted, and compared as far as the trail knows.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from itertools import groupby
from operator import itemgetter
from typing import Any

from sqlalchemy import ColumnElement, Date, collate, func, inspect, select
from sqlalchemy.orm import Session

from store.audit import digest_row, digest_value, name_part
from store.columns import UtcDateTime, utc_now
from store.database import Database
from store.tables import AuditEntry
from store.tables.base import Audited, AuditedTogether, Base

_PAGE = 1000
_MISSING = object()
_Key = tuple[Any, ...]


@dataclass
class RowsReport:
    """Rows that were compared, and what differs, in words."""

    faults: list[str] = field(default_factory=list)
    compared: int = 0
    unrecorded: int = 0
    """Rows that the trail knows only in part, because they are older than what it records today."""


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
        self._session = session
        self._table = table
        self._name = table.__tablename__
        self._report = report
        self._columns = list(inspect(table).columns)
        self._first, *self._rest = _key_names(table)
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
        rows, entries = self._rows(), self._entries()
        row, entry = next(rows, None), next(entries, None)
        while row is not None or entry is not None:
            if entry is None or (row is not None and row[0] < entry[0]):
                assert row is not None  # noqa: S101  narrows the type
                self._compare(*row, [])
                row = next(rows, None)
            elif row is None or entry[0] < row[0]:
                self._compare(entry[0], [], entry[1])
                entry = next(entries, None)
            else:
                self._compare(row[0], row[1], entry[1])
                row, entry = next(rows, None), next(entries, None)

    def _rows(self) -> Iterator[tuple[str, list[Any]]]:
        (first, *_) = inspect(self._table).primary_key
        found = self._session.scalars(
            select(self._table).order_by(self._ordered(first)), execution_options={"yield_per": _PAGE}
        )

        def rows() -> Iterator[tuple[str, Any]]:
            for row in found:
                yield str(getattr(row, self._first)), row
                self._session.expunge(row)

        for key, group in groupby(rows(), key=itemgetter(0)):
            yield key, [row for _, row in group]

    def _entries(self) -> Iterator[tuple[str, list[Any]]]:
        found = self._session.execute(
            select(AuditEntry.subject_id, AuditEntry.action, AuditEntry.before, AuditEntry.after)
            .where(AuditEntry.subject_type == self._name)
            .where(AuditEntry.action.in_([f"{self._name}.{verb}" for verb in ("create", "change", "delete")]))
            .order_by(self._ordered(AuditEntry.subject_id), AuditEntry.seq),
            execution_options={"yield_per": _PAGE},
        )
        for key, group in groupby(found, key=itemgetter(0)):
            yield key, list(group)

    def _ordered(self, column: Any) -> ColumnElement[Any]:  # noqa: ANN401  a column
        # as Python compares text, whatever the database's language
        return column if self._session.get_bind().dialect.name == "sqlite" else collate(column, "C")

    def _compare(self, subject_id: str, rows: list[Any], entries: list[Any]) -> None:
        self._report.compared += len(rows)
        if issubclass(self._table, AuditedTogether):
            self._compare_together(subject_id, rows, entries)
        else:
            self._compare_each(subject_id, rows, _replay(entries, self._rest))

    def _compare_each(
        self, subject_id: str, rows: list[Any], states: "dict[tuple[Any, ...], _State]"
    ) -> None:
        for row in rows:
            state = states.pop(tuple(getattr(row, name) for name in self._rest), None)
            if state is None:
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


_RECORDED_LATE = frozenset({"extraction"})
"""Tables that were not audited from the first day on."""


@dataclass
class _State:
    """State of a row by its entries."""

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
        return value is None or value in ([], {}) or value == _default(column)
    if isinstance(value, datetime) and isinstance(column.type, UtcDateTime):
        return isinstance(known, str) and datetime.fromisoformat(known) == value
    if isinstance(value, date) and isinstance(column.type, Date):
        return bool(known == value.isoformat())
    return (type(value) is not bool and type(known) is not bool and value == known) or value is known


def _default(column: Any) -> Any:  # noqa: ANN401
    return column.default.arg if column.default is not None and column.default.is_scalar else _MISSING


def _key_names(table: type[Base]) -> list[str]:
    mapper = inspect(table)
    return [mapper.get_property_by_column(column).key for column in mapper.primary_key]


def _born(row_id: str) -> datetime:
    """When an id was made: it begins with the microseconds since 1970."""
    try:
        return datetime.fromtimestamp(int(row_id.partition("_")[2][:14], 16) / 1e6, UTC)
    except (ValueError, OverflowError, OSError):
        return utc_now()  # none of ours
