"""Verdicts on a road in words, from an evaluation as it is answered."""

from typing import Any, Final

from radiometry.drawing.text import in_step

Node = dict[str, Any]

FIGURES: Final = {
    "e_av": ("Average", "E_av", " lx"),
    "e_min": ("Minimum", "E_min", " lx"),
    "u_0": ("Uniformity", "U_0", ""),
    "average_to_min": ("Average to minimum", "E_av/E_min", ""),
    "eir": ("Edge illuminance ratio", "EIR", ""),
    "pdi": ("Power density", "D_P", " mW/(lx·m²)"),
    "l_av": ("Average luminance", "L_av", " cd/m²"),
    "u_o": ("Overall uniformity", "U_o", ""),
    "u_l": ("Longitudinal uniformity", "U_l", ""),
    "f_ti": ("Threshold increment", "f_TI", " %"),
}
"""Name, sign and unit."""
VERDICTS: Final = {
    "conforms": "conforms",
    "does_not": "does not conform",
    "not_decided": "not decided",
    "not_measured": "not measured",
}
NONE: Final = "-"


def write_limit(criterion: Node, *, short: bool = False) -> str:
    """Return the limits of a criterion with their unit, after its sign unless ``short``."""
    _, sign, unit = FIGURES[criterion["figure"]]
    limits = (("≥", "at_least"), ("≤", "at_most"))
    said = ", ".join(f"{mark} {criterion[name]:g}{unit}" for mark, name in limits if name in criterion)
    return said if short else f"{sign} {said}"


def write_probability(share: float | None) -> str:
    """Return a probability in whole per cent."""
    if share is None:
        return NONE
    return "> 99 %" if share > 0.99 else "< 1 %" if share < 0.01 else f"{share:.0%}".replace("%", " %")


def write_prospect(criterion: Node, prospect: Node) -> tuple[str, str, str]:
    """Return how many further control points, the expanded uncertainty with them, and what that decides."""
    u = f"± {prospect['expanded_uncertainty']:.2g}{FIGURES[criterion['figure']][2]}"
    return f"{prospect['points']} more", u, "decided" if prospect["is_decided"] else VERDICTS["not_decided"]


def tell_verdict(result: Node) -> str:
    """Return the verdict in a sentence."""
    verdict, named = result["verdict"], result["stated"]["requirement"]["road_class"]
    return f"{VERDICTS[verdict].capitalize()} {'against' if verdict[:3] == 'not' else 'to'} class {named}."


def tell_why(result: Node) -> str:
    """Return what was decided of each figure, and what would decide the rest."""
    words, known = [], {each["figure"]: each for each in result["figures"]}
    for each in result["criteria"]:
        _, sign, unit = FIGURES[each["figure"]]
        if (figure := known.get(each["figure"])) is None:
            words.append(f"{sign} was not measured.")
            continue
        value = " ± ".join(in_step(figure["value"], figure["expanded_uncertainty"])) + unit
        said = f"{sign} = {value} {VERDICTS[each['verdict']]}"
        if each["verdict"] == "not_decided":
            likely = write_probability(each.get("probability"))
            said = f"{sign} = {value} is too near its limit: {likely} likely to conform"
        needed = f"; U of {format(each['needed_u'], '.2g')} would decide it" if "needed_u" in each else ""
        words.append(f"{said}{needed}.")
    return " ".join(words)
