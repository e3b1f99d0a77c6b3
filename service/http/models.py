"""Types and base classes shared by all forms and answers."""

import dataclasses
import inspect
import re
import types
import typing
import unicodedata
from collections.abc import Iterable, Mapping
from datetime import date, datetime
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

import pydantic
from fastapi.responses import JSONResponse
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Strict, StringConstraints
from pydantic.config import JsonDict, JsonValue
from pydantic_core import PydanticCustomError
from sqlalchemy.orm import Mapped

from radiometry.findings.grouping import FindingGroup, Occurrence, group_findings
from radiometry.fitting import evidence
from radiometry.frame.multispectral import name_band
from radiometry.methods import METHODS
from radiometry.methods.findings import FINDINGS
from radiometry.specification.roles import ROLES
from service.http.problems import LINES, NAMED, SHA256, WRITTEN
from store.queries.frame_times import name_zone
from store.tables import Base


def _name_zone(text: str) -> str:
    try:
        return name_zone(text)
    except ValueError as error:
        raise PydanticCustomError("time_zone", "{said}", {"said": str(error)}) from error


COMPOSED: Final = AfterValidator(partial(unicodedata.normalize, "NFC"))
"""A name is the same however its letters are put together: macOS writes an accent apart, keyboards do not."""
Text = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=f"^{NAMED}$"), COMPOSED]
Name = Annotated[Text, AfterValidator(lambda text: " ".join(text.split()))]
"""A name without the blanks that nobody sees: around it, and more than one between its words."""
_LINE_FEEDS: Final = AfterValidator(lambda text: text.replace("\r\n", "\n").replace("\r", "\n"))
"""Lines end as they are stored and printed, whichever machine they were written on."""
LongText = Annotated[str, StringConstraints(min_length=1, max_length=10_000, pattern=LINES), _LINE_FEEDS]
Reason = Annotated[str, StringConstraints(min_length=1, max_length=10_000, pattern=WRITTEN), _LINE_FEEDS]
CurveText = Annotated[str, StringConstraints(min_length=1, max_length=50_000, pattern=LINES), _LINE_FEEDS]
"""A name, or a table of several lines."""
Clearable = Annotated[str, StringConstraints(max_length=200, pattern=f"^({NAMED})?$"), COMPOSED]
ClearableLong = Annotated[str, StringConstraints(max_length=10_000, pattern=LINES), _LINE_FEEDS]
"""A correction: "" takes away what was written."""
TimeZone = Annotated[Text, AfterValidator(_name_zone), Field(examples=["Europe/Berlin", "+02:00"])]
ClearableZone = Annotated[Clearable, AfterValidator(lambda text: text and _name_zone(text))]
# as a camera, a data sheet or a person writes it
BandName = Annotated[Text, AfterValidator(name_band)]
_MOST_UNKNOWN: Final = 3  # names of one object that are named one by one
EACH_ONCE: Final[JsonDict] = {"uniqueItems": True}

Sha256 = Annotated[str, StringConstraints(pattern=SHA256)]


def _refuse_twice(camera_ids: list[str]) -> list[str]:
    if len(set(camera_ids)) < len(camera_ids):
        raise ValueError("names a camera twice")
    return camera_ids


CameraIds = Annotated[
    list[Text], Field(min_length=2, json_schema_extra=EACH_ONCE), AfterValidator(_refuse_twice)
]


# in a body a number is a number: neither true nor "5"
Number = Annotated[float, Strict()]
Flag = Annotated[bool, Strict()]
WHOLE: Final = BeforeValidator(
    lambda sent: int(sent) if isinstance(sent, float) and sent.is_integer() else sent
)
"""Of a strict int, after its range: JSON Schema counts 5.0 among the whole numbers."""
Positive = Annotated[Number, Field(gt=0, lt=1e9)]
PositiveText = Annotated[float, Field(gt=0, lt=1e9)]  # the same in an address, where everything is text
PixelPitch = Annotated[Number, Field(ge=0.1, le=100, description="Distance of neighbouring pixels.")]

if TYPE_CHECKING:
    Method = str
    FrameRole = str
else:
    Method = Literal[tuple(spec.name for spec in METHODS)]
    FrameRole = Literal[tuple(role.name for role in ROLES)]

_ISO_DAY = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
_LOST_PLUS = re.compile(r"(T[\d:.]+) (\d\d:?\d\d)$", re.ASCII)  # an address whose "+" was not escaped


def _is_written_out(value: Any) -> Any:  # noqa: ANN401
    # pydantic would take 5 and "5" as seconds since 1970
    if isinstance(value, str) and _ISO_DAY.match(value):
        return _LOST_PLUS.sub(r"\1+\2", value)
    if isinstance(value, date):
        return value
    raise PydanticCustomError("written_out", "must begin with a date such as 2026-05-01")


def rfc3339(instant: datetime) -> str:
    return instant.isoformat().replace("+00:00", "Z")


def _year_is_plausible(instant: datetime) -> datetime:
    # conversions to UTC overflow at the calendar's ends
    if not 1900 <= instant.year <= 9000:
        raise PydanticCustomError("year", "the year must lie between 1900 and 9000")
    return instant


