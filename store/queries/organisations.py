"""Organisations, their keys, their cameras, meters and panels."""

import hashlib
import json
import secrets
from collections.abc import Collection
from datetime import datetime
from typing import Any, Final, TypeVar

from sqlalchemy import ColumnElement, Select, Text, and_, bindparam, cast, func, not_, select
from sqlalchemy.orm import Session

from radiometry.records import Record
from store.database import Database
from store.queries import add, update_where
from store.tables import (
    ApiKey,
    Base,
    Calibration,
    Camera,
    Meter,
    Organisation,
    Panel,
    UtcDateTime,
    WebSession,
    utc_now,
)

UNNAMED: Final = "an unnamed person"  # whoever acted with a key that states no person, as documents name them
UNNAMED_LABORATORY: Final = "Unnamed laboratory"
_FOUNDING_NAME: Final = "operator"  # of the operator's organisation until it states its own


class Person(Record, kw_only=False):
    """The person behind a key, as certificates name who fitted and who approved."""

    name: str
    role: str

    @classmethod
    def behind(cls, key: ApiKey | None) -> "Person | None":
        return cls(key.person, key.role) if key and key.person and key.role else None


def name_laboratory(organisation: Organisation) -> str:
    """Return an organisation's name as documents print it."""
    unstated = organisation.operator and organisation.name == _FOUNDING_NAME
    return UNNAMED_LABORATORY if unstated else organisation.name


def name_people(session: Session, organisation_id: str, *, unnamed: str | None = None) -> dict[str, str]:
    """Return the person of every key of an organisation, also of those that were revoked."""
    rows = session.execute(
        select(ApiKey.id, ApiKey.name, ApiKey.person).where(ApiKey.organisation_id == organisation_id)
    )
    return {row[0]: row[2] or unnamed or row[1] for row in rows}


def new_secret() -> str:
    return f"stilb_{secrets.token_urlsafe(32)}"


def create_key(
    session: Session,
    *,
    organisation_id: str,
    name: str,
    scopes: list[str],
    secret: str,
    expires_at: datetime | None = None,
    person: Person | None = None,
) -> ApiKey:
    key = ApiKey(organisation_id=organisation_id, name=name, scopes=scopes, expires_at=expires_at)
    key.person, key.role = (person.name, person.role) if person else (None, None)
    key.sha256 = hash_secret(secret)
    return add(session, key)


def find_key(session: Session, secret: str) -> tuple[ApiKey, Organisation] | None:
    """The key that is in force, and whose it is."""
    values = {"sha256": hash_secret(secret), "now": utc_now()}
    row = session.execute(_keys().where(IS_HOLDERS), values).first()
    return (row[0], row[1]) if row else None


class Holder(Record):
    """A key that is in force, as a request asks with it."""

    key_id: str
    key_name: str
    person: Person | None
    scopes: frozenset[str]
    organisation_id: str
    organisation_name: str
    operator: bool
    unnoted: bool = False  # it was not used for so long that this use is to be written down


async def find_holder(database: Database, secret: str, *, noted_since: datetime) -> Holder | None:
    """The same without a session, as most requests begin with it."""
    moments = {"now": utc_now(), "noted_since": noted_since}
    rows = await database.ask(_HOLDER, {"sha256": hash_secret(secret), **moments})
    if not rows:
        return None
    key_id, name, person, role, scopes, organisation_id, organisation_name, operator, unnoted = rows[0]
    return Holder(
        key_id=key_id,
        key_name=name,
        person=Person(person, role) if person and role else None,
        scopes=frozenset(json.loads(scopes)),
        organisation_id=organisation_id,
        organisation_name=organisation_name,
        operator=bool(operator),
        unnoted=bool(unnoted),
    )


def find_key_by_id(session: Session, key_id: str) -> tuple[ApiKey, Organisation] | None:
    row = session.execute(_keys().where(ApiKey.id == key_id, *_in_force())).first()
    return (row[0], row[1]) if row else None


class Who(Record, kw_only=False):
    """The right of a caller whose request lasts: a key, and the session of a browser."""

    key_id: str
    session_id: str | None


def find_in_force(session: Session, callers: Collection[Who]) -> set[Who]:
    """Return those whose key, and session if there is one, is still in force."""
    keys = select(ApiKey.id).where(ApiKey.id.in_({each.key_id for each in callers}), *_in_force())
    ids = {each.session_id for each in callers if each.session_id is not None}
    sessions = select(WebSession.id).where(WebSession.id.in_(ids), *is_open())
    valid = {*session.scalars(keys), *(session.scalars(sessions) if ids else ()), None}
    return {each for each in callers if {each.key_id, each.session_id} <= valid}


def find_ended_key(session: Session, secret: str) -> ApiKey | None:
    ended = not_(and_(*_in_force()))
    return session.scalar(select(ApiKey).where(ApiKey.sha256 == hash_secret(secret), ended))


def has_other_admin(session: Session, key: ApiKey) -> bool:
    """Return True if the organisation can manage its keys without this one."""
    mine = ApiKey.organisation_id == key.organisation_id
    scopes = session.scalars(select(ApiKey.scopes).where(mine, ApiKey.id != key.id, *_in_force()))
    return "admin" not in key.scopes or any("admin" in each for each in scopes)


