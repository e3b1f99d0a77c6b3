"""Application of a version to a later frame: the options that a measurement takes."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Application:
    """What a version of a method makes of a later frame.

    Attributes
    ----------
    options : tuple of str
        Options of a measurement that this method takes, beside region and products.
    """

    options: tuple[str, ...] = ()
