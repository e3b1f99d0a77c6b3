"""CSV that a spreadsheet opens without running it, and CSV that spreadsheets write."""

import csv
import io
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import field
from functools import partial
from itertools import islice
from typing import Annotated, Any, Final, Generic, TypeVar

from fastapi import Request
from pydantic import Field, TypeAdapter, ValidationError

from radiometry.findings import interface
from radiometry.records import Record
from service.http.models import Form
from service.http.operations import NUMBER, read_apart, read_document, refuse_load
from service.http.problems import Problem, invalid, located, wrong

_STARTS: Final = "=+-@\t\r\n\uff1d\uff0b\uff0d\uff20"
"""What a formula begins with; the last four in East Asian spreadsheets."""
_RUNS: Final = re.compile(rf"(?:^|(?<=[;\t]))(?=[{re.escape(_STARTS)}])")
"""Where a spreadsheet would begin a formula, also one whose separator is another than ours."""


def keep_texts(texts: Sequence[str]) -> Sequence[str]:
    joined = "".join(texts)
    runs = not {text[:1] for text in texts}.isdisjoint(_STARTS) or ";" in joined or "\t" in joined
    return [_RUNS.sub("'", text) for text in texts] if runs else texts


def write_csv(
    rows: Iterable[Mapping[str, Any]], columns: list[str] | None = None, *, head: bool = True
) -> str:
    """Write rows under their names, lists as `<name>_count`, members as `<name>_<member>`; no text is run."""
    rows = [_flatten(row) for row in rows]
    names = columns or (list(rows[0]) if rows else [])
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    if head:
        writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(row.get(name)) for name in names])
    return out.getvalue()


def _flatten(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}_{member}": each for member, each in _flatten(value).items()}
        elif isinstance(value, list | tuple):
            flat[f"{name}_count"] = len(value)
        else:
            flat[name] = value
    return flat


def _cell(value: Any) -> Any:  # noqa: ANN401
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _RUNS.sub("'", value)
    # repr gives a float its shortest exact form
    return repr(value) if isinstance(value, float) else value


F = TypeVar("F", bound=Form)
T = TypeVar("T")

_TABLES: Final = frozenset({"text/csv", "application/csv"})  # the second is not registered, but much in use
UNREAD = ""
_MOST_COLUMNS: Final = 200

_GROUPED = re.compile(r"\d{1,3}(,\d{3})+")


class Kind(Record):
    """Content of a table: its columns of numbers, most rows, and what a row says that says nothing of it."""

    numbers: frozenset[str]
    most: int
    rows_are: str
    usual: Mapping[str, Any] = field(default_factory=dict)
    lists: Mapping[str, Sequence[str]] = field(default_factory=dict)  # fields, with the columns each gathers
    known: Sequence[str] = ()  # columns under the names of the fields
    needed: Collection[str] = ()

    def require(self, columns: list[str]) -> list[str]:
        """Refuse a table that lacks a needed column, or has one that is not known or named twice."""
        if set(self.needed) <= set(columns) <= set(self.known) and len(set(columns)) == len(columns):
            return columns
        words = f"columns of {', '.join(self.known)}, each at most once"
        if self.needed:
            optional = [name for name in self.known if name not in self.needed]
            words = f"each of the columns {', '.join(self.needed)} once, and may name {', '.join(optional)}"
        raise refuse_columns(f"must name {words}", columns)


def read_sheet(
    data: bytes, form: type[F], kind: Kind, name_fields: Callable[[list[str]], list[str]] | None = None
) -> list[F]:
    """Read comma, or semicolon or tab with decimal comma; `name_fields`: of columns in small letters."""
    refuse_load(data, *",;\t\r\n")
    try:
        text = data.decode("utf-8-sig")
        # the separator is the one of the first line; a lone CR ends a line too
        separator = max(",;\t", key=re.split(r"[\r\n]", text, maxsplit=1)[0].count)
        reader = csv.DictReader(io.StringIO(text, newline=None), delimiter=separator)
        columns = [name.strip().lower() for name in (reader.fieldnames or [])[: _MOST_COLUMNS + 1]]
        if len(columns) > _MOST_COLUMNS:
            raise refuse_columns(f"must name at most {_MOST_COLUMNS} columns", columns)
        reader.fieldnames = (name_fields or kind.require)(columns)
        return _read_rows(reader, separator, form, kind)
    except UnicodeDecodeError as error:
        raise Problem(interface.BAD_REQUEST, "The CSV is not UTF-8. Save it as CSV UTF-8.") from error
    except csv.Error as error:
        raise Problem(interface.BAD_REQUEST, f"The CSV cannot be read: {error}.") from error


