"""Rigs: cameras that are mounted together, and how they are oriented against each other."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from stilb.problem import missing
from stilb.records import Rig
from stilb.resources.equipment import Equipment
from stilb.transport import Call, address


class Rigs(Equipment):
    """Rigs of cameras."""

    def create_rig(self, name: str, camera_ids: Sequence[str]) -> Rig:
        """Cameras that are mounted together, the reference first; the same again is the same rig."""
        return Rig.of(self._post(address("rigs"), {"name": name, "camera_ids": list(camera_ids)}))

    def find_rig(self, named: str) -> Rig:
        """The rig with this id or name."""
        every = [Rig.of(row) for row in self._transport.items(address("rigs"))]
        found = next((one for one in every if named in {one.id, one.name}), None)
        if found is None:
            names = ", ".join(one.name for one in every)
            raise missing(f"No rig is named {named!r}. Registered: {names or 'none yet'}.")
        return found

    def rig_orientation(
        self, rig_id: str, *, tolerance_deg: float | None = None, tolerance_m: float | None = None
    ) -> dict[str, Any]:
        """The orientation of each camera by set, and its stability over the sets, as it is answered."""
        query = {"tolerance_deg": tolerance_deg, "tolerance_m": tolerance_m}
        return self._get(address("rigs", rig_id, "orientation"), query)

    def rig_certificate(self, rig_id: str) -> dict[str, Any]:
        """The certificate of the newest orientation, as it is answered."""
        return self._get(address("rigs", rig_id, "certificate.json"))

    def save_rig(self, rig_id: str, path: PathLike[str] | str) -> Path:
        """Save the newest orientation as the file's name says.

        For another program `opencv.yaml` or `rig.json`; `certificate.pdf` and `certificate.json` too.
        """
        path = Path(path)
        folder = () if path.stem == "certificate" else ("exports",)
        where = address("rigs", rig_id, *folder, path.name)
        self._transport.download(Call(method="GET", path=where, query={}), path)
        return path
