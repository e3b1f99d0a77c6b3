"""A road as a person states it: site, requirement, conditions, meters and control points."""

import math
from collections.abc import Collection
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import Acceptance
from radiometry.records import Record, about, later
from radiometry.spectral.lamps import LampKind

Kind = Literal["lane", "walkway", "edge"]
Surface = Literal["dry", "moist", "wet"]
Quantity = Literal["illuminance", "luminance"]
Unit = Literal["lx", "fc", "cd/m2", "fL"]
Figure = Literal["e_av", "e_min", "u_0", "average_to_min", "eir", "l_av", "u_o", "u_l", "f_ti"]

LANES = "lanes"
SI = {"lx": 1.0, "fc": 10.763910416709722, "cd/m2": 1.0, "fL": 3.4262590996353905}
UNCERTIFIED_U = 0.05
"""Relative standard uncertainty of a meter without a certificate."""

PLACES_M, LENGTHS_M, SHARES = (-10_000.0, 10_000.0), (0.1, 1_000.0), (0.001, 1.0)
_NEIGHBOURS = 4


class Row(Record):
    """Luminaires in one row along the road."""

    y_m: float = about("Place across, from the kerb [m].", within=PLACES_M)
    height_m: float = about("Height of the lamps above the road [m].", within=LENGTHS_M)
    spacing_m: float = about("Spacing of the luminaires along the road [m].", within=LENGTHS_M)
    first_x_m: float = about("Place of one of them along the road [m].", default=0.0, within=PLACES_M)


class Strip(Record):
    """A lane, a walkway or an edge: a strip along the road, over the whole field."""

    name: str = about("Name, unique on the site.")
    kind: Kind = about(
        '"lane"; "walkway"; or "edge", the strip beside the lanes whose light is compared with theirs.'
    )
    y_m: float = about("Nearer edge, from the kerb [m]; negative on the near side of it.", within=PLACES_M)
    width_m: float = about("Width [m].", within=LENGTHS_M)
    surface: str = about("Name of its pavement; those of one name reflect alike.", default="asphalt")


class Area(Record):
    """An area of any outline, such as an intersection."""

    name: str = about("Name, unique on the site.")
    corners_m: tuple[tuple[float, float], ...] = about("(x, y) of its corners in order [m].")
    surface: str = about("Name of its pavement; those of one name reflect alike.", default="asphalt")


class Origin(Record):
    """Place of a road's coordinates on the earth."""

    longitude_deg: float = about("Of x = 0, y = 0 [deg].", within=(-180.0, 180.0))
    latitude_deg: float = about("Of x = 0, y = 0 [deg].", within=(-89.0, 89.0))
    bearing_deg: float = about("Direction of x, clockwise from north [deg].", within=(-360.0, 360.0))
    y_to_the_right: bool = about("True if y grows to the right of x.", default=False)


class Site(Record):
    """Luminaires and surfaces of a stretch; x runs along the road and y across it, in metres.

    The field lies between two luminaires of the first row, from its `first_x_m` on.
    """

    rows: tuple[Row, ...] = about("Rows of luminaires; the field is one spacing of the first.")
    strips: tuple[Strip, ...] = about("Lanes, walkways and edges.", default=())
    areas: tuple[Area, ...] = about("Areas of any outline.", default=())
    origin: Origin | None = about("Place on the earth, if it is known.", default=None)
    receiver_m: float = about(
        "Least side of the rectangle over which the luminance of a point is read [m].",
        default=0.2,
        within=(0.01, 10.0),
    )

    @property
    def field_m(self) -> tuple[float, float]:
        """Begin and end of the field along the road [m]."""
        first = self.rows[0]
        return first.first_x_m, first.first_x_m + first.spacing_m

    @property
    def lanes(self) -> tuple[Strip, ...]:
        return tuple(sorted((s for s in self.strips if s.kind == "lane"), key=lambda each: each.y_m))

    def list_lamps(self) -> tuple[tuple[float, float, float], ...]:
        """Return place and height of the luminaires that light the field, (x, y, height) [m]."""
        return tuple(
            (row.first_x_m + n * row.spacing_m, row.y_m, row.height_m)
            for row in self.rows
            for n in range(-_NEIGHBOURS, _NEIGHBOURS + 2)
        )

    def find_surface(self, part: str) -> str:
        """Return the pavement of a lane, walkway, edge or area; inside an edge that of the lanes."""
        surfaces = {each.name: each.surface for each in self.strips}
        surfaces |= {each.name: each.surface for each in self.areas}
        return surfaces.get(part) or self.lanes[0].surface

    def measure_area(self, parts: Collection[str]) -> float:
        """Return the area of strips, over the field, and of areas [m2]."""
        low, high = self.field_m
        area = sum((high - low) * each.width_m for each in self.strips if each.name in parts)
        for each in self.areas:
            (x, y), (x1, y1) = np.array(each.corners_m).T, np.roll(each.corners_m, -1, axis=0).T
            area += abs(float(np.sum(x * y1 - x1 * y))) / 2.0 if each.name in parts else 0.0
        return area


class Criterion(Record):
    """One requirement on one figure."""

    figure: Figure = about("Figure that is required.")
    at_least: float | None = about("Lower limit, in the figure's unit.", default=None, within=(0.0, 1e6))
    at_most: float | None = about("Upper limit, in the figure's unit.", default=None, within=(0.0, 1e6))


