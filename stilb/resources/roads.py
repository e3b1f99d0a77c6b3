"""Roads: stated, read at control points, evaluated and planned."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from stilb import problem, transport
from stilb.records import Job, Road, RoadResult
from stilb.resources.frames import Jobs


class Roads(Jobs):
    """Verdicts on the illuminance of roads."""

    def create_road(self, **stated: object) -> Road:
        """Register a road: name, site, requirement, conditions and frames, as `POST /v1/roads` takes them."""
        return Road.of(self._post(transport.address("roads"), stated))

    def road(self, road_id: str) -> Road:
        return Road.of(self._get(transport.address("roads", road_id)))

    def roads(self) -> Iterator[Road]:
        """The organisation's roads, newest first."""
        return map(Road.of, self._items(transport.address("roads")))

    def set_road_points(self, road_id: str, points: Sequence[dict[str, Any]] | str) -> list[dict[str, Any]]:
        """State all control points: a list, or a CSV text whose first line names the columns."""
        path = transport.address("roads", road_id, "points")
        call = transport.Call(method="PUT", path=path, json=points)
        if isinstance(points, str):
            headers = {"Content-Type": "text/csv; charset=utf-8"}
            call = transport.Call(method="PUT", path=path, text=points, headers=headers)
        return list(self._transport.json(call)["items"])

    def evaluate_road(self, road_id: str) -> RoadResult:
        """Evaluate a road as it is stated now, and wait."""
        done = self.wait(Job.of(self._post(transport.address("roads", road_id, "evaluate"), {})))
        return self.road_result(road_id, int((done.result or {})["number"]))

    def road_result(self, road_id: str, number: int) -> RoadResult:
        return RoadResult.of(self._get(transport.address("roads", road_id, "results", str(number))))

    def plan_road(self, road_id: str, **wanted: float) -> dict[str, Any]:
        """Return the control points and exposure times that reach `e_av_u_rel` and `u_0_u_rel`, expanded."""
        return self._get(transport.address("roads", road_id, "plan"), wanted)

    def save_plan(self, road_id: str, path: transport.PathLike, **wanted: float) -> Path:
        """Save the card of such a plan (PDF)."""
        return self._save(path, transport.address("roads", road_id, "plan.pdf"), wanted)

    def save_road(self, result: RoadResult, path: transport.PathLike) -> Path:
        """Save an evaluation: .pdf the report, .csv or .geojson the points, .png the map."""
        names = {".pdf": "report.pdf", ".csv": "points.csv", ".geojson": "points.geojson", ".png": "map.png"}
        if (name := names.get(Path(path).suffix.lower())) is None:
            raise problem.Unclear(f"{path}: an evaluation is saved as {', '.join(names)}")
        return self._save(
            path, transport.address("roads", result.road_id, "results", str(result.number), name)
        )
