"""Key figures of a noise version: full well, read noise and the largest signal-to-noise ratio."""

from typing import Any

from radiometry.specification.key_figures import KeyFigure, choose_channel, of_quantity

_FIGURES = (("full_well_e", "Full well"), ("read_noise_e", "Read noise"), ("snr_max", "Largest SNR"))


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return them for each ISO value, of the channel that stands for brightness."""
    fits = result["channel_fits"]
    shown = choose_channel(fit["channel"] for fit in fits)
    return tuple(
        figure
        for fit in fits
        if fit["channel"] == shown
        for name, label in _FIGURES
        for figure in of_quantity(f"ISO {fit['iso']:g}", label, (fit.get("transfer") or {}).get(name))
    )
