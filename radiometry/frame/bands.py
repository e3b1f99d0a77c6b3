"""Names of bands, panels and indices of multispectral cameras."""

import re
from typing import Final, Literal

__all__ = ["MOST_LETTERS", "NAMED_INDICES", "classify_band", "label_band", "name_band", "name_panel"]

Kind = Literal["thermal", "panchromatic"]
# Vegetation indices by name, as formulas of reflectances
NAMED_INDICES: Final = {
    "ndvi": "(nir - red) / (nir + red)",
    "ndre": "(nir - red_edge) / (nir + red_edge)",
    "gndvi": "(nir - green) / (nir + green)",
    "evi2": "2.5 * (nir - red) / (nir + 2.4 * red + 1)",
    "savi": "1.5 * (nir - red) / (nir + red + 0.5)",
}
MOST_LETTERS: Final = 200  # Longest formula of an index
_THERMAL_NM: Final = 3000.0
_PANCHROMATIC_WIDTH_NM: Final = 200.0
_BAND_ALIASES: Final = {"gre": "green", "reg": "red_edge", "rededge": "red_edge"}
# Serial number of a MicaSense panel; from RP04 on its code continues with reflectances
PANEL_SERIAL: Final = re.compile(r"RP(\d{2})-\d{7}-[A-Z]{2}", re.ASCII)


def name_band(text: str) -> str:
    """Return the canonical name of a band.

    Parameters
    ----------
    text : str
        Name as written in a file: "Red edge" is red_edge, "Blue-444" is blue_444.

    Returns
    -------
    str
        Lower-case name with underscores; "unnamed" for an empty one.
    """
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return _BAND_ALIASES.get(plain, plain) or "unnamed"


def label_band(name: str) -> str:
    """Return the name of a band in words: red_edge is "red edge".

    Parameters
    ----------
    name : str
        Canonical name, as `name_band` returns it.
    """
    return name.replace("_", " ")


def name_panel(text: str) -> str:
    """Return the serial number of a reflectance panel as it is compared.

    Parameters
    ----------
    text : str
        As engraved, typed in, or read from a file or a code.

    Returns
    -------
    str
        Upper case, single blanks; of a MicaSense code the serial number without the reflectances behind it.
    """
    plain = " ".join(text.split()).upper()
    serial = PANEL_SERIAL.match(plain)
    return serial[0] if serial else plain


def classify_band(band: str, *, wavelength_nm: float | None, width_nm: float | None) -> Kind | None:
    """Return the kind of a band that has no reflectance.

    Parameters
    ----------
    band : str
        Canonical name of the band.
    wavelength_nm, width_nm : float or None
        Centre wavelength and bandwidth [nm].

    Returns
    -------
    Kind or None
        "thermal" beyond 3 um, "panchromatic" for 200 nm and wider, or by their
        names; None for a band of reflected light.
    """
    if (wavelength_nm or 0.0) > _THERMAL_NM or band in ("lwir", "thermal"):
        return "thermal"
    return "panchromatic" if (width_nm or 0.0) >= _PANCHROMATIC_WIDTH_NM or "panchro" in band else None
