"""Organisations and their keys. A key is 256 random bits: its plain hash is safe to keep."""

import hashlib
import secrets

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from store.tables import ApiKey, Organisation


def new_secret() -> str:
    return f"stilb_{secrets.token_urlsafe(32)}"


def create_key(
    session: Session, *, organisation_id: str, name: str, scopes: list[str], secret: str
) -> ApiKey:
    key = ApiKey(organisation_id=organisation_id, name=name, scopes=scopes, sha256=_hash(secret))
    session.add(key)
    session.flush()
    return key


def find_key(session: Session, secret: str) -> tuple[ApiKey, Organisation] | None:
    """The key that has not been revoked, and whose it is."""
    return _find(session, ApiKey.sha256 == _hash(secret))


def find_key_by_id(session: Session, key_id: str) -> tuple[ApiKey, Organisation] | None:
    """The same, for a session that was opened with the key."""
    return _find(session, ApiKey.id == key_id)


def ensure_operator(session: Session, secret: str, scopes: list[str]) -> None:
    """Found the operator's organisation and give it the bootstrap key, unless both exist."""
    operator = session.scalar(select(Organisation).where(Organisation.operator))
    if operator is None:
        operator = Organisation(name="operator", operator=True)
        session.add(operator)
        session.flush()
    if session.scalar(select(ApiKey).where(ApiKey.sha256 == _hash(secret))) is None:
        create_key(session, organisation_id=operator.id, name="bootstrap", scopes=scopes, secret=secret)


def _find(session: Session, named: ColumnElement[bool]) -> tuple[ApiKey, Organisation] | None:
    row = session.execute(
        select(ApiKey, Organisation)
        .join(Organisation, Organisation.id == ApiKey.organisation_id)
        .where(named, ApiKey.revoked_at.is_(None))
    ).first()
    return (row[0], row[1]) if row else None


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
