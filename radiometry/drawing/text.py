"""Names and numbers as plots write them."""

import math
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Final

_PLAIN: Final = (1e-4, 1e7)
_THIN: Final = "\N{THIN SPACE}"
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def in_step(value: float, uncertainty: float) -> tuple[str, str]:
    """Return a value and its uncertainty, this to two significant digits, the value to the same place.

    By JCGM 100:2008, 7.2.6.

    An uncertainty that is not positive and finite rounds nothing.
    """
    if not 0.0 < uncertainty < math.inf:
        return f"{value:.5g}", f"{uncertainty:.5g}"
    place = 1 - math.floor(math.log10(uncertainty))
    if round(uncertainty, place) >= 10.0 ** (2 - place):
        place -= 1  # 0.0996 rounds to 0.10
    decimals = max(place, 0)
    return f"{round(value, place):.{decimals}f}", f"{round(uncertainty, place):.{decimals}f}"


def write_quantity(value: float, uncertainty: float, unit: str = "1") -> str:
    """Return a value with its uncertainty and unit: 32.31 ± 0.44 DN·m²/(cd·s), 1.20 ± 0.10 %."""
    said = "" if unit == "1" else f" {write_unit(unit)}"
    return f"{' ± '.join(in_step(value, uncertainty))}{said}"


def raise_ten(number: str) -> str:
    """Return a number as print sets it, with a raised power of ten for "e"."""
    mantissa, _, power = number.partition("e")
    return f"{mantissa} \N{MULTIPLICATION SIGN} 10{str(int(power)).translate(_RAISED)}" if power else number


def write_tick(value: float, *, step: float = 0.0) -> str:
    """Return a number beside an axis: 0.25, 20 000, a power of ten beyond 10⁷."""
    if value == 0.0:
        return "0"
    digits = 6
    if step > 0.0:
        digits = max(digits, math.floor(math.log10(abs(value))) - math.floor(math.log10(step)) + 1)
    if not _PLAIN[0] <= abs(value) < _PLAIN[1]:
        mantissa, power = f"{value:.{min(digits, 15) - 1}e}".split("e")
        return raise_ten(f"{float(mantissa):.15g}e{power}")
    decimals = max(0, min(digits, 15) - 1 - math.floor(math.log10(abs(value))))
    whole, _, part = f"{value:.{decimals}f}".partition(".")
    if len(whole.lstrip("-")) > 4:
        whole = f"{int(whole):,}".replace(",", _THIN)
    part = part.rstrip("0")
    return f"{whole}.{part}" if part else whole


def shorten(text: str, most: int) -> str:
    """Return a text of at most so many characters; serial numbers differ at their end, so the middle goes."""
    if len(text) <= most:
        return text
    end = (most - 1) // 2
    return f"{text[: most - 1 - end]}…{text[-end:]}"


def write_exposure(seconds: float) -> str:
    """Return an exposure time as a camera names it: 1/250 s, 2 s."""
    if seconds >= 0.3:
        return f"{seconds:.3g} s"
    whole = round(1.0 / seconds)
    return f"1/{whole} s" if abs(seconds * whole - 1.0) < 0.01 else f"1/{1.0 / seconds:.3g} s"


@lru_cache(2**15)  # a review sorts the names of its frames again and again
def natural_key(name: str) -> str:
    """Return a key that sorts names in natural order: scene 9 before scene 10."""
    parts = re.split(r"(\d+)", name.lower())
    return "\0".join(part.zfill(20) if part.isdigit() else part for part in parts)


def sort_naturally(names: Iterable[str]) -> list[str]:
    """Return names in natural order."""
    return sorted(names, key=natural_key)


def name_few(noun: str, names: Iterable[str], *, most: int = 3) -> str:
    """Return the first names in order, and how many more; a noun that they begin with is left out."""
    ordered = sort_naturally(names)
    shown = ", ".join(ordered[:most]) + (f" and {len(ordered) - most} more" if len(ordered) > most else "")
    if all(name.lower().startswith(noun) for name in ordered):
        return shown
    return f"{noun}{'s' * (len(ordered) != 1)} {shown}"


def name_range(noun: str, names: Iterable[str]) -> str:
    """Return names that are numbered as ranges, "scenes 1 to 6 and 8"; others as `name_few` does."""
    ordered = sort_naturally(names)
    parts = [re.fullmatch(r"(.*?)(0|[1-9]\d{0,5})", name) for name in ordered]
    numbers = [int(part[2]) for part in parts if part]
    heads = {part[1] if part else "" for part in parts}
    if len(ordered) < 2 or len(numbers) < len(ordered) or len(heads) > 1:
        return name_few(noun, ordered)
    head = heads.pop()
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    plain = "" if head.strip().lower() == noun else head
    shown = [f"{plain}{run[0]}" + (f" to {plain}{run[-1]}" if len(run) > 1 else "") for run in runs]
    return f"{noun}s {', '.join(shown[:-1])}{' and ' * (len(shown) > 1)}{shown[-1]}"


def write_unit(unit: str) -> str:
    """Return a unit as print sets it, from the way in which it is typed."""
    return unit.replace("*", "·").replace("m2", "m²").replace("um", "µm")


def label_axis(quantity: str, unit: str) -> str:
    """Return a quantity with its unit in brackets, without one for a pure number."""
    return quantity if unit == "1" else f"{quantity} [{write_unit(unit)}]"
