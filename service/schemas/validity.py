"""Versions with the times for which they were in force."""

from service.schemas.base import Answer, Instant
from service.schemas.calibrations import Coefficient
from store.queries.calibrations import Lifetime
from store.tables import Publication


class Period(Answer, restates=Publication, fields="valid_from valid_to"):
    """A time [valid_from, valid_to); open without its end."""


class LifetimeAnswer(Answer):
    """A published version, as known at a time."""

    calibration_id: str
    version: int
    created_at: Instant
    coefficients: list[Coefficient]
    in_force: list[Period]
    revoked_from: list[Period]
    published_at: list[Instant]
    published_by: str
    published_by_name: str | None = None
    reason: str
    revoked_at: Instant | None = None
    revoked_by: str | None = None
    revoked_by_name: str | None = None
    revoked_reason: str | None = None

    @classmethod
    def of(cls, row: Lifetime, names: dict[str, str]) -> "LifetimeAnswer":
        last, end = row.published[-1], row.revocation
        return cls(
            calibration_id=row.calibration.id,
            version=row.calibration.version,
            created_at=row.calibration.created_at,
            coefficients=[Coefficient.model_validate(each) for each in row.coefficients],
            in_force=[Period.model_validate(each) for each in row.in_force],
            revoked_from=[Period.model_validate(each) for each in row.revoked_from],
            published_at=[act.publication.known_from for act in row.published],
            published_by=last.by,
            published_by_name=names.get(last.by),
            reason=last.publication.reason,
            revoked_at=end.revoked_at if end else None,
            revoked_by=end.revoked_by if end else None,
            revoked_by_name=names.get(end.revoked_by) if end else None,
            revoked_reason=end.reason if end else None,
        )


class ValidityAnswer(Answer):
    """Every version of a method that had been published by `known_at`, newest first."""

    known_at: Instant
    items: list[LifetimeAnswer]
