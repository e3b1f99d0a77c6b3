"""A head of cameras of 1280 x 1024 px and 10 bits with manual lenses: files state no f-number and no ISO.

Its pictures are drawn cheaply: a mean for each pixel, and normal noise that is cut from one bank.
"""

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from radiometry.geometry.camera import CameraModel, Pose, find_directions
from radiometry.geometry.target import Target as Board
from radiometry.vignetting.falloff import evaluate_curve, find_farthest_corner
from simulation.boards import draw_poses
from simulation.dng import ASCII, LONG, RATIONAL, TiffWriter, append_strip, approximate, describe_image
from simulation.targets import Edge, Star
from tests.journeys.door import Door, conclude
from tests.journeys.plan import Corners, File, Plan, describe_meter

Plane = NDArray[np.float32]

MAKE, MODEL = "Crevis", "MV-CS27U"
SERIALS = ("CS27U-0411", "CS27U-0412")
PITCH_UM = 4.65
ROWS, COLS, WHITE_DN, BLACK_DN = 1024, 1280, 1023, 32.0
ISO, F_CHART, F_NOISE = 100, 4.0, 4.0
# System gain [DN/e-], read noise [e-], and the spread of the pixels' sensitivities.
GAIN, READ_E, PRNU = 0.085, 18.0, 0.006
# k1, k2, k3 of the lens by f-number, about a centre beside the middle of the frame.
FALLOFFS = {
    1.4: (-0.52, 0.16, -0.05),
    2.8: (-0.16, 0.05, -0.02),
    5.6: (-0.06, 0.01, -0.004),
    8.0: (-0.05, 0.008, -0.003),
}
CENTRE = (500.0, 655.0)
NOISE_TIMES_S = (0.002, 0.005, 0.01, 0.02, 0.026)
NOISE_E_PER_S = 400_000.0
BOARD = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 30.0}
_LENS = {"fx_px": 2075.0, "fy_px": 2075.0, "k1": -0.20, "k2": 0.15}
# The principal points of bodies of one model lie some 80 px apart, as the paper found.
BODIES = tuple(
    CameraModel(height_px=ROWS, width_px=COLS, cx_px=cx, cy_px=cy, **_LENS)
    for cx, cy in ((652.0, 520.0), (588.0, 467.0))
)
REPEATS, VIEWS = (3, 2), 5
K_TRUE = 64.0
SCENES = {"bright": 90.0, "middle": 40.0, "dim": 15.0}
LIGHT = ((0.01, 2.8), (0.04, 5.6))
CARD = [(440, 340), (840, 340), (840, 680), (440, 680)]
STREET_CD_M2 = 30.0
EDGE_BLUR_PX = {"centre": 0.72, "top-left": 0.95, "top-right": 0.95, "bottom-left": 1.0, "bottom-right": 0.9}
STAR_CYCLES = 48
DAY = "2026-05-04"
# the corner of a street, where the lens loses light
CORNER: Corners = [(60, 60), (260, 60), (260, 220), (60, 220)]
# a flight of the paper, whose pictures are exposed for 1/400 s
MOTION = {"pixel_pitch_um": PITCH_UM, "focal_length_mm": 9.0, "distance_m": 100.0, "ground_speed_m_s": 15.0}
MOTION_PX = 0.726
_START = datetime(2026, 5, 4, 19, 0, tzinfo=UTC)


@dataclass(frozen=True, kw_only=True)
class Head:
    """What an evening brings home; ``boards`` by body and then by repeat."""

    folder: Path
    vignetting: list[File]
    noise: list[File]
    edges: list[File]
    stars: list[File]
    boards: list[list[list[File]]]
    luminance: list[File]
    street: File


def write_head(folder: Path) -> Head:
    """65 files of 2.6 MB."""
    camera = _Recorder(folder)
    return Head(
        folder=folder,
        vignetting=_take_flats(camera),
        noise=_take_series(camera),
        edges=[camera.take("edges/edge", "chart", F_CHART, _draw(EDGES)) for _ in range(2)],
        stars=[camera.take("stars/star", "chart", F_CHART, _draw(STARS)) for _ in range(2)],
        boards=_take_boards(camera),
        luminance=_take_scenes(camera),
        street=camera.take(
            "luminance/field/f2.8", "field", 2.8, _see(STREET_CD_M2, 0.0025, 2.8), time_s=0.0025
        ),
    )


