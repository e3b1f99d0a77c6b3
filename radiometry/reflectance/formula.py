"""Formula of the bands of one capture: what it may contain, its values, and its derivatives."""

import ast
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame.bands import MOST_LETTERS, NAMED_INDICES
from radiometry.reflectance import codes

Values = NDArray[np.floating]

_MOST_DEPTH: Final = 16
_LARGEST_NUMBER: Final = 1e6
_LARGEST_POWER: Final = 4.0


@dataclass(frozen=True, kw_only=True)
class Formula:
    """An index of the bands of a capture.

    Attributes
    ----------
    name : str
        Name of the index, or the formula itself.
    text : str
        Formula in the canonical spelling.
    bands : tuple of str
        Bands that it contains, the one whose pixels the index has first: the near infrared, else the first.
    tree : ast.expr
        Parsed formula.
    positive : bool
        True if no divisor may be below zero either, as in the named indices, whose divisors are sums.
    """

    name: str
    text: str
    bands: tuple[str, ...]
    tree: ast.expr = field(compare=False, repr=False)
    positive: bool


def read_formula(text: str, *, known: Collection[str] | None = None) -> Formula:
    """Parse the name of an index or a formula.

    Parameters
    ----------
    text : str
        A name, or numbers and names of bands with + - * / ** and parentheses. A power is a number up to 4.
    known : collection of str or None, default: None
        Bands that there are; None if they are not known.

    Returns
    -------
    Formula
        Parsed formula. Nothing of it is executed by Python.

    Raises
    ------
    InputRejected
        `formula_invalid`.
    """
    name = text.strip().lower()
    source = NAMED_INDICES.get(name, name)
    if len(source) > MOST_LETTERS:
        raise _refuse(f"The formula has {len(source)} characters, and {MOST_LETTERS} are allowed.")
    try:
        tree = ast.parse(source, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise _refuse(f"{text.strip()[:40]!r} is neither a formula nor a name of an index.") from error
    found = list(dict.fromkeys(_check(tree, depth=0)))
    if not found:
        raise _refuse("The formula contains no band.")
    unknown = [band for band in found if known is not None and band not in known]
    if unknown:
        raise _refuse(f"There is no band {', '.join(unknown)} here, but {', '.join(sorted(known or ()))}.")
    found.sort(key=lambda band: band != "nir")
    canonical = ast.unparse(tree)
    return Formula(
        name=name if name in NAMED_INDICES else canonical,
        text=canonical,
        bands=tuple(found),
        tree=tree,
        positive=name in NAMED_INDICES,
    )


def _refuse(what: str) -> InputRejected:
    return InputRejected(
        codes.FORMULA_INVALID,
        f"{what} Use one of {', '.join(NAMED_INDICES)}, or write bands, numbers, + - * / ** and parentheses: "
        "(nir - red) / (nir + red).",
    )


def _check(node: ast.expr, *, depth: int) -> Iterator[str]:
    """List the bands of a formula, and refuse what it may not contain."""
    if depth > _MOST_DEPTH:
        raise _refuse(f"The formula is nested more than {_MOST_DEPTH} deep.")
    match node:
        case ast.Name():
            yield node.id
        case ast.Constant():
            _read_number(node)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            yield from _check(node.operand, depth=depth + 1)
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
            yield from _check(node.left, depth=depth + 1)
            yield from _check(node.right, depth=depth + 1)
        case ast.BinOp(op=ast.Pow()):
            _read_power(node.right)
            yield from _check(node.left, depth=depth + 1)
        case _:
            raise _refuse(f"The formula contains {ast.unparse(node)[:40]!r}.")


def _read_number(node: ast.Constant) -> float:
    value = node.value
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST_NUMBER:
        raise _refuse(
            f"{str(value)[:20]!r} is no number of a formula: at most {_LARGEST_NUMBER:g} is allowed."
        )
    return float(value)


def _read_power(node: ast.expr) -> float:
    sign, inner = (-1.0, node.operand) if isinstance(node, ast.UnaryOp) else (1.0, node)
    power = _read_number(inner) if isinstance(inner, ast.Constant) else math.inf
    if (isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.USub)) or power > _LARGEST_POWER:
        raise _refuse(f"A power must be a number up to {_LARGEST_POWER:g}.")
    return sign * power


def compute(formula: Formula, values: Mapping[str, Values]) -> tuple[Values, dict[str, Values]]:
    """Compute a formula and its partial derivatives.

    Parameters
    ----------
    formula : Formula
        Formula.
    values : mapping of str to ndarray
        Reflectance by band; arrays of one shape, NaN where unknown.

    Returns
    -------
    tuple[ndarray, dict of str to ndarray]
        Values, NaN where the formula is not defined, and their derivatives by band.
    """
    with np.errstate(all="ignore"):
        found, slopes = _walk(formula.tree, values, positive=formula.positive)
    found = np.where(np.isfinite(found), found, np.nan).astype(_dtype(values))
    return found, {band: np.asarray(slopes.get(band, 0.0)) for band in formula.bands}


def _dtype(values: Mapping[str, Values]) -> np.dtype[np.floating]:
    return np.asarray(next(iter(values.values()))).dtype


def _walk(
    node: ast.expr, values: Mapping[str, Values], *, positive: bool
) -> tuple[Values, dict[str, Values]]:
    if isinstance(node, ast.Name):
        return values[node.id], {node.id: np.ones((), _dtype(values))}
    if isinstance(node, ast.Constant):
        return np.asarray(_read_number(node), _dtype(values)), {}
    if isinstance(node, ast.UnaryOp):
        sign = -1 if isinstance(node.op, ast.USub) else 1
        a, of_a = _walk(node.operand, values, positive=positive)
        return sign * a, {band: sign * slope for band, slope in of_a.items()}
    operation = cast("ast.BinOp", node)
    a, of_a = _walk(operation.left, values, positive=positive)
    if isinstance(operation.op, ast.Pow):
        power = _read_power(operation.right)
        return a**power, {band: power * a ** (power - 1.0) * slope for band, slope in of_a.items()}
    b, of_b = _walk(operation.right, values, positive=positive)
    return _operate(operation.op, (a, of_a), (b, of_b), positive=positive)


def _operate(
    operation: ast.operator,
    left: tuple[Values, dict[str, Values]],
    right: tuple[Values, dict[str, Values]],
    *,
    positive: bool,
) -> tuple[Values, dict[str, Values]]:
    (a, of_a), (b, of_b) = left, right
    zero = np.zeros((), a.dtype)
    pairs = {band: (of_a.get(band, zero), of_b.get(band, zero)) for band in {**of_a, **of_b}}
    if isinstance(operation, ast.Mult):
        return a * b, {band: da * b + a * db for band, (da, db) in pairs.items()}
    if isinstance(operation, ast.Div):
        divisor = np.where((b <= 0.0) if positive else (b == 0.0), np.nan, b)
        ratio = a / divisor
        return ratio, {band: (da - ratio * db) / divisor for band, (da, db) in pairs.items()}
    sign = -1 if isinstance(operation, ast.Sub) else 1
    return a + sign * b, {band: da + sign * db for band, (da, db) in pairs.items()}
