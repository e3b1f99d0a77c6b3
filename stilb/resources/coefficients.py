"""Coefficients in force, now and earlier: the calls of a dashboard and of a notebook."""

from collections.abc import Sequence
from typing import Any

from stilb.details import Moment, as_text
from stilb.method import DEFAULT_METHOD
from stilb.problem import Unclear
from stilb.records import Coefficient, as_times
from stilb.resources.equipment import Equipment
from stilb.transport import address

_K = "luminance_k"


class Coefficients(Equipment):
    """Coefficients by camera and time."""

    def coefficients(
        self,
        camera_id: str,
        *,
        method: str = DEFAULT_METHOD,
        name: str | None = None,
        iso: float | None = None,
        f_number: float | None = None,
        at: Moment | None = None,
        known_at: Moment | None = None,
    ) -> list[Coefficient]:
        """Return the coefficients in force at ``at`` (now), as they were known at ``known_at`` (now).

        With ``f_number``, what was calibrated at that f-number; where it was not, the general value with the
        uncertainty that it has there, flagged.
        Raises ``Problem`` with the code "no_calibration_in_force" where nothing is.
        """
        query = {"method": method, "name": name, "iso": iso, "f_number": f_number}
        times = {"at": _text_of(at), "known_at": _text_of(known_at)}
        rows = self._transport.items(address("cameras", camera_id, "coefficients"), {**query, **times})
        return [Coefficient.of(row) for row in rows]

    def k(
        self,
        camera: str,
        *,
        iso: float | None = None,
        f_number: float | None = None,
        at: Moment | None = None,
        known_at: Moment | None = None,
    ) -> Coefficient:
        """The luminance coefficient K [DN*m2/(cd*s)] of a camera, by its id or its serial.

        With ``f_number``, K at that f-number; see `coefficients`. ``iso`` may be left out where there is
        one K; else ``Unclear`` names the ISO values. Nothing in force: ``Problem`` with the code
        "no_calibration_in_force".
        """
        found = self.coefficients(
            self.find_camera(camera).id, name=_K, iso=iso, f_number=f_number, at=at, known_at=known_at
        )
        if len(found) > 1:
            isos = ", ".join(f"{one.iso:g}" for one in found if one.iso is not None)
            raise Unclear(f"K is in force for several ISO values: {isos}. Give one with iso.")
        return found[0]

    def series(
        self,
        *,
        camera_id: str | None = None,
        method: str | None = None,
        start: Moment | None = None,
        end: Moment | None = None,
    ) -> list[dict[str, Any]]:
        """The coefficients of every version, published for a time in [start, end), as flat rows.

        Every row has the same columns, None where a value is absent, times as aware datetimes: made to be
        handed to ``pandas.DataFrame``.
        """
        times = {"from": _text_of(start), "to": _text_of(end)}
        query = {"camera_id": camera_id, "method": method, **times}
        rows = list(self._transport.items(address("series", "coefficients"), query, member="rows"))
        columns = dict.fromkeys(name for row in rows for name in row)
        return [as_times({name: row.get(name) for name in columns}) for row in rows]

    def fleet_verdict(self, method: str, camera_ids: Sequence[str], *, tolerance: float) -> dict[str, Any]:
        """Judge whether one set of coefficients serves several cameras of a model, and what sharing it costs.

        ``tolerance``: the largest accepted deviation, a share such as 0.04, or of geometry in pixels.
        """
        body = {"method": method, "camera_ids": list(camera_ids), "tolerance": tolerance}
        return self._post(address("fleet", "verdict"), body)


def _text_of(moment: Moment | None) -> str | None:
    return None if moment is None else as_text(moment)
