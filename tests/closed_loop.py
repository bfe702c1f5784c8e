#!/usr/bin/env python3
"""Closes the loop with an independent path tracer, and judges what a viewer sees.

Learns a table from photographs of the M-shaped panels, compensates five natural
images at the projector's resolution, renders them with Mitsuba 3 in the scene
that was photographed, and compares every camera pixel with the image wanted at
the pixel's own place in the projector's picture, found by casting rays. Nothing
of iltm but its command line is used.

Judged is all the light on the wall, ambient light included, as a viewer sees it;
one brightness factor for all pixels and channels is free. Each image is rendered
twice with independent random numbers, and errors are multiplied between the two,
so that the noise of the rendering averages out (not of SSIM and Delta E).

    error       root mean square over pixels and channels, of the wanted light's
    99 %        of the means over 5 x 5 pixels, 99 of 100 are below this
    PSNR, SSIM  of sRGB values, reference white being 1; SSIM by Gaussian windows of 11 x 11
    dE          CIE Delta E 2000, mean over pixels
    projector   the same error of the projector's light alone: ambient subtracted

    python3 -m venv venv
    venv/bin/pip install mitsuba numpy opencv-python-headless scikit-image
    venv/bin/python tests/closed_loop.py host-tools/samples/m-panels

With --session grey or colour, the photographs are made as well: the folder is laid
out by `iltm patterns`, every slide is shown and photographed, and `iltm check` has
its say. There, every rendering uses the same random numbers, and light that bounced
is blurred within its panel: superposition holds exactly, no noise of the rendering
is left, and only the camera adds its own.

With --images, a session learns from so many parts of photographs in colour, or from them in
grey, beside the Bernoulli patterns; none is judged by. --photos 0 leaves the patterns out.

With --refine, the photographs of `iltm verify` are made in the same way, `iltm refine` feeds them
back into the table, and the new table is judged; so many rounds.

With --cells, the mean light of each cell is compared instead, over the pixels that
the cell mostly lights, as the paper does.
"""

import argparse
import csv
import os
import pathlib
import shlex
import subprocess
import tempfile
import tomllib

import cv2
import numpy as np

FOLD = [0.0, -1.0, 0.0, -1.0, 0.0]  # z of the panels' edges at x = -2 .. 2
HALF_HEIGHT = 1.25
LOOK_AT = np.array([0.0, 0.0, -0.5])
PROJECTOR = (np.array([-0.4, 0.0, 9.0]), 23.0)  # place, horizontal field of view
CAMERA = (np.array([0.6, 0.3, 9.0]), 27.0)
GREY = [[0.8] * 3] * 4
COLOUR = [[0.85, 0.35, 0.30], [0.8] * 3, [0.30, 0.45, 0.85], [0.8] * 3]
PIXELS_A_CELL = 8  # of the projector, where capture.toml does not say how many it has
# Sessions: size of the projector's picture and of the camera's, ambient light of white.
SESSIONS = {"grey": ((168, 104), (384, 264), 1.6e-3 / 30), "colour": ((192, 128), (432, 300), 2.4e-3 / 30)}
PROJECTOR_GAMMA = 2.2
METHODS = {"nothing": None, "gain alone": ["--tier", "0"], "iltm": []}


def read(path):
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SystemExit(f"{path}: cannot be read")
    image = image if image.ndim == 2 else image[..., 2::-1]
    return np.atleast_3d(image / np.iinfo(image.dtype).max)


def write(path, image, bits=8):
    codes = np.round(image * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)
    cv2.imwrite(str(path), codes[..., ::-1])


class Capture:
    """White and black photographs, means over all of them, and the sizes of grid and projector."""

    def __init__(self, folder):
        shots = list(csv.DictReader(open(folder / "capture.csv")))
        settings = folder / "capture.toml"
        self.settings = tomllib.loads(settings.read_text()) if settings.exists() else {}
        response = self.settings.get("camera", {}).get("response", 1.0)
        gamma = 1.0 if response == "linear" else float(response)
        photos = lambda role: [read(folder / s["photo"]) ** gamma for s in shots if s["role"] == role]
        self.white, self.black = (np.mean(photos(role), 0) for role in ("white", "black"))
        self.colour = self.white.shape[-1] == 3
        self.grid = next(read(folder / s["pattern"]).shape[:2] for s in shots if s["role"] == "white")
        size = self.settings.get("projector", {}).get("size")
        self.projector = tuple(size[::-1]) if size else tuple(PIXELS_A_CELL * n for n in self.grid)


