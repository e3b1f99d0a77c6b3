"""Measurements with a calibrated camera."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, Unpack

from stilb import problem, records, transport
from stilb.export import export_measurement
from stilb.resources.campaigns import region
from stilb.resources.frames import Jobs


class Measurements(Jobs):
    """Frames of the field turned into physical units."""

    def measure(
        self,
        frame: str | Sequence[str],
        *,
        with_map: bool = False,
        with_bands: bool = False,
        **details: Unpack[records.MeasureDetails],
    ) -> records.Measurement:
        """Measure one frame, or the average of several of one scene, and wait.

        Without ``calibration_id``: what was in force when it was taken.
        """
        frames = {"frame_id": frame} if isinstance(frame, str) else {"frame_ids": list(frame)}
        body = {**frames, **_options(details, with_map=with_map, with_bands=with_bands)}
        return self._measured(records.Job.of(self._post(transport.address("measurements"), body)))

    def measure_campaign(
        self,
        campaign_id: str,
        *,
        with_map: bool = False,
        with_bands: bool = False,
        on_progress: Callable[[int, int], None] = lambda *_: None,
        **details: Unpack[records.MeasureDetails],
    ) -> tuple[list[records.Measurement], list[dict[str, Any]]]:
        """Measure every field frame of a campaign: what came of it, and what was not measured and why.

        With one region or grid for all, or without: each frame's own region, else the campaign's.
        ``on_progress`` is called with how many frames are done, and of how many.
        """
        body = _options(details, with_map=with_map, with_bands=with_bands)
        answer = self._post(transport.address("campaigns", campaign_id, "measurements"), body)
        found, left = list[records.Measurement](), list(answer["not_measured"])
        jobs = [records.Job.of(job) for job in answer["jobs"]]
        for done, job in enumerate(jobs):
            on_progress(done, len(jobs))
            try:
                found.append(self._measured(job))
            except problem.JobFailed as failure:
                named = {"frame_id": job.raw["subject_id"], "filename": job.raw.get("filename", "")}
                left.append({**named, "code": failure.code, "detail": str(failure)})
        on_progress(len(jobs), len(jobs))
        return found, left

    def save_cells(self, measurement_id: str, path: transport.PathLike) -> Path:
        """Save the cells of a measurement's grid: .csv, or .geojson in metres on the road, else in pixels."""
        path = Path(path)
        suffix = path.suffix.lower()
        if suffix not in {".csv", ".geojson"}:
            raise problem.Unclear(f"{path}: cells are saved as .csv or .geojson")
        return self._save(path, transport.address("measurements", measurement_id, f"cells{suffix}"))

    def save_measurements(self, campaign_id: str, path: transport.PathLike) -> Path:
        """Save all measurements of a campaign: .csv, .geojson, or .json with a row each."""
        path = Path(path)
        suffix = path.suffix.lower()
        if suffix not in {".csv", ".geojson", ".json"}:
            raise problem.Unclear(f"{path}: measurements are saved as .csv, .geojson or .json")
        if suffix == ".geojson":
            return self._save(path, transport.address("campaigns", campaign_id, "measurements.geojson"))
        query = {"campaign_id": campaign_id, "format": suffix.removeprefix(".")}
        return self._save(path, transport.address("series", "measurements"), query)

    def measurement(self, measurement_id: str) -> records.Measurement:
        return records.Measurement.of(self._get(transport.address("measurements", measurement_id)))

    def measurement_record(self, measurement_id: str) -> dict[str, Any]:
        """A measurement as stored, with all that recomputing it needs but the files."""
        return self._get(transport.address("measurements", measurement_id, "record.json"))

    def export_measurement(self, measurement_id: str, folder: transport.PathLike) -> Path:
        """Download a measurement's record, frames and map, for `make verify`. Safe to call again."""
        return export_measurement(self._transport, measurement_id, Path(folder))

    def measurements(
        self,
        *,
        camera_id: str | None = None,
        campaign_id: str | None = None,
        calibration_id: str | None = None,
    ) -> Iterator[records.Measurement]:
        """Newest first."""
        query = {"camera_id": camera_id, "campaign_id": campaign_id, "calibration_id": calibration_id}
        return map(records.Measurement.of, self._items(transport.address("measurements"), query))

    def compare(
        self, old: str, new: str, *, other_region: bool = False, same_light: bool = False
    ) -> records.Comparison:
        """Compute the difference of two measurements; different outlines only with ``other_region``.

        ``same_light`` : the same lamps lit both, so that their spectral mismatch cancels
        """
        given = {"other_region": other_region, "same_light": same_light}
        query = {"old": old, **{name: "true" for name, value in given.items() if value}}
        return records.Comparison.of(self._get(transport.address("measurements", new, "comparison"), query))

    def save_map(self, measurement_id: str, path: transport.PathLike) -> Path:
        """Save the map of a measurement that was made with one: its numbers (.tif), or a picture (.png)."""
        name = "map.png" if Path(path).suffix.lower() == ".png" else "map.tif"
        return self._save(path, transport.address("measurements", measurement_id, name))

    def save_report(self, measurement_id: str, path: transport.PathLike) -> Path:
        """Save the two-page report of a luminance measurement as PDF."""
        return self._save(path, transport.address("measurements", measurement_id, "report.pdf"))

    def save_stac(self, measurement_id: str, map_path: transport.PathLike) -> Path:
        """Save the STAC item of a map beside its file, which the item then names."""
        path = Path(map_path)
        item = self._get(transport.address("measurements", measurement_id, "stac.json"))
        item["assets"]["map"]["href"] = f"./{path.name}"
        target = path.with_suffix(".json")
        transport.write_whole(target, json.dumps(item, indent=1, ensure_ascii=False) + "\n")
        return target

    def _measured(self, job: records.Job) -> records.Measurement:
        done = self.wait(job)
        return self.measurement(str((done.result or {})["measurement_id"]))


def _options(details: records.MeasureDetails, *, with_map: bool, with_bands: bool) -> dict[str, Any]:
    body: dict[str, Any] = {name: value for name, value in details.items() if name != "polygon"}
    if "polygon" in details:
        body["roi"] = region(details["polygon"])
    return body | ({"products": ["bands" if with_bands else "map"]} if with_map or with_bands else {})


Area = Literal["region", "grid", "frame"]


class Maps(Jobs):
    """Readings of maps, computed at the request."""

    def save_isolines(
        self,
        measurement_id: str,
        path: transport.PathLike,
        *,
        levels: Sequence[float] | None = None,
        area: Area = "frame",
        step: int | None = None,
        coordinates: str | None = None,
    ) -> Path:
        """Save lines of equal value as .geojson; without ``levels`` at round ones."""
        if Path(path).suffix.lower() != ".geojson":
            raise problem.Unclear(f"{path}: isolines are saved as .geojson")
        query = {"levels": ",".join(map(repr, levels)) if levels else None, "area": area}
        query |= {"step": None if step is None else str(step), "coordinates": coordinates}
        return self._save(path, transport.address("measurements", measurement_id, "isolines.geojson"), query)