async def read_sheet_or_document(
    request: Request, read: Callable[[bytes], T], validate: Callable[[Any], T]
) -> T:
    """Read a body that is a table or JSON, by its content type; each bad field or row is named."""
    if is_table(request):
        return await read_apart(request, read)
    advice = " A table is sent with Content-Type: text/csv."
    return await read_apart(request, partial(read_document, validate=validate, advice=advice))


def state_body(schema: dict[str, Any], **more: Any) -> dict[str, Any]:  # noqa: ANN401  what JSON holds
    """Document a body that is JSON or a table."""
    content = {"application/json": {"schema": schema, **more}, "text/csv": {"schema": {"type": "string"}}}
    return {"requestBody": {"required": True, "content": content}}


class OneOrMany(Generic[F]):
    """A body that is one object, a list of them or a table; each bad field is named with its place."""

    def __init__(self, form: type[F], kind: Kind) -> None:
        schema = form.model_json_schema()
        several = {"type": "array", "items": schema, "minItems": 1, "maxItems": kind.most}
        self.stated = state_body({"oneOf": [schema, several]})
        self._one: TypeAdapter[F] = TypeAdapter(form)
        self._many: TypeAdapter[list[F]] = TypeAdapter(
            Annotated[list[form], Field(min_length=1, max_length=kind.most)]  # type: ignore[arg-type, valid-type]
        )
        self._read = partial(read_sheet, form=form, kind=kind)

    async def __call__(self, request: Request) -> list[F] | F:
        return await read_sheet_or_document(request, self._read, self._validate)

    def _validate(self, data: Any) -> list[F] | F:  # noqa: ANN401  whatever JSON holds
        return (self._many if isinstance(data, list) else self._one).validate_python(data)


def is_table(request: Request) -> bool:
    return request.headers.get("content-type", "").split(";")[0].strip().lower() in _TABLES


def refuse_columns(message: str, columns: list[str]) -> Problem:
    named = f"it names {', '.join(map(repr, columns))[:200] or 'nothing'}"
    return wrong("line 1", f"{message}; {named}")


def _read_rows(reader: "csv.DictReader[str]", separator: str, form: type[F], kind: Kind) -> list[F]:
    forms: list[F] = []
    errors: list[dict[str, Any]] = []
    rows = 0
    for rows, row in enumerate(islice(reader, kind.most + 1), start=1):  # noqa: B007  it counts them
        line = f"line {reader.line_num}"
        if None in row:
            message = "has more cells than line 1 names; a decimal comma needs semicolons between the cells"
            errors.append({"type": "csv", "loc": (line,), "msg": message})
            continue
        cells: dict[str, Any] = {name: cell.strip() for name, cell in row.items() if cell and cell.strip()}
        cells.pop(UNREAD, None)
        for name in kind.numbers & cells.keys():
            cells[name] = _read_number(cells[name], separator)
        filled = {name: [each for each in columns if each in cells] for name, columns in kind.lists.items()}
        lists = {name: [cells.pop(each) for each in columns] for name, columns in filled.items() if columns}
        try:
            forms.append(form.model_validate({**kind.usual, **cells, **lists}))
        except ValidationError as error:
            for found in located(error, line):
                name, *index = found["loc"][1:] or [""]
                if name in kind.lists:
                    found["loc"] = (line, (filled[name] or kind.lists[name])[sum(index)])
                errors.append(found)
    if not 0 < rows <= kind.most:
        message = f"must hold 1 to {kind.most} {kind.rows_are} below its first line"
        errors = [{"type": "csv", "loc": ("csv",), "msg": message}]
    if errors:
        raise invalid(errors)
    return forms


def _read_number(text: str, separator: str) -> float | str:
    """The number, or the text as it is for the form to refuse."""
    # after tabs 1,234 may be a thousand and more, or one and a bit: nobody can tell
    if separator == ";" or (separator == "\t" and not _GROUPED.fullmatch(text)):
        text = text.replace(",", ".")
    return float(text) if NUMBER.fullmatch(text) else text
