"""Rules for roads: classes and grids, as dated data that a requirement confirms or replaces."""

import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any

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
        Rule(**each | {"grid": GridRule(**each["grid"]), "classes": tuple(_read_classes(each["classes"]))})
        for each in stated["rule"]
    )


def _read_classes(stated: dict[str, list[list[Any]]]) -> Iterator[RoadClass]:
    for name, rows in stated.items():
        limits = ((figure, *(None if each == "" else float(each) for each in ends)) for figure, *ends in rows)
        criteria = (Criterion(figure=figure, at_least=low, at_most=high) for figure, low, high in limits)
        yield RoadClass(name=name, criteria=tuple(criteria))


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