def find_session_key(session: Session, session_id: str) -> tuple[WebSession, ApiKey, Organisation] | None:
    """A browser's session that has not ended, with the key that it was opened with."""
    row = session.execute(
        _keys()
        .add_columns(WebSession)
        .join(WebSession, WebSession.key_id == ApiKey.id)
        .where(WebSession.id == session_id, *is_open(), *_in_force())
    ).first()
    return (row[2], row[0], row[1]) if row else None


def is_open() -> tuple[ColumnElement[bool], ...]:
    return WebSession.ended_at.is_(None), WebSession.expires_at > utc_now()


def end_sessions(session: Session, key: ApiKey) -> None:
    for row in session.scalars(select(WebSession).where(WebSession.key_id == key.id, *is_open())):
        row.ended_at = utc_now()


def note_use(
    session: Session, table: type[ApiKey | WebSession], row_id: str, now: datetime, *, unless_after: datetime
) -> None:
    """Write down that a key or a session was used, unless another process has just done so."""
    known = table.last_used_at.is_(None) | (table.last_used_at < unless_after)
    update_where(session, table, (table.id == row_id) & known, last_used_at=now)


def ensure_operator(session: Session, secret: str, scopes: list[str]) -> None:
    """Found the operator's organisation and give it the bootstrap key, unless both exist."""
    if (operator := session.scalar(select(Organisation).where(Organisation.operator))) is None:
        operator = add(session, Organisation(name=_FOUNDING_NAME, operator=True))
    if session.scalar(select(ApiKey).where(ApiKey.sha256 == hash_secret(secret))) is None:
        create_key(session, organisation_id=operator.id, name="bootstrap", scopes=scopes, secret=secret)


def _keys() -> Select[ApiKey, Organisation]:
    return select(ApiKey, Organisation).join(Organisation, Organisation.id == ApiKey.organisation_id)


def _in_force(now: Any = None) -> tuple[ColumnElement[bool], ...]:  # noqa: ANN401  a time or a parameter
    lasts = ApiKey.expires_at > (utc_now() if now is None else now)
    return ApiKey.revoked_at.is_(None), ApiKey.expires_at.is_(None) | lasts


IS_HOLDERS: Final = and_(
    ApiKey.sha256 == bindparam("sha256"), *_in_force(bindparam("now", type_=UtcDateTime))
)
"""The condition of the key that is in force `now`, by its `sha256`."""
_HOLDER: Final = (
    _keys()
    .with_only_columns(
        *(ApiKey.id, ApiKey.name, ApiKey.person, ApiKey.role, cast(ApiKey.scopes, Text)),
        *(Organisation.id, Organisation.name, Organisation.operator),
        ApiKey.last_used_at.is_(None) | (ApiKey.last_used_at < bindparam("noted_since", type_=UtcDateTime)),
    )
    .where(IS_HOLDERS)
)


def hash_secret(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


Row = TypeVar("Row", bound=Base)


def find_or_add(
    session: Session, table: type[Row], organisation_id: str, values: dict[str, Any], *, by: Collection[str]
) -> tuple[Row, bool]:
    """The organisation's row with these values in the columns ``by``, and whether it is new."""
    found = find_alike(session, table, organisation_id, {name: values[name] for name in by})
    if found is not None:
        return found, False
    return add(session, table(organisation_id=organisation_id, **values)), True


def find_alike(session: Session, table: type[Row], organisation_id: str, same: dict[str, Any]) -> Row | None:
    """The organisation's row with these values, else one whose texts differ in capitals and outer blanks."""
    mine = select(table).filter_by(organisation_id=organisation_id)
    if (found := session.scalar(mine.filter_by(**same))) is not None:
        return found
    for name, value in same.items():
        column = getattr(table, name)
        is_text = isinstance(value, str)
        mine = mine.where(func.lower(func.trim(column)) == func.lower(value) if is_text else column == value)
    return session.scalar(mine.limit(1))


def find_or_add_camera(session: Session, organisation_id: str, values: dict[str, Any]) -> tuple[Camera, bool]:
    """The camera of this make, model and serial; what is stated of a known one's sensor fills its gaps."""
    by = ("make", "model", "serial")
    camera, is_new = find_or_add(session, Camera, organisation_id, values, by=by)
    for name in () if is_new else ("pixel_pitch_um", "sensor_width_mm"):
        if getattr(camera, name) is None:
            setattr(camera, name, values.get(name))
    session.flush()
    return camera, is_new


def find_or_add_meter(session: Session, organisation_id: str, values: dict[str, Any]) -> tuple[Meter, bool]:
    """The meter of this kind, make, model and serial; a certificate is taken over."""
    by = ("kind", "make", "model", "serial")
    meter, is_new = find_or_add(session, Meter, organisation_id, values, by=by)
    for name, value in () if is_new else values.items():
        if name.startswith("certificate_"):
            setattr(meter, name, value)
    session.flush()
    return meter, is_new


def find_or_add_panel(session: Session, organisation_id: str, values: dict[str, Any]) -> tuple[Panel, bool]:
    """The panel of this serial as measured on this day; new figures replace those that no version used."""
    panel, is_new = find_or_add(session, Panel, organisation_id, values, by=("serial", "measured_on"))
    if panel.bands != values["bands"]:
        fitted = select(Calibration.inputs["panels"]).where(Calibration.organisation_id == organisation_id)
        versions = session.scalars(fitted)
        used = {(each["serial"], each["measured_on"]) for panels in versions for each in panels or ()}
        if (panel.serial, panel.measured_on.isoformat()) not in used:
            panel.bands = values["bands"]
            session.flush()
    return panel, is_new
