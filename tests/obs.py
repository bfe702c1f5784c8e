#!/usr/bin/env python3
"""Measures OBS's programme on its way through `iltm play`, as docs/players.md sets both up.

OBS plays a film of 320 x 240 pixels and 30 frames/s on one virtual display and sends it; `iltm play`
shows it on another. Nothing of iltm but its command line is used.

    delay      what OBS shows is compared with what `iltm play` shows at the same time, by the number
               that each frame of the film shows in black and white; median of 60 looks
    codes      mean absolute difference between a still picture on the display of `iltm play` and what
               `iltm compensate` makes of it, in codes of 8 bits; then the same where the picture
               comes to `iltm play` in a film of the same coding, without OBS

It needs obs, Xvfb, xdotool, ffmpeg and mpv, a table for 320 x 240 pixels, and numpy and opencv:

    venv/bin/python tests/obs.py panels.iltm host-tools/scenes/mural.png
"""

import argparse
import contextlib
import json
import os
import pathlib
import signal
import socket
import statistics
import subprocess
import tempfile
import time

import cv2
import numpy as np

WIDTH, HEIGHT, RATE = 320, 240, 30
BITS = 10  # of a frame's number
BLOCK = WIDTH // BITS
LOOKS = 60
BEGIN = 15  # seconds for programs to start
CODING = ["-c:v", "mpeg2video", "-b:v", "20M", "-g", "15"]

GLOBAL = """[General]
FirstRun=true
EnableAutoUpdates=false
LastVersion=486539266
[Basic]
Profile=Untitled
ProfileDir=Untitled
SceneCollection=Untitled
SceneCollectionFile=Untitled
[BasicWindow]
SaveProjectors=true
"""

PROFILE = """[General]
Name=Untitled
[Output]
Mode=Advanced
[Video]
BaseCX={width}
BaseCY={height}
OutputCX={width}
OutputCY={height}
FPSCommon={rate}
ColorFormat=NV12
ColorSpace=709
ColorRange=Partial
[AdvOut]
RecType=FFmpeg
FFOutputToFile=false
FFURL=udp://127.0.0.1:{port}?pkt_size=1316
FFFormat=mpegts
FFVBitrate=20000
FFVGOPSize=15
FFVEncoder=mpeg2video
FFVEncoderId=2
FFAEncoder=mp2
FFAEncoderId=86016
"""


@contextlib.contextmanager
def running(command, **more):
    """A program, until the end of the block."""
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    program = subprocess.Popen(command, **{**quiet, **more})
    try:
        yield program
    finally:
        program.send_signal(signal.SIGINT)
        try:
            program.wait(timeout=10)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()


class Display:
    """A virtual display, whose picture Xvfb keeps in a file."""

    def __init__(self, stack, folder):
        folder.mkdir()
        read, write = os.pipe()
        screen = ["-screen", "0", f"{WIDTH}x{HEIGHT}x24", "-fbdir", str(folder)]
        command = ["Xvfb", "-displayfd", str(write), "-nolisten", "tcp", *screen]
        stack.enter_context(running(command, pass_fds=[write]))
        os.close(write)
        with os.fdopen(read) as told:
            self.environment = {**os.environ, "DISPLAY": f":{told.readline().strip()}"}
        self.file = folder / "Xvfb_screen0"

    def picture(self):
        """What it shows: an X window dump, of big-endian numbers before the pixels."""
        dump = self.file.read_bytes()
        head = np.frombuffer(dump[:100], ">u4")
        start = head[0] + 12 * head[19]
        rows = np.frombuffer(dump, np.uint8, head[12] * HEIGHT, start).reshape(HEIGHT, -1)
        return rows[:, : 4 * WIDTH].reshape(HEIGHT, WIDTH, 4)[:, :, :3]


def write_film(path, frames, coding):
    """Frames of blue, green, red as a film."""
    raw = ["-f", "rawvideo", "-pix_fmt", "bgr24", "-s", f"{WIDTH}x{HEIGHT}", "-r", str(RATE), "-i", "-"]
    command = ["ffmpeg", "-v", "error", "-y", *raw, *coding, str(path)]
    subprocess.run(command, input=b"".join(frame.tobytes() for frame in frames), check=True)


def numbered(number):
    """A frame that shows its number, the highest bit first."""
    lit = [255 * (number >> bit & 1) for bit in reversed(range(BITS))]
    row = np.repeat(np.array(lit, np.uint8), BLOCK)
    return np.broadcast_to(row[None, :, None], (HEIGHT, WIDTH, 3))


