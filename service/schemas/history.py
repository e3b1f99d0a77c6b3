"""Effect of a decision about a version."""

from typing import Any, Literal

from pydantic import Field

from radiometry.fitting.comparison import Comparison
from service.schemas.base import Answer, Instant, Quantity
from service.schemas.calibrations import CalibrationAnswer, Gap
from store.impact import CoefficientChange, Impact, Touched
from store.publications import InForce
from store.tables import Calibration, CoefficientRow


class VersionNamed(Answer):
    calibration_id: str
    version: int

    @classmethod
    def of(cls, row: Calibration) -> "VersionNamed":
        return cls(calibration_id=row.id, version=row.version)


class VersionInForce(VersionNamed):
    valid_from: Instant
    valid_to: Instant | None = None

    @classmethod
    def held(cls, held: InForce) -> "VersionInForce":
        return cls.restate(held.publication, held.calibration, calibration_id=held.calibration.id)


class TouchedMeasurement(Answer):
    """A measurement that was made with the version, and what its successor would make of it."""

    measurement_id: str
    frame_id: str
    filename: str
    taken_at: str | None = Field(default=None, description="As the frame says it.")
    iso: float | None = None
    successor: VersionNamed | None = Field(
        default=None, description="In force when the frame was taken. Absent where none is."
    )
    change: Quantity | None = Field(
        default=None, description="Of the luminance, L_new / L_old - 1, or of the reflectance; in %."
    )
    basis: Literal["signal", "k_ratio"] | None = Field(
        default=None,
        description="`signal`: both applied to the measured signal; `k_ratio`: K_old / K_new - 1.",
    )
    why: str | None = Field(default=None, description="Why there is no change to tell.")

    @classmethod
    def of(cls, row: Touched) -> "TouchedMeasurement":
        successor = VersionNamed.of(row.successor) if row.successor else None
        change = row.change if row.change and row.change.change else None
        said = {"measurement_id": row.measurement.id, "frame_id": row.frame.id, "why": row.why}
        return cls.restate(change, row.frame.header or {}, row.frame, successor=successor, **said)


class RevocationAnswer(CalibrationAnswer):
    """The version as it stands now, and the measurements that were made with it."""

    measurements: list[TouchedMeasurement]

    @classmethod
    def revoked(cls, answer: CalibrationAnswer, touched: list[Touched]) -> "RevocationAnswer":
        return cls(**dict(answer), measurements=[TouchedMeasurement.of(row) for row in touched])


class CoefficientChanged(
    Answer,
    restates=(CoefficientRow, Comparison),
    fields="name iso f_number band channel change in_standard_uncertainties",
):
    model: str | None = Field(default=None, description="The new one's; of sharpness it names the position.")
    old: Quantity
    new: Quantity
    difference: Quantity | None = Field(default=None, description="new - old. Absent where the units differ.")

    @classmethod
    def of(cls, row: CoefficientChange) -> "CoefficientChanged":
        return cls.restate(row, row.new, row.comparison)


class FlagAt(Answer):
    flag: str
    where: str = Field(description='"" for the whole.')


class ImpactAnswer(Answer):
    calibration_id: str
    version: int
    at: Instant
    said: str
    against: VersionInForce | None = Field(
        default=None, description="What is in force at that time. Absent where nothing is."
    )
    meter_calibration: Literal["common", "separate", "unknown"] | None = Field(
        default=None,
        description="`common`: both versions use the same meter certificates, whose error cancels in the "
        "comparison and is left out of its uncertainty; `separate`: they do not, and it counts in both; "
        "`unknown`: a reading has no certificate, and nothing is left out. Of reflectance the same of the "
        "panel: one panel of one day, another, or one that is not registered.",
    )
    coefficients: list[CoefficientChanged]
    isos_gained: list[float]
    isos_lost: list[float]
    flags_gained: list[FlagAt]
    flags_lost: list[FlagAt]
    measurements: list[TouchedMeasurement] = Field(
        description="Made with the version in force; what this one would make of each."
    )
    warnings: list[Gap] = Field(
        default=[], description="What its certificate would lack, published with your key."
    )

    @classmethod
    def of(cls, row: Calibration, at: Any, said: str, impact: Impact | None) -> "ImpactAnswer":  # noqa: ANN401
        named = {"calibration_id": row.id, "version": row.version, "at": at, "said": said}
        if impact is None:
            lists = ("coefficients", "isos_gained", "isos_lost", "flags_gained", "flags_lost", "measurements")
            return cls.restate(named, {name: [] for name in lists})
        return cls.restate(
            named,
            impact,
            against=VersionInForce.held(impact.against),
            coefficients=[CoefficientChanged.of(each) for each in impact.coefficients],
            flags_gained=[FlagAt(flag=flag, where=where) for flag, where in impact.flags_gained],
            flags_lost=[FlagAt(flag=flag, where=where) for flag, where in impact.flags_lost],
            measurements=[TouchedMeasurement.of(each) for each in impact.measurements],
        )
