"""A frame of which only a row of a table exists: statistics of its region, without pixels."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """Statistics of a frame's region as a table states them, black included.

    Attributes
    ----------
    mean_dn, min_dn, max_dn : float
        Mean, smallest and largest sample [DN].
    pixels : int
        Number of samples.
    white_level_dn : float
        White level [DN].
    std_dn : float or None, default: None
        Standard deviation of the samples [DN]; None if the table does not state it.
    black_level_dn : float or None, default: None
        Black level [DN]; None if it is not known.
    """

    mean_dn: float
    min_dn: float
    max_dn: float
    pixels: int
    white_level_dn: float
    std_dn: float | None = None
    black_level_dn: float | None = None

    @property
    def is_possible(self) -> bool:
        """True if samples with these statistics exist."""
        levels = (self.mean_dn, self.min_dn, self.max_dn, self.white_level_dn)
        known = (*levels, self.std_dn or 0.0, self.black_level_dn or 0.0)
        return (
            all(map(math.isfinite, known))
            and 0.0 <= self.min_dn <= self.mean_dn <= self.max_dn <= self.white_level_dn
            and self.white_level_dn > (self.black_level_dn or 0.0) >= 0.0
            and self.pixels >= 1
            and (self.std_dn or 0.0) >= 0.0
        )

    @property
    def widest_std_dn(self) -> float:
        """The stated standard deviation, else the largest that samples of this mean and range can have [DN].

        References
        ----------
        .. [1] R. Bhatia, C. Davis, Am. Math. Mon. 107, 353 (2000), doi:10.1080/00029890.2000.12005203
        """
        if self.std_dn is not None:
            return self.std_dn
        return math.sqrt((self.max_dn - self.mean_dn) * (self.mean_dn - self.min_dn))

    @property
    def saturated_share(self) -> float:
        """Largest share of the samples that can lie at the white level."""
        if self.max_dn < self.white_level_dn:
            return 0.0
        span = self.max_dn - self.min_dn
        return (self.mean_dn - self.min_dn) / span if span > 0.0 else 1.0