class Requirement(Record):
    """Class of the road and how the verdict takes the uncertainty into account."""

    rule: str = about("Name of the rule, as `GET /v1/road-rules` lists it.")
    road_class: str = about('Class of the rule, such as "C3".')
    part: str = about('"lanes", or the name of a walkway or area.', default=LANES)
    decision: Acceptance = about(
        '"guarded": conforms from a probability of 95 % on; "simple": the uncertainty is ignored; '
        '"shared_risk": as simple, if the expanded uncertainty is at most `largest_u_rel`.',
        default="guarded",
    )
    largest_u_rel: float | None = about(
        "Largest accepted expanded uncertainty, as a share of the figure, agreed before the flight.",
        default=None,
        within=SHARES,
    )
    maintenance_factor: float | None = about(
        "Maintenance factor of the design, which turns measured values of new luminaires into maintained "
        "ones; None judges the road as found.",
        default=None,
        within=SHARES,
    )
    criteria: tuple[Criterion, ...] = about("Limits in place of those of the class.", default=())
    confirmed: str | None = about(
        "Who confirmed the figures of the rule against its text, and when.", default=None
    )


class Conditions(Record):
    """State of the road and its lamps at the flight; None for what is not known."""

    surface: Surface | None = about("State of the pavement.", default=None)
    lamp_kind: LampKind | None = about("Kind of the lamps.", default=None)
    mains_frequency_hz: float | None = about(
        "Of the supply [Hz]; 0 for direct current.", default=None, within=(0.0, 1_000.0)
    )
    power_w: float | None = about(
        "Electrical power of the luminaires of one spacing [W].", default=None, within=(0.1, 1e6)
    )
    reflectance: float | None = about(
        "Luminance factor of the pavement at nadir, where it is known.", default=None, within=(0.001, 2.0)
    )
    reflectance_u_rel: float = about("Its relative standard uncertainty.", default=0.15, within=SHARES)
    patches_u_rel: float = about(
        "Usual variation of the pavement from place to place.", default=0.05, within=SHARES
    )
    remarks: str | None = about(
        "Age of the lamps, climate, other light: as the report states them.", default=None
    )


class Meter(Record):
    """An illuminance or luminance meter at the control points."""

    meter_id: str | None = about("Its id; None of one behind K alone.", default=None)
    meter: str = about("Make, model and serial number; the same as behind K if it is the same instrument.")
    u_rel: float | None = about("Relative standard uncertainty by its certificate; None without one.")
    certificate: str | None = later("Number of its certificate.")

    @property
    def assumed_u_rel(self) -> float:
        return UNCERTIFIED_U if self.u_rel is None else self.u_rel


class ControlPoint(Record):
    """Readings of a meter at one place on the road."""

    name: str = about("Unique on the road.")
    x_m: float = about("Place along the road.", within=PLACES_M)
    y_m: float = about("Place across, from the kerb.", within=PLACES_M)
    quantity: Quantity = about("`luminance` is read from straight above.")
    unit: Unit = about("Of the readings.")
    values: tuple[float, ...] = about("Readings, repeated ones as often as they were taken.")
    meter_id: str | None = about("The meter; without it, without a certificate.", default=None)
    part: str | None = about("Lane, walkway or area on which it lies; else the nearest.", default=None)
    taken_at: str | None = about("RFC 3339.", default=None)
    left_out: str | None = about("Reason why a person left it out.", default=None)
    u_rel: float = about(
        "Relative standard uncertainty of one reading: level, place, repeat.", default=0.03, within=SHARES
    )

    @property
    def ln_values(self) -> NDArray[np.float64]:
        """Logarithms of the readings in lx or cd/m2."""
        return np.log(SI[self.unit] * np.array(self.values))

    @property
    def ln_mean(self) -> float:
        return float(self.ln_values.mean())

    @property
    def own_u(self) -> float:
        """Relative standard uncertainty of the mean; not below what the readings scatter."""
        return max(self.u_rel, float(self.ln_values.std()) / math.sqrt(max(len(self.values) - 1, 1)))


class Road(Record):
    """A road to be judged, with all that a person states of it."""

    site: Site
    requirement: Requirement
    conditions: Conditions = Conditions()
    control: tuple[ControlPoint, ...] = ()
    meters: tuple[Meter, ...] = ()
    hidden: tuple[str, ...] = about(
        "Names of grid points that a car or a tree hides, as a person marked them.", default=()
    )

    def find_meter(self, point: ControlPoint) -> Meter:
        """Return the meter of a control point; without a certificate if it is not among the road's."""
        known = {each.meter_id: each for each in self.meters}
        return known.get(point.meter_id) or Meter(meter=point.meter_id or "meter without name", u_rel=None)


class Scale(Record):
    """Uncertainty that all luminances share: that of K, and of what the frames share."""

    #: Relative standard uncertainty of the luminance, without the meter's part and the spectral mismatch
    u_rel: float
    meter: Meter | None = None  #: Behind K
    spectral_u_rel: float = 0.1  #: Relative standard uncertainty of the spectral mismatch
    lamp_kind: LampKind | None = None  #: Of the lamp that K was made with
    falls_off: bool = False  #: True where the falloff of the lens is not corrected

    @property
    def total_u_rel(self) -> float:
        meter = self.meter.assumed_u_rel if self.meter else 0.0
        return math.hypot(self.u_rel, meter, self.spectral_u_rel)
