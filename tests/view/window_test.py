"""The window from outside: a display without a screen, a window manager, and real events of keys and mouse.

window_test.py --tessera PROGRAM --data FOLDER --broken-drivers FOLDER [--mesh FILE --field NAME] [--keep FOLDER]
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from PIL import Image, ImageChops

HERE = pathlib.Path(__file__).parent
WIDTH, HEIGHT, PANEL, STATUS = 900, 640, 340, 26
PICTURE = (PANEL + (WIDTH - PANEL) // 2, (HEIGHT - STATUS) // 2)
PATIENCE = 120
arguments = None


class Window(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-window-test-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        read, write = os.pipe()
        self.start(["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x900x24", "-noreset"], pass_fds=(write,))
        os.close(write)
        with open(read) as lines:
            number = lines.readline().strip()
        self.environment = {**os.environ, "DISPLAY": f":{number}"}
        self.start(["openbox"], env=self.environment)
        time.sleep(0.3)

    def start(self, command, **options):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **options)
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)
        return process

    def view(self, *words, **bricks):
        """Starts the program with a small scene, and waits for its window."""
        scene = self.folder / "first.json"
        scene.write_text(json.dumps({"version": 1, "samples": 1, "bricks": {"resolution": 65, "cells": 8, **bricks}}))
        self.errors = open(self.folder / "errors", "w+")
        self.addCleanup(self.errors.close)
        command = [arguments.tessera, "view", *words, "--scene", scene, "--width", str(WIDTH), "--height", str(HEIGHT),
                   "--save-scene", "scene.json", "--save-picture", "picture.png"]
        self.program = subprocess.Popen([str(word) for word in command], cwd=self.folder, env=self.environment,
                                        stdout=subprocess.DEVNULL, stderr=self.errors)
        self.addCleanup(self.program.wait)
        self.addCleanup(self.program.kill)
        deadline = time.monotonic() + PATIENCE
        while True:
            found = subprocess.run(["xdotool", "search", "--onlyvisible", "--name", "Tessera$"], env=self.environment,
                                   capture_output=True, text=True).stdout.split()
            if found:
                break
            self.assertIsNone(self.program.poll(), (self.folder / "errors").read_text())
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)
        self.window = found[0]
        self.do("windowactivate", "--sync", self.window)

    def do(self, *words):
        subprocess.run(["xdotool", *[str(word) for word in words]], env=self.environment, check=True,
                       stdout=subprocess.DEVNULL, timeout=PATIENCE)

    def title(self):
        return subprocess.run(["xdotool", "getwindowname", self.window], env=self.environment, capture_output=True,
                              text=True).stdout.strip()

    def wait(self, what, condition):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            self.assertIsNone(self.program.poll(), f"{what}: {(self.folder / 'errors').read_text()}")
            self.assertLess(time.monotonic(), deadline, f"{what}: {self.title()}")
            time.sleep(0.02)

    def settle(self, name):
        """Until the picture has converged, for longer than a change takes to begin."""
        for _ in range(3):
            self.wait("converges", lambda: self.title() == f"{name} - Tessera")
            time.sleep(0.15)

    def move(self, x, y):
        self.do("mousemove", "--window", self.window, x, y)

    def drag(self, begin, end, steps=6, button=1):
        self.move(*begin)
        time.sleep(0.15)
        self.do("mousedown", button)
        for step in range(1, steps + 1):
            self.move(*(round(a + (b - a) * step / steps) for a, b in zip(begin, end)))
            time.sleep(0.06)
        time.sleep(0.15)
        self.do("mouseup", button)

    def key(self, name):
        self.do("key", name)
        time.sleep(0.2)

    def saved_scene(self):
        path = self.folder / "scene.json"
        path.unlink(missing_ok=True)
        self.key("ctrl+s")
        self.wait("saves the scene", path.exists)
        return json.loads(path.read_text())

    def shot(self, name):
        """What the window shows, of the whole screen; kept where --keep says."""
        path = self.folder / f"{name}.png"
        dump = subprocess.run(["import", "-window", self.window, str(path)], env=self.environment) if shutil.which("import") else None
        if dump is not None and arguments.keep:
            shutil.copy(path, pathlib.Path(arguments.keep) / path.name)

    def end(self):
        self.key("ctrl+q")
        self.assertEqual(self.program.wait(PATIENCE), 0)
        self.errors.seek(0)
        self.assertEqual(self.errors.read(), "")

    def test_what_is_set_up_by_hand_is_what_render_draws(self):
        mesh = pathlib.Path(arguments.mesh or arguments.data / "disk_out_ref/disk_out_ref.vtu").resolve()
        words = ["--field", arguments.field] if arguments.field else ["--field", "V"] if not arguments.mesh else []
        self.view(mesh, *words)
        self.settle(mesh.name)
        self.shot("opened")
        # A double click: the focus.
        self.move(*PICTURE)
        time.sleep(0.2)
        self.do("click", "--repeat", 2, "--delay", 80, 1)
        time.sleep(0.3)
        self.settle(mesh.name)
        focus = self.saved_scene()["bricks"]["focus"]
        self.assertEqual(len(focus), 1)
        # A new point of the transfer function.
        self.assertNotIn("transfer_function", self.saved_scene())
        self.drag((200, 190), (220, 230))
        scene = self.saved_scene()
        opacities = scene["transfer_function"]["opacity"]
        self.assertGreater(len(opacities), 10)
        # Turned, nearer, a probe, axes of the bricks.
        self.drag(PICTURE, (PICTURE[0] + 60, PICTURE[1] + 30))
        self.move(*PICTURE)
        self.do("click", "--repeat", 2, "--delay", 40, 4)
        self.key("p")
        self.settle(mesh.name)
        scene = self.saved_scene()
        self.assertIn("camera", scene)
        self.assertIn("sphere", scene["effects"]["probes"]["shapes"][0])
        self.shot("probe")
        # Undone and done again.
        self.key("ctrl+z")
        self.assertNotIn("effects", self.saved_scene())
        self.key("ctrl+y")
        self.assertEqual(self.saved_scene(), scene)
        self.settle(mesh.name)
        (self.folder / "picture.png").write_text("somebody else's")
        self.key("ctrl+p")
        picture = self.folder / "picture-2.png"
        self.wait("saves the picture", picture.exists)
        self.assertEqual((self.folder / "picture.png").read_text(), "somebody else's")
        self.end()
        self.assertEqual(scene["size"], [WIDTH - PANEL, HEIGHT - STATUS])
        subprocess.run([arguments.tessera, "render", str(mesh), "--scene", "scene.json", "-o", "drawn.png", "--quiet"], check=True,
                       cwd=self.folder, timeout=PATIENCE)
        shown, drawn = (Image.open(self.folder / name).convert("RGB") for name in (picture.name, "drawn.png"))
        self.assertEqual(shown.size, drawn.size)
        self.assertLessEqual(max(high for _, high in ImageChops.difference(shown, drawn).getextrema()), 1)
        self.assertGreater(len(drawn.getcolors(1 << 24)), 100)
        if arguments.keep:
            for name in (picture.name, "drawn.png", "scene.json"):
                shutil.copy(self.folder / name, arguments.keep)

    def test_windows_are_resized_minimised_and_closed_while_bricks_refine(self):
        data = arguments.data
        self.view(data / "ccx-cavity/cavity.vtu", resolution=257)
        self.wait("opens", lambda: "cavity.vtu" in self.title())
        for size in ((700, 500), (1100, 800), (500, 330), (WIDTH, HEIGHT)):
            self.do("windowsize", "--sync", self.window, *size)
            time.sleep(0.1)
        self.do("windowminimize", self.window)
        time.sleep(0.5)
        self.assertIsNone(self.program.poll())
        self.do("windowmap", self.window)
        self.do("windowactivate", "--sync", self.window)
        for name in ("h", "t", "g", "Tab", "Tab", "h", "x", "f", "v"):
            self.key(name)
        self.drag(PICTURE, (PICTURE[0] - 80, PICTURE[1]), button=3)
        self.assertIsNone(self.program.poll())
        self.end()

    def test_a_file_that_is_dropped_is_opened(self):
        data = arguments.data
        self.view()
        (self.folder / "scenes").mkdir()
        scene = self.folder / "scenes/outline.json"
        scene.write_text(json.dumps({"version": 1, "field": "p", "bricks": {"resolution": 65, "cells": 8},
                                     "effects": {"outline": {"mesh": "../sphere.vtu"}}}))
        shutil.copy(data / "freefem-stokes-sphere/stokes_p1.vtu", self.folder / "sphere.vtu")
        (self.folder / "scene.json").write_text("somebody else's")
        for paths, shown in (([data / "ccx-cavity/cavity.vtu"], "cavity.vtu"),
                             ([self.folder / "first.json"], "cavity.vtu"),
                             ([self.folder / "errors"], "cavity.vtu"),  # no mesh: told, and nothing changes
                             ([scene, self.folder / "sphere.vtu"], "sphere.vtu")):
            dropped = subprocess.run([sys.executable, HERE / "drop_file.py", self.window, *(path.resolve() for path in paths)],
                                     env=self.environment, capture_output=True, text=True, timeout=PATIENCE)
            self.assertEqual(dropped.returncode, 0, dropped.stderr)
            self.settle(shown)
        self.shot("dropped")
        # Nothing that is there is written over; what a scene names is found from where it is saved.
        self.key("ctrl+s")
        saved = self.folder / "scene-2.json"
        self.wait("saves the scene", saved.exists)
        self.assertEqual((self.folder / "scene.json").read_text(), "somebody else's")
        mesh = json.loads(saved.read_text())["effects"]["outline"]["mesh"]
        self.assertTrue(os.path.isabs(mesh))
        self.assertTrue(os.path.samefile(mesh, self.folder / "sphere.vtu"))
        # Keys are those that a keyboard shows: on a German one Z is where others have Y.
        subprocess.run(["setxkbmap", "de"], env=self.environment, check=True, timeout=PATIENCE)
        before = json.loads(saved.read_text())
        saved.unlink()
        for name in ("g", "ctrl+z", "ctrl+s"):
            self.key(name)
        self.wait("saves the scene", saved.exists)
        self.assertEqual(json.loads(saved.read_text()), before)
        self.key("alt+F4")  # as the window manager's button does
        self.assertEqual(self.program.wait(PATIENCE), 0)
        self.assertEqual((self.folder / "errors").read_text(), "")

    def test_a_crash_of_the_display_s_driver_is_one_line(self):
        environment = {**self.environment, "LD_LIBRARY_PATH": f"{arguments.broken_drivers}/gl", "TESSERA_BROKEN_DRIVER": "load"}
        result = subprocess.run([arguments.tessera, "view"], env=environment, capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual((result.returncode, result.stderr),
                         (1, "tessera: no window can be opened: the driver crashed (signal 11, Segmentation fault)\n"))

    def test_without_a_display_there_is_one_line(self):
        environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
        result = subprocess.run([arguments.tessera, "view"], env=environment, capture_output=True, text=True, timeout=PATIENCE)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, r"\Atessera: no window.*\n\Z")
        result = subprocess.run([arguments.tessera, "view", "nowhere.vtu"], env=environment, capture_output=True, text=True,
                                timeout=PATIENCE)
        self.assertEqual((result.returncode, result.stderr), (2, "tessera: nowhere.vtu: there is no such file\n"))
        result = subprocess.run([arguments.tessera, "view", "--help"], env=environment, capture_output=True, text=True)
        self.assertEqual(result.returncode, 0)
        self.assertIn("--frame-time", result.stdout)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--tessera", required=True)
    parser.add_argument("--data", required=True)
    parser.add_argument("--broken-drivers", required=True)
    parser.add_argument("--mesh")
    parser.add_argument("--field")
    parser.add_argument("--keep")
    arguments, rest = parser.parse_known_args()
    arguments.data = pathlib.Path(arguments.data).resolve()
    arguments.tessera = str(pathlib.Path(arguments.tessera).resolve())
    needed = [tool for tool in ("Xvfb", "openbox", "xdotool") if not shutil.which(tool)]
    if needed and not os.environ.get("TESSERA_REQUIRE_GL"):
        print(f"skipped: {', '.join(needed)} can't be found")
        sys.exit(0)
    unittest.main(argv=[sys.argv[0], *rest])
