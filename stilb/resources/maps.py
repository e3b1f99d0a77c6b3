"""Isolines of a measurement's map."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from stilb.problem import Unclear
from stilb.resources.jobs import Jobs
from stilb.transport import Call, address
from stilb.upload import PathLike

Area = Literal["region", "grid", "frame"]


class Maps(Jobs):
    """Readings of maps, computed at the request."""

    def save_isolines(
        self,
        measurement_id: str,
        path: PathLike,
        *,
        levels: Sequence[float] | None = None,
        area: Area = "frame",
        step: int | None = None,
        coordinates: str | None = None,
    ) -> Path:
        """Save lines of equal value as .geojson; without ``levels`` at round ones."""
        query = {
            "levels": ",".join(map(repr, levels)) if levels else None,
            "area": area,
            "step": step,
            "coordinates": coordinates,
        }
        suffix = Path(path).suffix.lower()
        if suffix != ".geojson":
            raise Unclear(f"{path}: isolines are saved as .geojson")
        call = Call(
            method="GET", path=address("measurements", measurement_id, "isolines.geojson"), query=query
        )
        self._transport.download(call, Path(path))
        return Path(path)
