"""Line profiles, isolines and histograms of a measurement's map."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from stilb.problem import Unclear
from stilb.resources.jobs import Jobs
from stilb.transport import Call, Query, address
from stilb.upload import PathLike

Points = Sequence[tuple[float, float]]
Area = Literal["region", "grid", "frame"]


class Maps(Jobs):
    """Readings of maps; each is computed at the request."""

    def profile(
        self, measurement_id: str, line: Points, *, across_px: int = 1, most: int | None = None
    ) -> dict[str, Any]:
        """Return the values of a map along a line of corners (x, y) in pixels, with their uncertainties.

        ``across_px`` : pixels across the line that are averaged; ``most`` : largest number of points
        """
        query = _ask_line(line, across_px=across_px, most=most)
        return self._get(address("measurements", measurement_id, "profile.json"), query)

    def histogram(
        self, measurement_id: str, *, area: Area = "region", bins: int | None = None
    ) -> dict[str, Any]:
        """Return the pixels of an area of a map by their values, with percentiles."""
        query = {"area": area, "bins": bins}
        return self._get(address("measurements", measurement_id, "histogram.json"), query)

    def save_profile(
        self,
        measurement_id: str,
        path: PathLike,
        line: Points,
        *,
        across_px: int = 1,
        most: int | None = None,
    ) -> Path:
        """Save the values of a map along a line: .csv or .json."""
        query = _ask_line(line, across_px=across_px, most=most)
        return self._save(measurement_id, "profile", Path(path), {".csv", ".json"}, query)

    def save_histogram(
        self, measurement_id: str, path: PathLike, *, area: Area = "region", bins: int | None = None
    ) -> Path:
        """Save the histogram of an area of a map: .csv or .json."""
        query = {"area": area, "bins": bins}
        return self._save(measurement_id, "histogram", Path(path), {".csv", ".json"}, query)

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
        return self._save(measurement_id, "isolines", Path(path), {".geojson"}, query)

    def _save(self, measurement_id: str, name: str, path: Path, suffixes: set[str], query: Query) -> Path:
        suffix = path.suffix.lower()
        if suffix not in suffixes:
            raise Unclear(f"{path}: {name} is saved as {' or '.join(sorted(suffixes))}")
        call = Call(method="GET", path=address("measurements", measurement_id, name + suffix), query=query)
        self._transport.download(call, path)
        return path


def _ask_line(line: Points, *, across_px: int, most: int | None) -> Query:
    text = " ".join(f"{x!r},{y!r}" for x, y in line)
    return {"line": text, "across_px": across_px, "most": most}
