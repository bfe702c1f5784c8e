#!/usr/bin/env python3
"""Closes the loop with an independent path tracer.

Learns a table from a capture of the M-shaped panels, compensates five images,
renders the compensated images with Mitsuba 3 in the scene that the capture was
photographed in, and compares the light of each cell with the wanted one:

    min over s of |photograph - s * wanted| / |s * wanted|,  mean over the images

one s for all channels. Nothing of iltm but its command line is used.

    python3 -m venv venv && venv/bin/pip install mitsuba numpy opencv-python-headless
    venv/bin/python tests/closed_loop.py host-tools/samples/m-panels
"""

import argparse
import csv
import pathlib
import shlex
import subprocess
import tempfile

import cv2
import numpy as np

FOLD = [0.0, -1.0, 0.0, -1.0, 0.0]  # z of the panels' edges at x = -2 .. 2
HALF_HEIGHT = 1.25
LOOK_AT = np.array([0.0, 0.0, -0.5])
PROJECTOR = (np.array([-0.4, 0.0, 9.0]), 23.0)  # place, horizontal field of view
CAMERA = (np.array([0.6, 0.3, 9.0]), 27.0)
GREY = [[0.8] * 3] * 4
COLOUR = [[0.85, 0.35, 0.30], [0.8] * 3, [0.30, 0.45, 0.85], [0.8] * 3]
IMAGES = 5
RANGE = (0.2, 0.75)  # of reference white: reachable everywhere in the scene


def read(path):
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SystemExit(f"{path}: cannot be read")
    return image if image.ndim == 2 else image[..., 2::-1]


def write(path, image):
    cv2.imwrite(str(path), image if image.ndim == 2 else image[..., ::-1])


class Capture:
    def __init__(self, folder):
        self.shots = {}
        for line in csv.DictReader(open(folder / "capture.csv")):
            self.shots.setdefault(line["role"], (line["pattern"], line["photo"]))
        settings = folder / "capture.toml"
        text = settings.read_text() if settings.exists() else ""
        self.gamma = 2.0 if "response = 2.0" in text else 1.0
        self.white, self.black = (self.photo(folder, role) for role in ("white", "black"))
        self.grid = read(folder / self.shots["white"][0]).shape[:2]
        self.colour = self.white.ndim == 3

    def photo(self, folder, role):
        image = read(folder / self.shots[role][1])
        return (image / np.iinfo(image.dtype).max) ** self.gamma


def axes(place):
    forward = LOOK_AT - place
    forward /= np.linalg.norm(forward)
    left = np.cross([0, 1, 0], forward)
    left /= np.linalg.norm(left)
    return left, np.cross(forward, left), forward


def cell_of_pixel(capture, pure, sub=12):
    """Cell that each camera pixel sees, -1 where it sees two or less than .57 of one.

    With `pure`, -1 wherever a pixel is not wholly inside one cell."""
    height, width = capture.white.shape[:2]
    rows, cols = capture.grid
    place, fov = CAMERA
    left, up, forward = axes(place)
    tan = np.tan(np.radians(fov / 2))
    share = np.zeros((height * width, rows * cols + 1), np.float32)
    for a in range(sub):
        for b in range(sub):
            x = 1 - 2 * (np.arange(width) + (a + 0.5) / sub) / width
            y = (1 - 2 * (np.arange(height) + (b + 0.5) / sub) / height) * height / width
            ray = forward + tan * (x[None, :, None] * left + y[:, None, None] * up)
            point, hit = intersect(place, ray.reshape(-1, 3))
            cell = project(point, rows, cols)
            cell[~hit] = rows * cols
            share[np.arange(len(cell)), cell] += 1 / sub**2
    ranked = np.sort(share[:, :-1], 1)
    least = 0.995 if pure else 0.57
    clean = (ranked[:, -1] > least) & (ranked[:, -2] < 0.16 * ranked[:, -1])
    return np.where(clean, share[:, :-1].argmax(1), -1)


def intersect(place, rays):
    """First panel hit by each ray."""
    nearest = np.full(len(rays), np.inf)
    for k in range(4):
        x0, z0, slope = k - 2.0, FOLD[k], FOLD[k + 1] - FOLD[k]
        # z = z0 + slope (x - x0)
        along = (z0 + slope * (place[0] - x0) - place[2]) / (rays[:, 2] - slope * rays[:, 0])
        point = place + along[:, None] * rays
        on = (point[:, 0] >= x0) & (point[:, 0] <= x0 + 1) & (abs(point[:, 1]) <= HALF_HEIGHT)
        nearest = np.where(on & (along > 0) & (along < nearest), along, nearest)
    hit = np.isfinite(nearest)
    return place + np.where(hit, nearest, 0)[:, None] * rays, hit


def project(points, rows, cols):
    """Cell of the projector that lights each point, rows * cols outside its frame."""
    place, fov = PROJECTOR
    left, up, forward = axes(place)
    tan = np.tan(np.radians(fov / 2))
    way = points - place
    depth = way @ forward
    col = np.floor((1 - way @ left / depth / tan) / 2 * cols).astype(int)
    row = np.floor((1 - way @ up / depth / tan * cols / rows) / 2 * rows).astype(int)
    inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    return np.where(inside, row * cols + col, rows * cols)


