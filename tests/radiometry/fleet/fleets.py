"""Fleets with a known truth."""

from datetime import UTC, datetime, timedelta

from radiometry.fleet.determinations import Determination, Key, Source

LUMINANCE_K = Key(name="luminance_k", unit="DN*m2/(cd*s)", model="proportional", iso=3200.0)
PRINCIPAL_POINT = Key(name="cx_px", unit="px", model="pinhole")
START = datetime(2026, 1, 1, tzinfo=UTC)


def determine(
    value, camera, repeat=0, *, key=LUMINANCE_K, u=0.3, lens=None, campaign=None, days=None, version=None
):
    """One value; by default each from a campaign of its own, a month apart."""
    name = version or f"{camera}-{lens}-{repeat}"
    return Determination(
        key=key,
        value=float(value),
        standard_uncertainty=u,
        source=Source(
            version=name,
            camera=camera,
            lens=lens,
            campaign=campaign or name,
            at=START + timedelta(days=30 * repeat if days is None else days),
        ),
    )


def fleet_of(values, **said):
    """A list of repeats per camera, cameras named A, B, C, ..."""
    return [
        determine(value, "ABCDEFGHIJ"[index], repeat, **said)
        for index, repeats in enumerate(values)
        for repeat, value in enumerate(repeats)
    ]


def draw_fleet(rng, *, truths, repeats, repeatability, **said):
    """Repeats about each camera's true value; ``repeats`` : a number, or one a camera."""
    numbers = [repeats] * len(truths) if isinstance(repeats, int) else repeats
    values = [
        truth + repeatability * rng.standard_normal(number)
        for truth, number in zip(truths, numbers, strict=True)
    ]
    return fleet_of(values, u=repeatability, **said)