EDGES = [
    Edge(name=name, row0=row, col0=col, height=160, width=100, blur_px=EDGE_BLUR_PX[name], angle_deg=angle)
    for name, row, col, angle in (
        ("centre", 432, 590, 5.0),
        ("top-left", 10, 10, 7.0),
        ("top-right", 10, 1170, 4.5),
        ("bottom-left", 854, 10, 6.0),
        ("bottom-right", 854, 1170, 8.0),
    )
]
STARS = [
    Star(
        name=name,
        row0=row,
        col0=col,
        size=320,
        centre_row_px=row + 160.0,
        centre_col_px=col + 160.0,
        cycles=STAR_CYCLES,
        blur_px=blur,
        bars=True,
    )
    for name, row, col, blur in (("centre", 352, 480, 0.72), ("top-left", 10, 10, 0.95))
]


class _Recorder:
    """The bodies of the head, and an operator who names files by the f-number: a file for each mean."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._random = np.random.default_rng(20120301)
        self._bank = self._random.standard_normal(3 * ROWS * COLS, dtype=np.float32)
        self._unequal = 1.0 + np.float32(PRNU) * self._random.standard_normal((ROWS, COLS), dtype=np.float32)
        self._taken = 0

    def take(
        self,
        name: str,
        role: str,
        f_number: float,
        mean_e: Plane | float,
        *,
        scene: str | None = None,
        time_s: float = 0.01,
        body: int = 0,
    ) -> File:
        self._taken += 1
        path = self._folder / f"{name}-{self._taken:03}.tif"
        path.parent.mkdir(parents=True, exist_ok=True)
        start = int(self._random.integers(2 * ROWS * COLS))
        noise = self._bank[start : start + ROWS * COLS].reshape(ROWS, COLS)
        electrons = np.minimum(mean_e * self._unequal, (WHITE_DN + 30.0) / GAIN)
        drawn = BLACK_DN + GAIN * (electrons + np.sqrt(electrons + np.float32(READ_E**2)) * noise)
        samples = (np.clip(drawn, 0, WHITE_DN) + np.float32(0.5)).astype(np.uint16)
        at = _START + timedelta(seconds=20 * self._taken)
        _write(path, samples, serial=SERIALS[body], time_s=time_s, taken_at=at)
        exposure = {} if role == "chart" else {"f_number": f_number, "iso": ISO}
        return File(path=path, role=role, scene=scene, exposure=exposure)


def _take_flats(camera: _Recorder) -> list[File]:
    flats = [
        camera.take(f"vignetting/flat-f{f_number:g}", "flat", f_number, 8000.0 * _shade(f_number))
        for f_number in FALLOFFS
        for _ in range(2)
    ]
    return flats + [camera.take("vignetting/dark-f8", "dark", 8.0, 0.0) for _ in range(2)]


def _take_series(camera: _Recorder) -> list[File]:
    lit = [
        camera.take("noise/flat", "flat", F_NOISE, NOISE_E_PER_S * time_s, time_s=time_s)
        for time_s in NOISE_TIMES_S
        for _ in range(2)
    ]
    times_s = (NOISE_TIMES_S[0], NOISE_TIMES_S[-1])
    return lit + [
        camera.take("noise/dark", "dark", F_NOISE, 0.0, time_s=time_s) for time_s in times_s for _ in range(2)
    ]


def _take_scenes(camera: _Recorder) -> list[File]:
    lit = [
        camera.take(
            f"luminance/{scene}/f{f_number:g}",
            "light",
            f_number,
            _see(luminance, time_s, f_number),
            scene=scene,
            time_s=time_s,
        )
        for scene, luminance in SCENES.items()
        for time_s, f_number in LIGHT
    ]
    return lit + [
        camera.take(f"luminance/dark/f{f_number:g}", "dark", f_number, 0.0, time_s=time_s)
        for time_s, f_number in LIGHT
    ]


def _take_boards(camera: _Recorder) -> list[list[list[File]]]:
    random, board = np.random.default_rng(5), Board(**BOARD)
    return [
        [
            [
                camera.take(
                    f"board-{body + 1}-{repeat + 1}/view",
                    "chart",
                    F_CHART,
                    600.0 + 8400.0 * _project(lens, board, pose),
                    body=body,
                )
                for pose in draw_poses(lens, board, random, count=VIEWS)
            ]
            for repeat in range(repeats)
        ]
        for body, (lens, repeats) in enumerate(zip(BODIES, REPEATS, strict=True))
    ]


def _see(luminance_cd_m2: float, time_s: float, f_number: float) -> Plane:
    """Electrons of an even surface: those of K, less what the lens loses."""
    return K_TRUE * time_s * ISO * luminance_cd_m2 / f_number**2 / GAIN * _shade(f_number)


def _shade(f_number: float) -> Plane:
    rows, cols = np.arange(ROWS)[:, None] - CENTRE[0], np.arange(COLS)[None, :] - CENTRE[1]
    squared = (rows**2 + cols**2) / ((ROWS**2 + COLS**2) / 4.0)
    return evaluate_curve(squared, FALLOFFS[f_number]).astype(np.float32)


def _draw(parts: list[Edge] | list[Star]) -> Plane:
    share = np.full((ROWS, COLS), 0.5, np.float32)
    for each in parts:
        box = each.fill()
        share[each.row0 : each.row0 + box.shape[0], each.col0 : each.col0 + box.shape[1]] = box
    return 800.0 + 8000.0 * share


def _project(lens: CameraModel, board: Board, pose: Pose) -> Plane:
    """Shares of a board's light, the edges of its squares softened where they lie."""
    step = 8
    # places on the board are smooth: those between are interpolated
    rows, cols = np.arange(0, ROWS + step, step), np.arange(0, COLS + step, step)
    places = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2).astype(np.float64)
    directions = find_directions(lens, places)
    turned, _ = cv2.Rodrigues(pose.rotation)
    origin = turned.T @ pose.shift
    rays = np.column_stack((directions, np.ones(len(directions)))) @ turned
    on_board = (rays[:, :2] * (origin[2] / rays[:, 2:]) - origin[:2]) / board.square_size_mm + 1.0
    coarse = on_board.reshape(len(rows), len(cols), 2).astype(np.float32)
    at = np.meshgrid(*(np.arange(size, dtype=np.float32) / step for size in (COLS, ROWS)))
    u, v = cv2.split(cv2.remap(coarse, *at, cv2.INTER_LINEAR))
    # an edge rises over about 1.5 px
    steepness = lens.fx_px * board.square_size_mm / float(pose.shift[2]) / math.pi / 0.75
    across, down = (
        np.clip(np.sin(np.float32(math.pi) * each) * np.float32(steepness), -1, 1) for each in (u, v)
    )
    inside = (u >= 0) & (u < board.columns + 1) & (v >= 0) & (v < board.rows + 1)
    near = (u >= -1) & (u < board.columns + 2) & (v >= -1) & (v < board.rows + 2)
    return np.where(inside, 0.5 - 0.5 * across * down, np.where(near, 1.0, 0.5)).astype(np.float32)


