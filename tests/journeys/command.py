"""The door of the `stilb` command."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from tests.journeys.door import Certificate, Door
from tests.journeys.plan import Corners, Figure, File, Plan, pick
from tests.support.compose import ROOT

# Done, and done with problems: a frame that is refused, or fails.
_DONE = (0, 1)
_FLIGHT = {
    "focal_length_mm": "--focal-length",
    "pixel_pitch_um": "--pixel-pitch",
    "ground_speed_m_s": "--speed",
    "distance_m": "--height",
}


class Command(Door):
    """docs/command-line.md, and `--help`: a copy of the card with a campaign.toml in it."""

    def __enter__(self):
        self._run("login", self.url, "--key", self.key)
        return self

    def register(self, plan: Plan) -> None:
        """`stilb campaign run` does."""

    def begin(self, plan: Plan) -> None:
        card = self._card(plan)
        # a card may be a folder of another plan's
        shutil.copytree(plan.folder, card, copy_function=os.link, dirs_exist_ok=True)
        named = [word for name, value in plan.camera.items() for word in (f"--{name}", str(value))]
        self._run("campaign", "init", str(card), *named, "--method", plan.method, "--project", plan.number)
        # what the form offers stays, but for the files that it thinks of
        form = (card / "campaign.toml").read_text().partition("[[frames]]")[0]
        said = {name: value for name, value in plan.details.items() if name != "target"}
        filled = form.replace("[campaign]\n", "[campaign]\n" + _lines(said))
        tables = [("[[meter]]", meter) for meter in plan.meters]
        if plan.is_flat:
            self._move_field(plan)  # the rest is proposed
        else:
            tables += _describe_frames(plan)
        if plan.panel:
            tables.append(("[panel]", plan.panel))
        if target := plan.details.get("target"):
            tables.append(("[target]", target))
        self._write(plan, filled + _tables(tables))

    def send(self, plan: Plan) -> None:
        self._run("campaign", "run", str(self._card(plan)), "--no-fit", codes=_DONE)

    def set_region(self, plan: Plan) -> None:
        if plan.regions is None:
            self._run("roi", plan.number, "--polygon", _corners(plan.region))
            return
        drawn = {name: [list(corner) for corner in corners] for name, corners in plan.regions.items()}
        self._write(plan, _tables([("[region.parts]", drawn)]), mode="a")
        self.send(plan)

    def type_readings(self, plan: Plan) -> None:
        """Save the spreadsheet on the card, and run the same command again."""
        names = self._read_proposal(plan) if plan.is_flat else {}
        (self._card(plan) / "readings.csv").write_text(plan.write_spreadsheet(names))
        self._write(plan, _tables([("[readings]", {"file": "readings.csv"})]), mode="a")
        self.send(plan)

    def fit(self, plan: Plan) -> str:
        said = [word for pair in plan.params.items() for word in ("--set", "{}={}".format(*pair))]
        return self._ask("calibrate", plan.number, *said)["id"]

    def publish(self, version: str, *, valid_from: str, valid_to: str | None = None, reason: str) -> None:
        until = ["--to", valid_to] if valid_to else []
        self._run("publish", version, "--from", valid_from, *until, "--reason", reason)

    def look_up(self, plan: Plan, name: str, *, at: str | None = None, **where: float | str) -> Figure:
        said = ["--at", at] if at else []
        items = self._ask("k", plan.camera["serial"], "--method", plan.method, *said)["items"]
        return pick(items, name, where)

    def measure(self, plan: Plan, file: File, region: Corners) -> Figure:
        found = self._ask("measure", "--campaign", plan.number, "--region", _corners(region))
        (mean,) = [each["mean"] for each in found["items"] if each["filename"] == file.path.name]
        return Figure(mean["value"], mean["standard_uncertainty"])

    def judge_fleet(self, method: str, serials: Sequence[str], *, tolerance: float) -> dict[str, str]:
        found = self._ask("fleet", method, *serials, "--tolerance", f"{tolerance:g}")
        return {row["name"]: row["verdict"] for row in found["parameters"]}

    def find_motion_px(self, plan: Plan, file: File, **flight: float) -> float:
        said = [word for name, value in flight.items() for word in (_FLIGHT[name], f"{value:g}")]
        rows = self._ask("motion", plan.number, *said, codes=_DONE)["rows"]
        return next(row["forward_blur_px"] for row in rows if row["filename"] == file.path.name)

    def take_certificate(self, version: str) -> Certificate:
        kept = self.folder / version
        self._run("export", version, str(kept))
        pdf = (kept / "certificate.pdf").read_bytes()
        return Certificate(pdf=pdf, place=kept / "certificate.json", data=kept)

    def _move_field(self, plan: Plan) -> None:
        (self._card(plan) / "field").mkdir()
        for file in plan.files:
            if file.role == "field":
                card = self._card(plan)
                (card / file.path.name).rename(card / "field" / file.path.name)

    def _read_proposal(self, plan: Plan) -> dict[str, str]:
        """Return what the scenes of the card are called: each is one, and holds nothing else."""
        rows = self._ask("push", str(self._card(plan)), "--campaign", plan.number, "--dry-run")["files"]
        proposed = {row["name"].rpartition("/")[2]: (row["role"], row["scene"]) for row in rows}
        pairs = {(file.role, file.scene, proposed[file.path.name]) for file in plan.files}
        assert all(role == said for role, _, (said, _) in pairs), pairs
        names = {scene: name for _, scene, (_, name) in pairs if scene}
        assert len(set(names.values())) == len(names) == len({pair for pair in pairs if pair[1]}), pairs
        return names

    def _card(self, plan: Plan) -> Path:
        return self.folder / plan.number

    def _write(self, plan: Plan, text: str, mode: str = "w") -> None:
        with (self._card(plan) / "campaign.toml").open(mode, encoding="utf-8") as file:
            file.write(text)

    def _ask(self, *words: str, codes: tuple[int, ...] = (0,)) -> Any:
        return json.loads(self._run(*words, "--json", codes=codes))

    def _run(self, *words: str, codes: tuple[int, ...] = (0,)) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "stilb", *words],
            cwd=ROOT,
            env=os.environ | {"XDG_CONFIG_HOME": str(self.folder / "config")},
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode in codes, f"stilb {' '.join(words)}\n{done.stdout}\n{done.stderr}"
        return done.stdout


def _describe_frames(plan: Plan) -> Iterator[tuple[str, dict[str, Any]]]:
    """Files that follow each other and are the same, folder by folder, by the first name and the last."""
    files = sorted(plan.files, key=lambda file: (file.path.parent, file.path.name.casefold()))
    for (folder, role, scene, exposure), group in groupby(
        files, key=lambda file: (file.path.parent, file.role, file.scene, dict(file.exposure))
    ):
        same = [file.path.name for file in group]
        below = folder.relative_to(plan.folder).as_posix()
        said = {"role": role, **({"scene": scene} if scene else {}), **exposure}
        said |= {"pattern": f"{below}/*"} if below != "." else {}
        yield "[[frames]]", said | {"first": same[0], "last": same[-1]}


def _corners(region: Corners) -> str:
    return " ".join(f"{x:g},{y:g}" for x, y in region)


def _tables(tables: list[tuple[str, Any]]) -> str:
    return "".join(f"\n{heading}\n{_lines(content)}" for heading, content in tables)


def _lines(content: Any) -> str:
    return "".join(f"{name} = {_toml(value)}\n" for name, value in content.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_toml(each)}" for name, each in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
