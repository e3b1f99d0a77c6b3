"""Cameras, meters and panels: the same make, model and serial again is the same one."""

from collections.abc import Iterator, Sequence
from typing import Any, Unpack

from stilb.connection import Connection
from stilb.details import CameraChange, CameraDetails, Certificate, PanelBand
from stilb.problem import Problem, Unclear, missing
from stilb.records import Camera, Meter, Panel
from stilb.transport import Call, address


class Equipment(Connection):
    """Cameras, meters and panels."""

    def create_camera(self, make: str, model: str, serial: str, **details: Unpack[CameraDetails]) -> Camera:
        body = {"make": make, "model": model, "serial": serial, **details}
        return Camera.of(self._post(address("cameras"), body))

    def change_camera(self, camera_id: str, **details: Unpack[CameraChange]) -> Camera:
        """Correct a camera. With other names the frames of its campaigns are checked again."""
        call = Call(method="PATCH", path=address("cameras", camera_id), json={**details})
        return Camera.of(self._transport.json(call))

    def camera(self, camera_id: str) -> Camera:
        return Camera.of(self._get(address("cameras", camera_id)))

    def cameras(
        self, *, make: str | None = None, model: str | None = None, serial: str | None = None
    ) -> Iterator[Camera]:
        query = {"make": make, "model": model, "serial": serial}
        return map(Camera.of, self._transport.items(address("cameras"), query))

    def find_camera(self, named: str) -> Camera:
        """The camera with this id, this serial, or this make, model and serial with blanks between them."""
        try:
            return self.camera(named)
        except Problem as problem:
            if problem.status != 404:
                raise
        every = list(self.cameras())
        found = [one for one in every if named in {one.serial, f"{one.make} {one.model} {one.serial}"}]
        if len(found) > 1:
            raise Unclear(f"Several cameras are named {named!r}: {_names(found)}. Give the id of one.")
        if not found:
            raise missing(f"No camera is named {named!r}. Registered: {_names(every) or 'none yet'}.")
        return found[0]

    def create_meter(
        self, kind: str, make: str, model: str, serial: str, *, certificate: Certificate | None = None
    ) -> Meter:
        """``kind``: luminance, illuminance or sunshine."""
        body: dict[str, Any] = {"kind": kind, "make": make, "model": model, "serial": serial}
        if certificate is not None:
            body["certificate"] = certificate
        return Meter.of(self._post(address("meters"), body))

    def meters(self) -> Iterator[Meter]:
        return map(Meter.of, self._transport.items(address("meters")))

    def create_panel(self, serial: str, *, measured_on: str, bands: Sequence[PanelBand]) -> Panel:
        """A panel as it was measured on a day; measured again it is another."""
        body = {"serial": serial, "measured_on": measured_on, "bands": list(bands)}
        return Panel.of(self._post(address("panels"), body))

    def panel(self, panel_id: str) -> Panel:
        return Panel.of(self._get(address("panels", panel_id)))

    def panels(self) -> Iterator[Panel]:
        return map(Panel.of, self._transport.items(address("panels")))


def _names(cameras: list[Camera]) -> str:
    return ", ".join(f"{one.make} {one.model} {one.serial} ({one.id})" for one in cameras)