def _write(
    path: Path, samples: NDArray[np.uint16], *, serial: str, time_s: float, taken_at: datetime
) -> None:
    """A grey TIFF of 16 bits that states the levels of its 10."""
    writer = TiffWriter()
    exif = writer.directory(
        {
            33434: (RATIONAL, approximate(time_s)),  # ExposureTime
            36867: (ASCII, f"{taken_at:%Y:%m:%d %H:%M:%S}"),  # DateTimeOriginal
            36881: (ASCII, "+00:00"),  # OffsetTimeOriginal
            42033: (ASCII, serial),  # BodySerialNumber
        }
    )
    image = describe_image(samples, photometric=1) | append_strip(writer, samples)
    tags = {
        271: (ASCII, MAKE),
        272: (ASCII, MODEL),
        34665: (LONG, exif),
        50714: (RATIONAL, approximate(BLACK_DN)),  # BlackLevel
        50717: (LONG, WHITE_DN),  # WhiteLevel
    }
    path.write_bytes(writer.finish(writer.directory(image | tags)))


def plan_head(head: Head, *, certified: bool) -> dict[str, Plan]:
    """A campaign for each question of the evening, by what it is for; the boards by body and repeat."""

    def plan(folder: str, method: str, files: list[File], *, body: int = 0, **more) -> Plan:
        camera = {"make": MAKE, "model": MODEL, "serial": SERIALS[body]}
        return Plan(
            folder=head.folder / folder,
            camera=camera,
            method=method,
            number=f"HEAD-{folder}",
            files=files,
            **more,
        )

    pitch = {"pixel_pitch_um": PITCH_UM}
    plans = {
        "vignetting": plan("vignetting", "vignetting", head.vignetting),
        "noise": plan("noise", "noise", head.noise),
        "edges": plan(
            "edges", "sharpness", head.edges, regions=_bound(EDGES), params=pitch,
            details={"target": {"kind": "slanted_edge"}},
        ),
        "stars": plan(
            "stars", "sharpness", head.stars, regions=_bound(STARS), params=pitch,
            details={"target": {"kind": "siemens_star", "cycles": STAR_CYCLES}},
        ),
    }  # fmt: skip
    for body, repeats in enumerate(head.boards):
        for repeat, files in enumerate(repeats, start=1):
            name = f"board-{body + 1}-{repeat}"
            target = {"target": BOARD}
            plans[name] = plan(name, "geometry", files, body=body, details=target, params=pitch)
    plans["luminance"] = plan(
        "luminance",
        "luminance",
        [*head.luminance, head.street],
        region=CARD,
        meters=[describe_meter("luminance", "LS-150", "30011942", certified=certified)],
        readings=[
            {"scene": scene, "quantity": "luminance", "value": value, "unit": "cd/m2"}
            for scene, value in SCENES.items()
        ],
        params={"vignetting_id": "in_force"},
    )
    return plans


