"""Rules for roads: classes and grids, as dated data that a requirement confirms or replaces."""

import tomllib
from functools import cache
from importlib.resources import files

from radiometry.records import Record, about
from radiometry.road import codes
from radiometry.road.site import Criterion, Requirement


class GridRule(Record):
    """Number of points along and across."""

    fewest_along: int = about("Fewest points along the field.")
    widest_along_m: float = about("Largest spacing along [m].")
    fewest_across: int = about("Fewest points across a lane or a walkway.")
    widest_across_m: float = about("Largest spacing across [m].")


class RoadClass(Record):
    """A class and its criteria."""

    name: str = about('Name, such as "C3".')
    criteria: tuple[Criterion, ...] = about("Its requirements.")


class Rule(Record):
    """Classes and grid of one edition of a standard."""

    name: str = about("Name and edition.")
    date: str = about("Date of the edition.")
    source: str = about("Where the figures were read.")
    read: str = about("Which figures were seen in the source, and which are from memory.")
    grid: GridRule = about("Points of the grid.")
    classes: tuple[RoadClass, ...] = about("Classes, the strictest first.")


@cache
def list_rules() -> tuple[Rule, ...]:
    """Return the rules of the library."""
    stated = tomllib.loads(files(__package__).joinpath("rules.toml").read_text("utf-8"))
    return tuple(
        Rule(
            **{name: each[name] for name in ("name", "date", "source", "read")},
            grid=GridRule(**each["grid"]),
            classes=tuple(
                RoadClass(name=name, criteria=tuple(_read_criterion(*row) for row in rows))
                for name, rows in each["classes"].items()
            ),
        )
        for each in stated["rule"]
    )


def find_rule(name: str) -> Rule:
    """Return the rule of a name.

    Parameters
    ----------
    name : str
        Name, as `list_rules` has it.
    """
    for rule in list_rules():
        if rule.name == name:
            return rule
    raise codes.ROAD_RULE_UNKNOWN.refuse(f"There is no rule {name!r}.")


def find_criteria(requirement: Requirement) -> tuple[Criterion, ...]:
    """Return the limits that a requirement states, else those of its class.

    Parameters
    ----------
    requirement : Requirement
        Rule, class and limits.
    """
    if requirement.criteria:
        return requirement.criteria
    for each in find_rule(requirement.rule).classes:
        if each.name == requirement.road_class:
            return each.criteria
    raise codes.ROAD_RULE_UNKNOWN.refuse(f"{requirement.rule} has no class {requirement.road_class!r}.")


def _read_criterion(figure: str, at_least: float | str, at_most: float | str) -> Criterion:
    low, high = (None if limit == "" else float(limit) for limit in (at_least, at_most))
    return Criterion(figure=figure, at_least=low, at_most=high)  # type: ignore[arg-type]
