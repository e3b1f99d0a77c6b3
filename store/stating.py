"""What a certificate states of a stored result, in one form for all methods: coefficients with U, budgets."""

from collections.abc import Iterable
from typing import Any

from radiometry.luminance.budget import explain_budget
from radiometry.luminance.results import IsoFit
from radiometry.reflectance import method as reflectance
from store.codec import decode, drop_absent, encode

Json = dict[str, Any]
Key = tuple[str, float | None, str | None]

COVERAGE_FACTOR = 2.0
"""Of a figure whose method states none: about 95 % of a normal distribution."""


def state_coefficients(method: str, result: Json, figures: Iterable[Json]) -> list[Json]:
    """The figures of a version, each with its expanded uncertainty and coverage factor.

    ``figures`` : with the names of `radiometry.fitting.evidence.Figure`
    """
    expanded = _find_expanded(method, result)
    rows = []
    for figure in figures:
        key = figure["name"], figure.get("iso"), figure.get("band")
        value, factor = expanded.get(key, (COVERAGE_FACTOR * figure["standard_uncertainty"], COVERAGE_FACTOR))
        rows.append(drop_absent({**figure, "expanded_uncertainty": value, "coverage_factor": factor}))
    return rows


def state_budgets(method: str, result: Json) -> list[Json]:
    """The uncertainty budget of each coefficient that has one, with what it holds for."""
    match method:
        case "luminance":
            fits = [decode(IsoFit, stored) for stored in result["iso_fits"]]
            return [
                {
                    "iso": fit.coefficient.iso,
                    "lines": [drop_absent(encode(line)) for line in explain_budget(fit)],
                }
                for fit in fits
            ]
        case "reflectance":
            return [_state_band(decode(reflectance.BandFit, stored)) for stored in result["band_fits"]]
        case _:
            return []


def _find_expanded(method: str, result: Json) -> dict[Key, tuple[float, float]]:
    """What a fit states itself, by name, ISO value and band."""
    match method:
        case "luminance":
            stated = [("luminance_k", fit["coefficient"]) for fit in result["iso_fits"]]
        case "reflectance":
            stated = [("reflectance_k", fit["coefficient"]) for fit in result["band_fits"]]
        case _:
            stated = []
    return {
        (name, told.get("iso"), told.get("band")): (told["expanded_uncertainty"], told["coverage_factor"])
        for name, told in stated
    }


def _state_band(fit: reflectance.BandFit) -> Json:
    """Every source is told as a share of K: ``u`` is its contribution in K's unit."""
    k = abs(fit.coefficient.reflectance_k)
    lines = [{**encode(entry), "u": entry.u_rel * k} for entry in fit.budget]
    return {"band": fit.coefficient.band, "lines": lines}