def _bound(parts: list[Edge] | list[Star]) -> dict[str, Corners]:
    return {each.name: each.region.polygon.points for each in parts}


def travel(door: Door, head: Head, *, certified: bool) -> None:
    """From the lens and the sensor of one body to a street measured with both, and a verdict on two."""
    plans = plan_head(head, certified=certified)
    truths = list_truths()
    for name, plan in plans.items():
        door.register(plan)
        door.begin(plan)
        door.send(plan)
        if plan.region or plan.regions:
            door.set_region(plan)
        if plan.readings:
            door.type_readings(plan)
        version = door.fit(plan)
        door.publish(version, valid_from=DAY, reason="first evening")
        coefficient, truth, where = truths[name]
        found = door.look_up(plan, coefficient, at=DAY, **where)
        assert found.agrees(truth), (name, found, truth)
    measured = door.measure(plans["luminance"], head.street, CORNER)
    assert measured.agrees(STREET_CD_M2, within=2.0), measured
    verdicts = door.judge_fleet("geometry", SERIALS, tolerance=2.0)
    assert verdicts["cx_px"] == verdicts["cy_px"] == "per_camera", verdicts
    blur_px = door.find_motion_px(plans["luminance"], head.street, **MOTION)
    assert abs(blur_px - MOTION_PX) < 0.001, blur_px
    conclude(door, version)


def _transfer(cycles_per_pixel: float, blur_px: float) -> float:
    half_pixel = float(np.sinc(cycles_per_pixel / 2.0))
    return math.exp(-2.0 * (math.pi * blur_px * cycles_per_pixel) ** 2) * half_pixel


def list_truths() -> dict[str, tuple[str, float, dict[str, float | str]]]:
    """A coefficient of each campaign, its true value, and where it holds."""
    corner = find_farthest_corner(ROWS, COLS, centre_px=CENTRE)
    squared = math.dist(corner, CENTRE) ** 2 / ((ROWS**2 + COLS**2) / 4.0)
    falloff = 1.0 - float(evaluate_curve(np.array(squared), FALLOFFS[1.4]))
    blur_px = EDGE_BLUR_PX["centre"]
    mtf50 = math.sqrt(math.log(2.0) / 2.0) / math.pi / blur_px
    # stars are drawn as means over half a pixel, and compared with their outermost rings
    outer = STAR_CYCLES / (2.0 * math.pi * 150.0)
    resolved = brentq(lambda f: _transfer(f, blur_px) - 0.1 * _transfer(outer, blur_px), 0.2, 0.6)
    boards = {
        f"board-{body + 1}-{repeat + 1}": ("cx_px", BODIES[body].cx_px, {})
        for body, repeats in enumerate(REPEATS)
        for repeat in range(repeats)
    }
    return boards | {
        "vignetting": ("corner_falloff", falloff, {"f_number": 1.4}),
        "noise": ("system_gain_dn_per_e", GAIN, {}),
        "edges": ("mtf50_cycles_per_pixel", mtf50, {"model": "slanted_edge:centre"}),
        "stars": ("resolving_power_cycles_per_pixel", resolved, {"model": "siemens_star:centre"}),
        "luminance": ("luminance_k", K_TRUE, {}),
    }