def axes(place):
    forward = LOOK_AT - place
    forward /= np.linalg.norm(forward)
    left = np.cross([0, 1, 0], forward)
    left /= np.linalg.norm(left)
    return left, np.cross(forward, left), forward


def rays(height, width, sub):
    """Rays through sub x sub points of every camera pixel."""
    left, up, forward = axes(CAMERA[0])
    tan = np.tan(np.radians(CAMERA[1] / 2))
    for a in range(sub):
        for b in range(sub):
            x = 1 - 2 * (np.arange(width) + (a + 0.5) / sub) / width
            y = (1 - 2 * (np.arange(height) + (b + 0.5) / sub) / height) * height / width
            yield (forward + tan * (x[None, :, None] * left + y[:, None, None] * up)).reshape(-1, 3)


def intersect(place, rays):
    """Point on the first panel that each ray hits, and which panel; -1 for none."""
    nearest, panel = np.full(len(rays), np.inf), np.full(len(rays), -1)
    for k in range(4):
        x0, z0, slope = k - 2.0, FOLD[k], FOLD[k + 1] - FOLD[k]
        # z = z0 + slope (x - x0)
        along = (z0 + slope * (place[0] - x0) - place[2]) / (rays[:, 2] - slope * rays[:, 0])
        point = place + along[:, None] * rays
        on = (point[:, 0] >= x0) & (point[:, 0] <= x0 + 1) & (abs(point[:, 1]) <= HALF_HEIGHT)
        nearer = on & (along > 0) & (along < nearest)
        nearest, panel = np.where(nearer, along, nearest), np.where(nearer, k, panel)
    return place + np.where(panel >= 0, nearest, 0)[:, None] * rays, panel


def project(points, panel, rows, cols):
    """Pixel of a picture of rows x cols that lights each point, rows * cols outside it."""
    place, fov = PROJECTOR
    left, up, forward = axes(place)
    tan = np.tan(np.radians(fov / 2))
    way = points - place
    depth = way @ forward
    col = np.floor((1 - way @ left / depth / tan) / 2 * cols).astype(int)
    row = np.floor((1 - way @ up / depth / tan * cols / rows) / 2 * rows).astype(int)
    inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols) & (panel >= 0)
    return np.where(inside, row * cols + col, rows * cols)