class Scene:
    def __init__(self, capture, samples, pure):
        import mitsuba

        mitsuba.set_variant("scalar_rgb")
        self.mitsuba, self.capture, self.samples = mitsuba, capture, samples
        self.cells = cell_of_pixel(capture, pure)
        self.folder = tempfile.TemporaryDirectory()

    def render(self, pattern, seed):
        """Light of each cell, cells x channels, relative to the projector's white."""
        mi = self.mitsuba
        pattern = np.broadcast_to(pattern.reshape(*self.capture.grid, -1), (*self.capture.grid, 3))
        look = mi.ScalarTransform4f().look_at
        aim = dict(target=list(LOOK_AT), up=[0, 1, 0])
        height, width = self.capture.white.shape[:2]
        scene = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 24, "rr_depth": 100},
            "sensor": {
                "type": "perspective", "fov": CAMERA[1], "fov_axis": "x",
                "to_world": look(origin=list(CAMERA[0]), **aim),
                "film": {"type": "hdrfilm", "width": width, "height": height,
                         "rfilter": {"type": "box"}, "pixel_format": "rgb"},
                "sampler": {"type": "independent"},
            },
            "projector": {
                "type": "projector", "fov": PROJECTOR[1], "fov_axis": "x",
                "to_world": look(origin=list(PROJECTOR[0]), **aim),
                "irradiance": {"type": "bitmap", "raw": True, "filter_type": "nearest",
                               "wrap_mode": "clamp",
                               "bitmap": mi.Bitmap(np.ascontiguousarray(pattern, np.float32))},
            },
        }
        for k, albedo in enumerate(COLOUR if self.capture.colour else GREY):
            corners = [(k - 2 + i, y, FOLD[k + i])
                       for i, y in ((0, -1), (1, -1), (1, 1), (0, 1))]
            ply = pathlib.Path(self.folder.name) / f"{k}.obj"
            lines = [f"v {x} {y * HALF_HEIGHT} {z}" for x, y, z in corners]
            ply.write_text("\n".join([*lines, "f 1 2 3", "f 1 3 4", ""]))
            scene[f"panel{k}"] = {
                "type": "obj", "filename": str(ply), "face_normals": True,
                "bsdf": {"type": "twosided", "bsdf": {
                    "type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}},
            }
        image = np.array(mi.render(mi.load_dict(scene), spp=self.samples, seed=seed))
        return self.by_cell(image if self.capture.colour else image[..., 1:2])

    def by_cell(self, photo):
        flat = photo.reshape(len(self.cells), -1)
        count = self.capture.grid[0] * self.capture.grid[1]
        seen = self.cells >= 0
        pixels = np.bincount(self.cells[seen], minlength=count).clip(1)
        sums = [np.bincount(self.cells[seen], plane[seen], minlength=count) for plane in flat.T]
        return np.stack(sums, 1) / pixels[:, None]


def natural(capture):
    """Images with the 1/f spectrum of natural ones, at grid size, 8-bit."""
    random = np.random.default_rng(11)
    rows, cols = capture.grid
    channels = 3 if capture.colour else 1
    frequency = np.hypot(np.fft.fftfreq(4 * rows)[:, None] * 4 * rows / cols, np.fft.fftfreq(4 * cols))
    frequency[0, 0] = 1
    for _ in range(IMAGES):
        common = random.normal(size=(4 * rows, 4 * cols, 1))
        noise = 0.8 * common + 0.6 * random.normal(size=(4 * rows, 4 * cols, channels))
        image = np.fft.ifft2(np.fft.fft2(noise, axes=(0, 1)) / frequency[..., None], axes=(0, 1)).real
        image = image.reshape(rows, 4, cols, 4, channels).mean((1, 3))
        image = (image - image.min()) / np.ptp(image)
        low, high = RANGE
        yield np.round(255 * (low + (high - low) * image)).astype(np.uint8).squeeze()


def error(photo, wanted):
    scale = (photo * wanted).sum() / (wanted**2).sum()
    return np.linalg.norm(photo - scale * wanted) / np.linalg.norm(scale * wanted)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("--iltm", default="target/release/iltm")
    parser.add_argument("--samples", type=int, default=512, help="paths a pixel")
    parser.add_argument("--pure", action="store_true", help="only pixels wholly inside a cell")
    parser.add_argument("--solve", default="", help="further arguments of `iltm solve`, as one word")
    options = parser.parse_args()
    capture = Capture(options.capture)
    scene = Scene(capture, options.samples, options.pure)
    # Camera units: what makes the rendered flood the photographed one.
    ambient = scene.by_cell(capture.black)
    flood = scene.by_cell(capture.white) - ambient
    rendered = scene.render(np.ones((*capture.grid, 1)), 1)
    unit = (flood * rendered).sum() / (rendered**2).sum()
    residual = np.linalg.norm(flood - unit * rendered) / np.linalg.norm(flood)
    print(f"flood photograph and rendering differ by {residual:.4f}")
    # Dividing by the flood light is what a rig without iltm would do.
    darkest = flood.min()
    results = {"nothing": [], "gain alone": [], "iltm": []}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        table = folder / "table.iltm"
        subprocess.run([options.iltm, "solve", options.capture, "-o", table, *shlex.split(options.solve)], check=True)
        for index, wanted in enumerate(natural(capture)):
            write(folder / "wanted.png", wanted)
            subprocess.run([options.iltm, "compensate", table, folder / "wanted.png", "-o",
                            folder / "input.png", "--linear"], check=True, capture_output=True)
            light = wanted.reshape(len(flood), -1) / 255
            inputs = {
                "nothing": light,
                "gain alone": np.clip(light * darkest / flood, 0, 1),
                "iltm": read(folder / "input.png").reshape(len(flood), -1) / 255,
            }
            for name, drive in inputs.items():
                photo = unit * scene.render(drive, 100 + index) + ambient
                results[name].append(error(photo, light))
    for name, errors in results.items():
        each = " ".join(f"{e:.4f}" for e in errors)
        print(f"{name:11} {np.mean(errors):.4f}   ({each})")


if __name__ == "__main__":
    main()
