"""Parameters of a vignetting fit."""

from dataclasses import dataclass

from radiometry.fitting.evidence import Exclusion

FLAT, DARK = "flat", "dark"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a fit; the defaults serve a campaign shot as the documentation says."""

    exclude: tuple[Exclusion, ...] = ()
