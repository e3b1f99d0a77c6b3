"""Boards and cameras that are known, and OpenCV's own pictures."""

from dataclasses import replace

import cv2
import numpy as np

from radiometry.fitting.evidence import FrameEvidence, Region
from radiometry.frame.roi import Polygon
from radiometry.geometry.camera import CameraModel, project
from radiometry.geometry.results import Features, Params, extract_features
from radiometry.geometry.target import Target, locate_corners_mm, measure_spacing_px
from simulation.boards import draw_poses, set_up
from tests.radiometry.frames import frame_of

BOARD = Target(kind="checkerboard", columns=9, rows=6, square_size_mm=25.0)
CHARUCO = Target(
    kind="charuco", columns=7, rows=5, square_size_mm=30.0, marker_size_mm=18.0, dictionary="DICT_4X4_50"
)
CAMERA = CameraModel(
    height_px=480,
    width_px=640,
    fx_px=520.0,
    fy_px=515.0,
    cx_px=332.0,
    cy_px=229.0,
    k1=-0.25,
    k2=0.08,
    p1=0.0008,
    p2=-0.0006,
    k3=-0.01,
)
SQUARE = replace(CAMERA, fy_px=520.0)
FREE = Params(fix_aspect_ratio=False)


def simulate(*, seed, count, noise_px, camera=CAMERA, target=BOARD, tilt_deg=35.0):
    random = np.random.default_rng(seed)
    poses = draw_poses(camera, target, random, count=count, tilt_deg=tilt_deg)
    return simulate_rows(camera, target, poses, random, noise_px=noise_px)


def simulate_rows(camera, target, poses, random, *, noise_px):
    """The board's corners with normal noise of ``noise_px`` in row and in col."""
    indices = np.arange(target.corners)
    board = locate_corners_mm(target, indices)
    rows = []
    for number, pose in enumerate(poses):
        seen = project(camera, board, pose.rotation, pose.shift)
        seen = seen + random.normal(0.0, noise_px, seen.shape)
        rows.append(make_row(f"view-{number:03}", camera, target, indices, seen))
    return tuple(rows)


def show(name, header, features, statistics=()):
    """A picture of a chart, as the fit wants it."""
    known = {"role": "chart", "scene": None, "exposure": None, "statistics": statistics}
    return FrameEvidence(frame=name, header=header, features=features, **known)


def make_row(name, camera, target, indices, seen_px):
    """Corners, (corner, 2) row before col, as the fit wants them."""
    places = tuple((float(row), float(col)) for row, col in seen_px)
    hull = cv2.convexHull(seen_px.astype(np.float32))
    features = Features(
        target=target,
        not_found="",
        height_px=camera.height_px,
        width_px=camera.width_px,
        indices=tuple(int(index) for index in indices),
        fitted_px=places,
        fitted_window_px=11,
        spacing_px=measure_spacing_px(target, indices, seen_px),
        board_share=float(cv2.contourArea(hull)) / (camera.height_px * camera.width_px),
    )
    return show(name, make_header(camera), features)


def make_header(camera, *, cfa="grey", bits=12):
    """The header of a raw frame of the camera; one of 8 bits is a picture."""
    studio = set_up(camera, dark_dn=0.0, bright_dn=1.0, noise_dn=0.0, cfa=cfa, bits=bits)
    changes = {"bits_per_sample": bits, "rendered": bits == 8}
    if bits == 8:
        changes |= {"container": "png", "decoder": "imagecodecs"}
    return replace(studio.camera.describe(), **changes)


def make_frame(picture, *, cfa="grey", bits=12):
    """A picture as a frame of whole numbers; a mosaic's sites see it with different strengths."""
    strength = np.ones(picture.shape)
    if cfa not in ("grey", "rgb"):
        for place, colour in enumerate(cfa):
            strength[place // 2 :: 2, place % 2 :: 2] = {"R": 0.5, "G": 1.0, "B": 0.6}[colour]
    white = float((1 << bits) - 1)
    samples = picture * strength
    samples = np.repeat(samples[:, :, None], 3, axis=2) if cfa == "rgb" else samples
    return frame_of(samples, cfa=cfa, black=0.0, white=white, clipped=True)


def whole(frame):
    width, height = frame.width_px, frame.height_px
    corners = [(0, 0), (width, 0), (width, height), (0, height)]
    return [Region(name="", polygon=Polygon.from_points(corners))]


def extract(frame, *, target=BOARD, bits=8):
    size = replace(CAMERA, height_px=frame.height_px, width_px=frame.width_px)
    header = make_header(size, cfa=frame.cfa, bits=bits)
    return extract_features(frame, whole(frame), header=header, target=target)


def read_picture(path):
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    found = extract(frame_of(picture, cfa="grey", black=0.0, white=255.0))
    size = replace(CAMERA, height_px=picture.shape[0], width_px=picture.shape[1])
    return show(path.name, make_header(size, bits=8), found.features, found.statistics)


def transpose(row):
    features = row.features
    return replace(
        row,
        features=replace(
            features,
            height_px=features.width_px,
            width_px=features.height_px,
            fitted_px=tuple((col, row) for row, col in features.fitted_px),
        ),
    )


def with_features(row, **changes):
    return replace(row, features=replace(row.features, **changes))


def values(fit):
    return {each.name: each.value for each in fit.coefficients}


def errors(fit):
    return {each.name: each.standard_uncertainty for each in fit.coefficients}


def raised(fit):
    return {flag.flag for flag in fit.flags}