Instant = Annotated[
    pydantic.AwareDatetime,
    BeforeValidator(_is_written_out),
    AfterValidator(_year_is_plausible),
    pydantic.PlainSerializer(rfc3339, when_used="json"),
    pydantic.WithJsonSchema(
        {"type": "string", "format": "date-time", "pattern": "^(19[0-9]{2}|[2-8][0-9]{3}|9000)-"},
        mode="validation",
    ),
    pydantic.WithJsonSchema({"type": "string", "format": "date-time"}, mode="serialization"),
]
Day = Annotated[date, BeforeValidator(_is_written_out)]


def told(sentence: str, **more: Any) -> Any:  # noqa: ANN401  as pydantic's
    return Field(description=sentence, **more)


def maybe(sentence: str, **more: Any) -> Any:  # noqa: ANN401  as pydantic's
    return told(sentence, default=None, **more)


class Form(BaseModel):
    """Request body: unknown fields, null and numbers that are none are refused by name.

    ``class NewCause(Form, one_of="meter_id software")`` : exactly one of these fields is given.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)
    _one_of: typing.ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, *, one_of: str = "", **config: Any) -> None:  # noqa: ANN401
        super().__init_subclass__(**config)
        if one_of:
            cls._one_of = tuple(one_of.split())
            needed: list[JsonValue] = [{"required": [name]} for name in cls._one_of]
            cls.model_config = cls.model_config | ConfigDict(json_schema_extra={"oneOf": needed})

    def check(self) -> None:
        """Raise a ValueError for what no field is alone at fault."""

    @pydantic.model_validator(mode="after")
    def _check_all(self) -> typing.Self:
        if self._one_of and sum(getattr(self, name) is not None for name in self._one_of) != 1:
            *others, last = self._one_of
            raise ValueError(f"give either {', '.join(others)} or {last}")
        self.check()
        return self

    @pydantic.model_validator(mode="before")
    @classmethod
    def _refuse_names(cls, value: Any) -> Any:  # noqa: ANN401
        if not isinstance(value, dict):
            return value
        if len(value) > len(cls.model_fields) + _MOST_UNKNOWN:
            # one error for all: a document of such objects would make more of them than memory holds
            names = sorted(value.keys() - cls.model_fields.keys())
            said = ", ".join(name[:40] for name in names[:10])
            message = "has {count} names that are not known here, such as {said}"
            raise PydanticCustomError("names", message, {"count": len(names), "said": said})
        if names := [name for name, member in value.items() if member is None]:
            raise PydanticCustomError("null", "null is not a value here; leave it out", {"names": names})
        return value


class Period(Form):
    """A query of what lies between times: turned round, it would be empty without a word."""

    def check(self) -> None:
        for first, last in (("start", "end"), ("computed_from", "computed_to")):
            since, until = getattr(self, first, None), getattr(self, last, None)
            if since is not None and until is not None and since > until:
                named = [type(self).model_fields[each].alias or each for each in (first, last)]
                raise ValueError(f"{named[0]} is later than {named[1]}, so that nothing lies between them")


class Answer(BaseModel):
    """Answer of the service: what is absent is left out, never null.

    An answer that restates a dataclass or a table names it, and takes the types of its fields and their
    sentences from there: ``class TurnAnswer(Answer, restates=Turn)``. Of a table ``fields`` names the columns
    that are answered, so that no new column is published unseen. A field that the answer states itself takes
    the place of the one of that name.
    """

    model_config = ConfigDict(allow_inf_nan=False, from_attributes=True)

    def __init_subclass__(
        cls,
        *,
        restates: type | tuple[type, ...] = (),
        fields: str | None = None,
        without: str = "",
        **config: Any,  # noqa: ANN401
    ) -> None:
        super().__init_subclass__(**config)
        sources = restates if isinstance(restates, tuple) else (restates,)
        own = inspect.get_annotations(cls)
        stated: dict[str, Any] = {}
        for source in sources:
            if fields is None and answered_as.setdefault(source, cls) is not cls:
                raise TypeError(f"{source.__name__} is answered as {answered_as[source].__name__} already")
            hints, sentences = get_type_hints(source), describe_fields(source)
            for name in hints if fields is None else fields.split():
                if name in hints and name not in {*own, *stated, *without.split()}:
                    kind = _as_answered(hints[name])
                    stated[name] = Annotated[kind, Field(description=sentences.get(name))]
                    if type(None) in get_args(kind):
                        setattr(cls, name, None)
        cls.__annotations__ = stated | own

    @classmethod
    def restate(cls, *sources: Any, **said: Any) -> typing.Self:  # noqa: ANN401
        """Take each field from what is said here, else from the first source that has it."""
        for source in sources:
            for name in cls.model_fields.keys() - said.keys():
                if isinstance(source, Mapping):
                    if name in source:
                        said[name] = source[name]
                elif hasattr(source, name):
                    said[name] = getattr(source, name)
        return cls.model_validate(said)

    def dump(self) -> dict[str, Any]:
        return self.model_dump(mode="json", exclude_none=True)

    def respond(self, headers: dict[str, str] | None = None) -> JSONResponse:
        """As it is: sent through a response model it would come out with its nulls."""
        return JSONResponse(self.dump(), headers=headers)

    def keep(self) -> dict[str, Any]:
        """Return what may be stored, to be given again to the same request: all, unless it tells a secret."""
        return self.dump()


answered_as: dict[Any, Any] = {datetime: Instant, date: Day}
"""What a type of the science or the store is answered as."""


def model_of(record: type, base: type[BaseModel]) -> Any:  # noqa: ANN401  a model made at run time
    """Return a record, and those inside, as forms or answers; what has a default may be left out."""
    is_form = issubclass(base, Form)
    if not is_form and record in answered_as:
        return answered_as[record]
    if (record, base) not in _made:
        hints, sentences = get_type_hints(record), describe_fields(record)
        stated: dict[str, Any] = {}
        for each in dataclasses.fields(record):
            kind, sentence = _as_model(hints[each.name], base), sentences.get(each.name)
            has_default = not each.default is each.default_factory is dataclasses.MISSING
            needed = not (has_default or (type(None) in get_args(kind) and not is_form))
            limits = dict(zip(("ge", "le"), each.metadata.get("within", ()), strict=False)) if is_form else {}
            stated[each.name] = (
                (kind, Field(description=sentence, **limits))
                if needed
                else (kind | None, maybe(sentence or "", **limits))
            )
        room = record.__module__.split(".")[1].capitalize()
        own = f"{room}{record.__name__.removeprefix(room)}"
        name = f"New{own}" if is_form else f"{own}Answer"
        _made[record, base] = pydantic.create_model(name, __base__=base, __doc__=record.__doc__, **stated)
    return _made[record, base]


_MOST_ITEMS: Final = 1000
_SENT: Final[dict[Any, Any]] = {
    float: Number,
    int: Annotated[int, Strict(), WHOLE],
    str: Text,
    bool: Flag,
    datetime: Instant,
}
_made: dict[tuple[type, type], Any] = {}


def _as_model(kind: Any, base: type[BaseModel]) -> Any:  # noqa: ANN401
    """Return the type of a model's field for a type of a record's."""
    origin, parts = get_origin(kind), get_args(kind)
    if dataclasses.is_dataclass(kind):
        return model_of(kind, base)  # type: ignore[arg-type]
    if origin in {Union, types.UnionType}:
        return Union[tuple(_as_model(part, base) for part in parts)]  # noqa: UP007
    if origin is tuple:
        least, most = (0, _MOST_ITEMS) if parts[-1] is ... else (len(parts), len(parts))
        return Annotated[list[_as_model(parts[0], base)], Field(min_length=least, max_length=most)]  # type: ignore[misc]
    if origin is Mapping or (parts and not isinstance(origin, type)):
        return kind
    return _SENT.get(kind, kind) if issubclass(base, Form) else answered_as.get(kind, kind)


def describe_fields(source: type) -> dict[str, str]:
    """Return the sentence of each field that has one: in its metadata, or of its column."""
    if issubclass(source, Base):
        return {each.key: each.doc for each in source.__table__.columns if each.doc}
    stated = dataclasses.fields(source) if dataclasses.is_dataclass(source) else ()
    return {each.name: each.metadata["description"] for each in stated if "description" in each.metadata}


def _as_answered(kind: Any) -> Any:  # noqa: ANN401
    """Return the type that is answered for a type: of what is restated itself its answer."""
    origin, parts = get_origin(kind), tuple(map(_as_answered, get_args(kind)))
    if kind in answered_as:
        return answered_as[kind]
    if origin in {None, Literal}:
        return kind
    if origin is Mapped:
        return parts[0]
    if origin in {Union, types.UnionType}:
        return Union[parts]  # noqa: UP007  its members are known at run time only
    return list[parts[0]] if parts[-1:] == (...,) else origin[parts]  # type: ignore[valid-type]


class Quantity(Answer, restates=evidence.Quantity):
    """A reported figure with its uncertainty and unit."""

    value: float
    standard_uncertainty: float = Field(ge=0)
    unit: str


class ProblemAnswer(BaseModel):
    """RFC 9457, with a stable code and whether trying again can help."""

    model_config = ConfigDict(extra="allow")

    type: str
    title: str
    status: int
    detail: str
    code: str
    retryable: bool


class FindingGroupAnswer(Answer, restates=FindingGroup, without="values"):
    """Equal findings as one."""

    values: dict[str, Any] = Field(
        description="Numbers by name, a list each in the order of `subjects`; `detail` where what was found "
        "differs."
    )


def group_flags(raised: Iterable[Mapping[str, Any]]) -> list[FindingGroupAnswer]:
    groups = group_findings(
        Occurrence(
            finding=FINDINGS[each["flag"]], severity="warn", subject=each["where"], detail=each["detail"]
        )
        for each in raised
    )
    return [FindingGroupAnswer.restate(group) for group in groups]
