"""Many rows at once: COPY on PostgreSQL, one prepared statement on SQLite, and no row objects on either."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Table, insert
from sqlalchemy.orm import Session

from store.tables import Base

Row = Mapping[str, Any]


def write_rows(session: Session, rows: Mapping[type[Base], Sequence[Row]]) -> None:
    """Add rows by table; those of one table name the same columns, and others take their defaults."""
    for each, of_table in rows.items():
        if of_table:
            _write(session, each.__table__, of_table)  # type: ignore[arg-type]


def _write(session: Session, table: Table, rows: Sequence[Row]) -> None:
    connection = session.connection()
    dialect = connection.dialect
    cells = []
    for column in table.columns:
        if column.name in rows[0]:
            values: Sequence[Any] = [row[column.name] for row in rows]
        elif column.default is not None:
            arg = column.default.arg  # type: ignore[attr-defined]
            values = [arg(None) if callable(arg) else arg for _ in rows]
        else:
            continue
        process = column.type.dialect_impl(dialect).bind_processor(dialect)
        cells.append((column.name, map(process, values) if process else values))
    names = [name for name, _ in cells]
    records = zip(*(values for _, values in cells), strict=True)
    driver: Any = connection.connection.cursor()
    if dialect.name == "sqlite":
        driver.executemany(str(insert(table).compile(dialect=dialect, column_keys=names)), records)
        return
    with driver.copy(f"COPY {table.name} ({', '.join(names)}) FROM STDIN") as copy:
        for record in records:
            copy.write_row(record)