class View:
    """Which pixels of a picture the camera sees in each of its own."""

    def __init__(self, camera, picture, sub):
        height, width = self.camera = camera
        self.count = picture[0] * picture[1]
        hits = [intersect(CAMERA[0], ray) for ray in rays(height, width, sub)]
        self.seen = np.stack([project(*hit, *picture) for hit in hits])
        self.panel = hits[len(hits) // 2][1].reshape(camera)
        inside = (self.seen < self.count).all(0).reshape(camera)
        # Pixels at the very border of the projection see light from beyond it.
        self.inside = cv2.erode(inside.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0

    def shown(self, picture):
        """A picture as the camera sees it on a white surface."""
        flat = np.concatenate([picture.reshape(self.count, -1), np.zeros((1, picture.shape[-1]))])
        return flat[self.seen].mean(0).reshape(*self.camera, -1)

    def cell(self):
        """The picture's pixel that each camera pixel sees, -1 where it sees two or less than .57 of one."""
        share = np.zeros((self.seen.shape[1], self.count + 1), np.float32)
        for seen in self.seen:
            share[np.arange(len(seen)), seen] += 1 / len(self.seen)
        ranked = np.sort(share[:, :-1], 1)
        clean = (ranked[:, -1] > 0.57) & (ranked[:, -2] < 0.16 * ranked[:, -1])
        return np.where(clean, share[:, :-1].argmax(1), -1)


class Renderer:
    """Radiance that the camera sees of a projected picture, its white being 1 a solid angle."""

    def __init__(self, camera, aspect, colour, samples, frozen):
        import mitsuba

        fast = "llvm_ad_rgb" if os.environ.get("DRJIT_LIBLLVM_PATH") else "scalar_rgb"
        mitsuba.set_variant(fast)
        self.mi, self.colour, self.samples, self.frozen = mitsuba, colour, samples, frozen
        self.camera, self.aspect, self.seed = camera, aspect, 0
        self.folder = tempfile.TemporaryDirectory()
        self.lit = self.load({"projector": self.projector(np.ones((*aspect, 3)))})
        self.params = mitsuba.traverse(self.lit)
        self.key = next(k for k in self.params.keys() if "irradiance" in k and k.endswith("data"))
        if frozen:
            self.direct = mitsuba.load_dict({"type": "path", "max_depth": 2, "rr_depth": 100})
            panel = View(camera, (1, 1), 1).panel
            self.masks = [(panel == k).astype(np.float32) for k in range(4)]

    def projector(self, picture):
        mi = self.mi
        bitmap = mi.Bitmap(np.ascontiguousarray(picture, np.float32))
        return {
            "type": "projector", "fov": PROJECTOR[1], "fov_axis": "x", "to_world": self.aim(PROJECTOR),
            "irradiance": {"type": "bitmap", "raw": True, "filter_type": "nearest",
                           "wrap_mode": "clamp", "bitmap": bitmap},
        }

    def aim(self, device):
        look = self.mi.ScalarTransform4f().look_at
        return look(origin=list(device[0]), target=list(LOOK_AT), up=[0, 1, 0])

    def load(self, light):
        height, width = self.camera
        scene = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 24, "rr_depth": 100},
            "sensor": {
                "type": "perspective", "fov": CAMERA[1], "fov_axis": "x", "to_world": self.aim(CAMERA),
                "film": {"type": "hdrfilm", "width": width, "height": height,
                         "rfilter": {"type": "box"}, "pixel_format": "rgb"},
                "sampler": {"type": "independent"},
            },
            **light,
        }
        for k, albedo in enumerate(COLOUR if self.colour else GREY):
            corners = [(k - 2 + i, y, FOLD[k + i])
                       for i, y in ((0, -1), (1, -1), (1, 1), (0, 1))]
            obj = pathlib.Path(self.folder.name) / f"{k}.obj"
            lines = [f"v {x} {y * HALF_HEIGHT} {z}" for x, y, z in corners]
            obj.write_text("\n".join([*lines, "f 1 2 3", "f 1 3 4", ""]))
            scene[f"panel{k}"] = {
                "type": "obj", "filename": str(obj), "face_normals": True,
                "bsdf": {"type": "twosided", "bsdf": {
                    "type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}},
            }
        return self.mi.load_dict(scene)

    def channels(self, image):
        image = np.array(image)
        return image if self.colour else image.mean(-1, keepdims=True)

    def dark(self):
        """Ambient light from everywhere, of any brightness."""
        if self.frozen:
            return np.ones((*self.camera, 3 if self.colour else 1))
        scene = self.load({"ambient": {"type": "constant"}})
        return self.channels(self.mi.render(scene, spp=4 * self.samples))

    def light(self, picture):
        picture = np.broadcast_to(np.atleast_3d(picture), (*picture.shape[:2], 3))
        self.params[self.key] = self.mi.TensorXf(np.ascontiguousarray(picture, np.float32))
        self.params.update()
        if not self.frozen:
            self.seed += 1
            return self.channels(self.mi.render(self.lit, spp=self.samples, seed=self.seed))
        whole, direct = (
            np.array(self.mi.render(self.lit, spp=self.samples, seed=1, **how))
            for how in ({}, {"integrator": self.direct})
        )
        return self.channels(direct + self.blurred(whole - direct))

    def blurred(self, light):
        """Light that bounced, blurred within each panel by a hundredth of the picture."""
        sigma = self.camera[1] / 96
        blur = lambda image: cv2.GaussianBlur(image, (0, 0), sigma)
        within = lambda mask: blur(light * mask[..., None]) / np.maximum(blur(mask), 1e-3)[..., None]
        return sum(mask[..., None] * within(mask) for mask in self.masks)


class Wall:
    """Photographs of projected pictures without a camera's noise, in the capture's units."""

    def __init__(self, capture, samples, frozen):
        self.renderer = Renderer(capture.white.shape[:2], capture.grid, capture.colour, samples, frozen)
        view = View(capture.white.shape[:2], capture.grid, 1)
        inside = view.inside
        fit = lambda seen, rendered: (seen * rendered)[inside].sum() / (rendered[inside] ** 2).sum()
        dark = self.renderer.dark()
        self.dark = fit(capture.black, dark) * dark
        flood = self.renderer.light(np.ones(capture.projector))
        self.unit = fit(capture.white - self.dark, flood)
        apart = (self.unit * flood + self.dark - capture.white)[inside]
        apart = np.linalg.norm(apart) / np.linalg.norm(capture.white[inside])
        print(f"flood photograph and rendering differ by {apart:.4f}, noise of both included; "
              f"black is {self.dark[inside].mean() / capture.white[inside].mean():.1%} of white")

    def photograph(self, picture):
        return self.unit * self.renderer.light(picture) + self.dark


def natural(size, colour):
    """Natural images that the scene can show: linear light, 8 bits, from .15 of reference white on."""
    from skimage import data
    from skimage.transform import resize

    for image in (data.astronaut(), data.coffee(), data.chelsea(), data.rocket(), data.camera()):
        image = np.atleast_3d(image / 255.0) * np.ones(3)
        image = resize(image, size, anti_aliasing=True)
        image = 0.15 + 0.85 * cv2.GaussianBlur(image, (0, 0), PIXELS_A_CELL / 2)
        image = image if colour else image.mean(-1, keepdims=True)
        yield np.round(255 * np.clip(image, 0, 1)) / 255


def one_over_f(grid, colour):
    """Images with the 1/f spectrum of natural ones, a pixel a cell, 8 bits, reachable everywhere."""
    random = np.random.default_rng(11)
    rows, cols = grid
    channels = 3 if colour else 1
    frequency = np.hypot(np.fft.fftfreq(4 * rows)[:, None] * 4 * rows / cols, np.fft.fftfreq(4 * cols))
    frequency[0, 0] = 1
    for _ in range(5):
        common = random.normal(size=(4 * rows, 4 * cols, 1))
        noise = 0.8 * common + 0.6 * random.normal(size=(4 * rows, 4 * cols, channels))
        image = np.fft.ifft2(np.fft.fft2(noise, axes=(0, 1)) / frequency[..., None], axes=(0, 1)).real
        image = image.reshape(rows, 4, cols, 4, channels).mean((1, 3))
        image = (image - image.min()) / np.ptp(image)
        yield np.round(255 * (0.2 + 0.55 * image)) / 255


def srgb(light):
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def relative(first, second, wanted, inside):
    """Relative error, 99 % of its means over 5 x 5 pixels, and the factor it is judged by."""
    scale = ((first + second) * wanted)[inside].sum() / 2 / (wanted[inside] ** 2).sum()
    square = ((first - scale * wanted) * (second - scale * wanted)).mean(-1) * inside
    norm = scale**2 * (wanted[inside] ** 2).mean()
    area = cv2.blur(square, (5, 5)) / np.maximum(cv2.blur(inside * 1.0, (5, 5)), 0.2)
    root = lambda value: np.sqrt(max(value, 0) / norm)
    return root(square[inside].mean()), root(np.percentile(area[inside], 99)), scale


def judge(wall, first, second, wanted, inside):
    from skimage.color import deltaE_ciede2000, rgb2lab
    from skimage.metrics import structural_similarity

    error, worst, scale = relative(first, second, wanted, inside)
    alone = relative(first - wall.dark, second - wall.dark, wanted, inside)[0]
    codes = [srgb(photo / scale) for photo in (first, second)]
    asked = srgb(wanted)
    psnr = -10 * np.log10(((codes[0] - asked) * (codes[1] - asked))[inside].mean())
    seen = srgb((first + second) / 2 / scale)
    ssim = structural_similarity(seen, asked, channel_axis=-1, data_range=1, full=True,
                                 gaussian_weights=True, sigma=1.5, use_sample_covariance=False)[1]
    windows = cv2.erode(inside.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0
    lab = lambda code: rgb2lab(code * np.ones(3))
    difference = deltaE_ciede2000(lab(asked), lab(seen))
    return error, worst, psnr, ssim[windows].mean(), difference[inside].mean(), alone


def by_pixel(wall, capture, compensate, methods=METHODS):
    view = View(capture.white.shape[:2], capture.projector, 4)
    rows = {name: [] for name in methods}
    for image in natural(capture.projector, capture.colour):
        wanted = view.shown(image)
        for name, arguments in methods.items():
            drive = image if arguments is None else compensate(image, arguments)
            photos = [wall.photograph(drive) for _ in range(1 if wall.renderer.frozen else 2)]
            rows[name].append(judge(wall, photos[0], photos[-1], wanted, view.inside))
    if methods is METHODS:
        print(f"{view.inside.sum()} camera pixels, frames of {capture.projector[1]} x {capture.projector[0]}")
        print("             error    99 %   PSNR   SSIM    dE   projector")
    for name, row in rows.items():
        print("{:11} {:7.4f} {:7.3f} {:6.1f} {:6.3f} {:5.2f} {:8.4f}".format(name, *np.mean(row, 0)))


def by_cell(wall, capture, compensate):
    cells = View(capture.white.shape[:2], capture.grid, 12).cell()
    seen, count = cells >= 0, capture.grid[0] * capture.grid[1]

    def light(photo):
        pixels = np.bincount(cells[seen], minlength=count).clip(1)
        planes = photo.reshape(len(cells), -1).T
        sums = [np.bincount(cells[seen], plane[seen], minlength=count) for plane in planes]
        return np.stack(sums, 1) / pixels[:, None]

    # Dividing by the flood light is what a rig without iltm would do.
    flood = light(capture.white - capture.black)
    errors = {name: [] for name in METHODS}
    for image in one_over_f(capture.grid, capture.colour):
        wanted = image.reshape(count, -1)
        drives = {
            "nothing": image,
            "gain alone": np.clip(wanted * flood.min() / flood, 0, 1).reshape(image.shape),
            "iltm": compensate(image, []),
        }
        for name, drive in drives.items():
            photo = light(wall.photograph(drive))
            scale = (photo * wanted).sum() / (wanted**2).sum()
            errors[name].append(np.linalg.norm(photo / scale - wanted) / np.linalg.norm(wanted))
    print("means over cells, one projector pixel a cell")
    for name, each in errors.items():
        print(f"{name:11} {np.mean(each):.4f}")


def photograph_slides(renderer, folder, kind, seed=1):
    """A photograph of every slide of a folder, by a camera of 12 bits that is exposed for white."""
    (width, height), _, ambient = SESSIONS[kind]
    random = np.random.default_rng(seed)
    white = renderer.light(np.ones((height, width)))
    exposure, well, steps = 0.8 / np.percentile(white, 99.5), 20_000, 2**12 - 1
    for slide in sorted((folder / "slides").glob("*.png")):
        light = renderer.light(read(slide) ** PROJECTOR_GAMMA) + ambient
        electrons = random.poisson(np.clip(exposure * light, 0, None) * well)
        photo = (electrons + random.normal(0, 5, light.shape)) / well
        write(folder / "photos" / slide.name, np.round(np.clip(photo, 0, 1) * steps) / steps, 16)


def write_stills(folder, count, colour, seed=1):
    """Parts of photographs that `natural` has none of."""
    from skimage import data

    pictures = [data.coins(), data.moon(), data.immunohistochemistry(), data.hubble_deep_field(), data.retina(),
                data.stereo_motorcycle()[0], data.gravel(), data.clock(), data.brick(), data.grass()]
    random = np.random.default_rng(seed)
    folder.mkdir()
    for at in range(count):
        picture = np.atleast_3d(pictures[at % len(pictures)] / 255.0) * np.ones(3)
        picture = picture if colour else picture.mean(-1, keepdims=True)
        sides = np.array(picture.shape[:2])
        part = (sides * random.uniform(0.4, 0.9)).astype(int)
        top, left = random.integers(0, sides - part)
        write(folder / f"{at:03}.png", picture[top:top + part[0], left:left + part[1]], 8)


def make_session(folder, kind, options):
    """Photographs of every slide of a folder that `iltm patterns` makes."""
    (width, height), camera, _ = SESSIONS[kind]
    given = [f"--rows={options.rows}", f"--cols={options.cols}", f"--photos={options.photos}"]
    with tempfile.TemporaryDirectory() as scratch:
        if options.images:
            stills = pathlib.Path(scratch) / "stills"
            write_stills(stills, options.images, kind == "colour")
            given.append(f"--images={stills}")
        subprocess.run([options.iltm, "patterns", "-o", folder, "--projector", f"{width}x{height}", *given,
                        "--camera", "linear"], check=True)
    renderer = Renderer(camera[::-1], (height, width), kind == "colour", options.samples, True)
    photograph_slides(renderer, folder, kind)
    subprocess.run([options.iltm, "check", folder], check=True)


def without_code(capture, folder):
    """The same session without photographs of the Gray code and of stripes."""
    folder.mkdir()
    for part in capture.iterdir():
        if part.name not in ("capture.csv", "stripes.csv"):
            (folder / part.name).symlink_to(part.resolve())
    lines = (capture / "capture.csv").read_text().splitlines(keepends=True)
    kept = [line for line in lines if not line.split(",")[1].startswith(("column-", "row-"))]
    (folder / "capture.csv").write_text("".join(kept))
    return folder


def compare_places(options, learned, scratch):
    """How far the places that images say are from those that stripes say."""
    maps = []
    for at, capture in enumerate((options.capture, learned)):
        subprocess.run([options.iltm, "check", capture, "--map", scratch / f"{at}.npy"], check=True, capture_output=True)
        maps.append(np.load(scratch / f"{at}.npy"))
    off = np.hypot(*np.moveaxis(maps[1] - maps[0], -1, 0))
    known = np.isfinite(off)
    print(f"places by images are off those by stripes by {np.median(off[known]):.3f} projector pixels (median), "
          f"{np.percentile(off[known], 95):.3f} (95 %); known are {known.sum()} of {np.isfinite(maps[0][..., 0]).sum()}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path, help="the folder; with --session it is made if there is none")
    parser.add_argument("--iltm", default="target/release/iltm")
    parser.add_argument("--session", choices=SESSIONS, help="photographs of a whole session, made here")
    parser.add_argument("--photos", type=int, default=60, help="Bernoulli photographs of a session")
    parser.add_argument("--images", type=int, default=0, help="images of a session that is made")
    parser.add_argument("--no-code", action="store_true",
                        help="learn from white, black and pictures alone, without Gray code and stripes")
    parser.add_argument("--rows", type=int, help="rows of cells of a session that is made")
    parser.add_argument("--cols", type=int, help="columns of them")
    parser.add_argument("--samples", type=int, default=512, help="paths a pixel; of a session's photographs, 192 do")
    parser.add_argument("--cells", action="store_true", help="compare the mean light of each cell")
    parser.add_argument("--refine", type=int, default=0, help="rounds of `iltm refine`, of a session")
    parser.add_argument("--table", help="judge this table instead of learning one")
    parser.add_argument("--solve", default="", help="further arguments of `iltm solve`, as one word")
    options = parser.parse_args()
    if options.session and not options.capture.exists() and not (options.rows and options.cols):
        parser.error("a session that is made needs --rows and --cols")
    if options.refine and not options.session:
        parser.error("--refine photographs the wall as sessions do: give --session")
    if options.session and not options.capture.exists():
        make_session(options.capture, options.session, options)
    capture = Capture(options.capture)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        table = options.table or scratch / "table.iltm"
        if not options.table:
            learned = without_code(options.capture, scratch / "capture") if options.no_code else options.capture
            if options.no_code:
                compare_places(options, learned, scratch)
            subprocess.run([options.iltm, "solve", learned, "-o", table, *shlex.split(options.solve)], check=True)

        def compensate(image, arguments):
            write(scratch / "wanted.png", image)
            subprocess.run([options.iltm, "compensate", table, scratch / "wanted.png", "-o", scratch / "input.png",
                            "--linear", *arguments], check=True, capture_output=True)
            return read(scratch / "input.png")

        wall = Wall(capture, options.samples, options.session is not None)
        (by_cell if options.cells else by_pixel)(wall, capture, compensate)
        for at in range(1, options.refine + 1):
            folder, better = scratch / f"verify-{at}", scratch / f"refined-{at}.iltm"
            subprocess.run([options.iltm, "verify", table, "-o", folder], check=True, capture_output=True)
            photograph_slides(wall.renderer, folder, options.session, 1 + at)
            subprocess.run([options.iltm, "refine", table, folder, "-o", better], check=True)
            table = better
            by_pixel(wall, capture, compensate, {f"round {at}": []})


if __name__ == "__main__":
    main()