def number_of(picture):
    """The number that a picture shows, if it shows one clearly."""
    middle = picture[HEIGHT // 2, BLOCK // 2 :: BLOCK].mean(axis=1)
    clear = np.abs(middle - 127) > 40
    return int("".join("1" if light > 127 else "0" for light in middle), 2) if clear.all() else None


def write_obs(home, film, port):
    """OBS's settings: its film, its programme on the whole display, and where it sends it."""
    folder = home / ".config" / "obs-studio"
    profile, scenes = folder / "basic" / "profiles" / "Untitled", folder / "basic" / "scenes"
    profile.mkdir(parents=True)
    scenes.mkdir()
    (folder / "global.ini").write_text(GLOBAL)
    words = {"width": WIDTH, "height": HEIGHT, "rate": RATE, "port": port}
    (profile / "basic.ini").write_text(PROFILE.format(**words))
    item = {"name": "film", "id": 1, "visible": True, "pos": {"x": 0, "y": 0}, "scale": {"x": 1, "y": 1}}
    source = {"is_local_file": True, "local_file": str(film), "looping": True, "hw_decode": False}
    scene = {
        "name": "Untitled",
        "current_scene": "Scene",
        "current_program_scene": "Scene",
        "scene_order": [{"name": "Scene"}],
        "sources": [
            {"id": "scene", "name": "Scene", "settings": {"id_counter": 1, "items": [item]}},
            {"id": "ffmpeg_source", "name": "film", "settings": source},
        ],
        # The programme, on the whole of display 0.
        "saved_projectors": [{"monitor": 0, "type": 2}],
    }
    (scenes / "Untitled.json").write_text(json.dumps(scene))


class Way:
    """From a film to the display of `iltm play`."""

    def __init__(self, arguments, folder):
        self.iltm, self.table, self.folder = arguments.iltm, arguments.table, folder
        self.count = 0

    def play(self, stack, source, options):
        self.count += 1
        display = Display(stack, self.folder / f"play-{self.count}")
        command = [self.iltm, "play", self.table, source, "--", "--ao=null", *options]
        stack.enter_context(running(command, env=display.environment))
        return display

    def obs(self, stack, film, options=()):
        """Both displays: OBS's, and that of `iltm play`."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        shown = self.play(stack, f"udp://127.0.0.1:{port}", options)
        sent = Display(stack, self.folder / f"obs-{self.count}")
        home = self.folder / f"home-{self.count}"
        write_obs(home, film, port)
        environment = {**sent.environment, "HOME": str(home), "LIBGL_ALWAYS_SOFTWARE": "1"}
        environment.pop("XDG_CONFIG_HOME", None)
        command = ["obs", "--startrecording", "--multi", "--disable-updater"]
        stack.enter_context(running(command, env=environment))
        time.sleep(BEGIN)
        # OBS opens its own window last, in front of the programme.
        raised = ["xdotool", "search", "--name", "Fullscreen Projector", "windowraise"]
        subprocess.run(raised, env=sent.environment, check=True, stdout=subprocess.DEVNULL)
        return sent, shown

    def delay(self, film, options):
        """Seconds."""
        with contextlib.ExitStack() as stack:
            sent, shown = self.obs(stack, film, options)
            time.sleep(BEGIN)
            looks = []
            for _ in range(20 * LOOKS):
                time.sleep(0.1)
                numbers = [number_of(display.picture()) for display in (sent, shown)]
                if None not in numbers:
                    looks.append((numbers[0] - numbers[1]) % (1 << BITS))
                if len(looks) == LOOKS:
                    return statistics.median(looks) / RATE
        raise SystemExit("the number of a frame could not be read on both displays")

    @staticmethod
    def codes(wanted, display):
        time.sleep(BEGIN)
        return float(np.abs(display.picture().astype(float) - wanted).mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", help=f"a table for a projector of {WIDTH} x {HEIGHT} pixels")
    parser.add_argument("picture", help="the still picture")
    parser.add_argument("--iltm", default="target/release/iltm")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        way = Way(arguments, folder)
        still = cv2.resize(cv2.imread(arguments.picture), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / "still.png"), still)
        compensate = [arguments.iltm, "compensate", arguments.table, folder / "still.png", "-o", folder / "wanted.png"]
        subprocess.run(compensate, check=True, stdout=subprocess.DEVNULL)
        wanted = cv2.imread(str(folder / "wanted.png")).astype(float)
        write_film(folder / "still.mkv", [still] * RATE, ["-c:v", "png"])
        write_film(folder / "numbers.mkv", [numbered(at) for at in range(1 << BITS)], ["-c:v", "png"])
        colours = ["-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p", "-colorspace", "bt709"]
        write_film(folder / "coded.ts", [still] * RATE, [*colours, *CODING])
        with contextlib.ExitStack() as stack:
            _, shown = way.obs(stack, folder / "still.mkv")
            print(f"codes, through OBS      {way.codes(wanted, shown):.2f}", flush=True)
        with contextlib.ExitStack() as stack:
            shown = way.play(stack, str(folder / "coded.ts"), [])
            print(f"codes, without OBS      {way.codes(wanted, shown):.2f}", flush=True)
        film = folder / "numbers.mkv"
        print(f"delay                   {way.delay(film, []):.2f} s", flush=True)
        print(f"delay, low latency      {way.delay(film, ['--profile=low-latency']):.2f} s", flush=True)


if __name__ == "__main__":
    main()
