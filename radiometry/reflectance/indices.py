"""Formulae of the bands of one capture, the bands on the pixels of one of them, and maps of indices."""

import ast
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader, roi
from radiometry.frame.multispectral import MOST_LETTERS, NAMED_INDICES, Alignment, RigGeometry
from radiometry.records import Record
from radiometry.reflectance import codes, imaging
from radiometry.reflectance.alignment import IDENTITY, align, move_region, register, require_lens_data

Values = NDArray[np.floating]

_MOST_DEPTH: Final = 16
_LARGEST_NUMBER: Final = 1e6
_LARGEST_POWER: Final = 4.0
UNREFINED_PX = 5.0
"""What is assumed to remain without a refinement: the most that lens data left on the real captures."""

_REACH_PX, _WIDE_REACH_PX = 24, 96


class Formula(Record):
    """An index of the bands of a capture."""

    name: str  # or the formula itself
    text: str  # in the canonical spelling
    bands: tuple[str, ...]  # first the one whose pixels the index has: the near infrared, else the first
    tree: ast.expr = field(compare=False, repr=False)
    positive: bool  # no divisor may be below zero either, as in the named indices, whose divisors are sums


def read_formula(text: str, *, known: Collection[str] | None = None) -> Formula:
    """Parse the name of an index or a formula."""
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
    return codes.FORMULA_INVALID.reject(
        f"{what} Use one of {', '.join(NAMED_INDICES)}, or write bands, numbers, + - * / ** and parentheses: "
        "(nir - red) / (nir + red)."
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


class BandMap(Record):
    """Reflectance of one band's whole frame."""

    header: FrameHeader
    reflectance: NDArray[np.float32]


class AlignedBand(Record):
    """A band on the pixels of the first of its capture."""

    reflectance: NDArray[np.float32]  # NaN where the band did not look, or was saturated
    alignment: Alignment


class IndexMap(Record):
    """An index on the pixels of the first of its bands."""

    values: NDArray[np.float32]  # NaN where it is not defined
    undefined: int  # number of pixels


def align_band(band: BandMap, first: BandMap) -> AlignedBand:
    """Align a band onto another of its capture by lens data, then by correlation."""
    require_capture(first.header, band.header)
    if band.reflectance.shape != first.reflectance.shape:
        raise _refuse_capture()
    of, onto, turned = _read_lenses(band.header, first.header)
    plane = align(band.reflectance, of=of, onto=onto)
    found = register(first.reflectance, plane, reach_px=_REACH_PX if turned else _WIDE_REACH_PX)
    alignment = Alignment(
        band=imaging.require_band(band.header).band,
        by="lens_data",
        residual_px=UNREFINED_PX,
        shift_px=(0.0, 0.0),
        patches=found.patches,
        tried=found.tried,
    )
    if not found.trusted or found.residual_px is None:
        require_lens_data(imaging.require_band(band.header).geometry)
        require_lens_data(imaging.require_band(first.header).geometry)
        return AlignedBand(reflectance=plane, alignment=alignment)
    refined = replace(
        alignment,
        by="lens_data_and_correlation" if turned else "correlation",
        residual_px=found.residual_px,
        shift_px=found.shift_px,
        matrix=found.matrix,
    )
    plane = align(band.reflectance, of=of, onto=onto, matrix=found.matrix)
    return AlignedBand(reflectance=plane, alignment=refined)


def compute_index(formula: Formula, planes: Mapping[str, NDArray[np.float32]]) -> IndexMap:
    """Compute an index of aligned bands, such as NDVI [1], GNDVI [2], EVI2 [3] and SAVI [4].

    [1] J. W. Rouse et al., Third ERTS Symposium, NASA SP-351, 309 (1974)
    [2] A. A. Gitelson, M. N. Merzlyak, Adv. Space Res. 22, 689 (1998), doi:10.1016/S0273-1177(97)01133-2
    [3] Z. Jiang et al., Remote Sens. Environ. 112, 3833 (2008), doi:10.1016/j.rse.2008.06.006
    [4] A. R. Huete, Remote Sens. Environ. 25, 295 (1988), doi:10.1016/0034-4257(88)90106-X
    """
    values = np.asarray(compute(formula, planes)[0], np.float32)
    return IndexMap(values=values, undefined=int(np.count_nonzero(np.isnan(values))))


def move_regions(
    polygon: roi.Polygon, first: FrameHeader, others: Sequence[tuple[FrameHeader, tuple[float, ...] | None]]
) -> tuple[roi.Polygon, ...]:
    """Return a region of a frame as it and the other bands of its capture see it."""
    here, there = polygon, []
    # once more than there are bands: what the last of them does not see is cut off for the first too
    for header, matrix in (*others, *others):
        require_capture(first, header)
        of, onto, _ = _read_lenses(header, first)
        size = {"height_px": first.height_px, "width_px": first.width_px}
        here, moved = move_region(here, of=of, onto=onto, matrix=matrix or IDENTITY, **size)
        there.append(moved)
    return here, *there[len(others) :]


def require_capture(one: FrameHeader, other: FrameHeader) -> None:
    """Refuse two files that are not bands of one capture."""
    captures = [imaging.require_band(each).capture_id for each in (one, other)]
    same = captures[0] is not None and captures[0] == captures[1]
    sizes = {(each.height_px, each.width_px) for each in (one, other)}
    if not same or one.serial != other.serial or len(sizes) > 1:
        raise _refuse_capture()


def _refuse_capture() -> InputRejected:
    return codes.BANDS_NOT_ALIGNED.reject(
        "The two files are not bands of one capture (their capture ids, cameras or sizes differ): the camera "
        "had moved between them."
    )


def _read_lenses(band: FrameHeader, first: FrameHeader) -> tuple[RigGeometry, RigGeometry, bool]:
    """Return both lenses, and True if their files state how they are turned against each other."""
    lenses = [require_lens_data(imaging.require_band(each).geometry, turned=False) for each in (band, first)]
    turned = all(each.offset_px or each.rotation_deg is not None for each in lenses)
    if not turned:
        lenses = [replace(each, rotation_deg=(0.0, 0.0, 0.0), offset_px=None) for each in lenses]
    return lenses[0], lenses[1], turned


def spread_plane(plane: NDArray[np.float32], *, residual_px: float) -> NDArray[np.float32]:
    """Compute by how much a band may differ in each pixel for what remains of its displacement."""
    down, across = np.gradient(plane)
    return np.asarray(np.hypot(down, across) * (residual_px / math.sqrt(2.0)), np.float32)


def displace_region(plane: NDArray[np.float32], polygon: roi.Polygon, *, residual_px: float) -> float:
    """Compute by how much a region's mean may differ for what remains of the band's displacement."""
    step = residual_px / math.sqrt(2.0)
    reach = max(1, round(step))
    height, width = plane.shape
    inside = roi.mask(polygon, roi.Window(row0=0, col0=0, height=height, width=width))
    changes = []
    for axis in (0, 1):
        slope = (np.roll(plane, -reach, axis) - np.roll(plane, reach, axis)) / (2.0 * reach)
        slope = np.moveaxis(slope, axis, 0)
        slope[:reach] = slope[-reach:] = np.nan
        found = np.moveaxis(slope, 0, axis)[inside]
        known = found[np.isfinite(found)]
        changes.append(step * float(known.mean(dtype=np.float64)) if known.size else 0.0)
    return math.hypot(*changes)
