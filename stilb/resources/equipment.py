"""Cameras, meters, panels and rigs."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from stilb.problem import Problem, only
from stilb.records import Camera, Meter, Panel, PanelBand, Rig
from stilb.transport import Connection, PathLike, address, without_none


class Equipment(Connection):
    """Cameras, meters and panels."""

    def create_camera(self, make: str, model: str, serial: str, **details: Any) -> Camera:  # noqa: ANN401  JSON
        """``details``: lens (make, model, serial), pixel_pitch_um, sensor_width_mm and note."""
        body = {"make": make, "model": model, "serial": serial, **details}
        return Camera.of(self._post(address("cameras"), body))

    def camera(self, camera_id: str) -> Camera:
        return Camera.of(self._get(address("cameras", camera_id)))

    def cameras(
        self, *, make: str | None = None, model: str | None = None, serial: str | None = None
    ) -> Iterator[Camera]:
        query = {"make": make, "model": model, "serial": serial}
        return map(Camera.of, self._items(address("cameras"), query))

    def find_camera(self, named: str) -> Camera:
        """The camera with this id, this serial, or this make, model and serial with blanks between them."""
        try:
            return self.camera(named)
        except Problem as problem:
            if problem.status != 404:
                raise
        every = list(self.cameras())
        found = [one for one in every if named in {one.serial, f"{one.make} {one.model} {one.serial}"}]
        return only(
            found,
            several=f"Several cameras are named {named!r}: {_names(found)}. Give the id of one.",
            none=f"No camera is named {named!r}. Registered: {_names(every) or 'none yet'}.",
        )

    def create_meter(
        self, kind: str, make: str, model: str, serial: str, *, certificate: dict[str, Any] | None = None
    ) -> Meter:
        """``kind``: luminance, illuminance or sunshine; ``certificate``: as its answer has it."""
        body = {"kind": kind, "make": make, "model": model, "serial": serial, "certificate": certificate}
        return Meter.of(self._post(address("meters"), without_none(body)))

    def meters(self) -> Iterator[Meter]:
        return map(Meter.of, self._items(address("meters")))

    def create_panel(self, serial: str, *, measured_on: str, bands: Sequence[PanelBand]) -> Panel:
        """A panel as it was measured on a day; measured again it is another."""
        body = {"serial": serial, "measured_on": measured_on, "bands": list(bands)}
        return Panel.of(self._post(address("panels"), body))

    def panel(self, panel_id: str) -> Panel:
        return Panel.of(self._get(address("panels", panel_id)))

    def panels(self) -> Iterator[Panel]:
        return map(Panel.of, self._items(address("panels")))


def _names(cameras: list[Camera]) -> str:
    return ", ".join(f"{one.make} {one.model} {one.serial} ({one.id})" for one in cameras)


class Rigs(Equipment):
    """Rigs of cameras."""

    def create_rig(self, name: str, camera_ids: Sequence[str]) -> Rig:
        """Cameras that are mounted together, the reference first; the same again is the same rig."""
        return Rig.of(self._post(address("rigs"), {"name": name, "camera_ids": list(camera_ids)}))

    def find_rig(self, named: str) -> Rig:
        """The rig with this id or name."""
        every = [Rig.of(row) for row in self._items(address("rigs"))]
        found = [one for one in every if named in {one.id, one.name}]
        names = ", ".join(one.name for one in every) or "none yet"
        return only(found[:1], several="", none=f"No rig is named {named!r}. Registered: {names}.")

    def rig_orientation(
        self, rig_id: str, *, tolerance_deg: float | None = None, tolerance_m: float | None = None
    ) -> dict[str, Any]:
        """The orientation of each camera by set, and its stability over the sets, as it is answered."""
        query = {"tolerance_deg": tolerance_deg, "tolerance_m": tolerance_m}
        return self._get(address("rigs", rig_id, "orientation"), query)

    def save_rig(self, rig_id: str, path: PathLike) -> Path:
        """Save the newest orientation as the file's name says: `opencv.yaml` or `rig.json`."""
        path = Path(path)
        return self._save(path, address("rigs", rig_id, "exports", path.name))
