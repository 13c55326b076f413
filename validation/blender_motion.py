"""How far from the true surfaces of a capture Blender's cloth moves with what `weft export --to blender` writes.

    blender -b --python validation/blender_motion.py -- WEFT OUT CAPTURE FABRIC ... [--steps N]

WEFT is the program, OUT a folder for scripts and tables, CAPTURE a video capture with truth (of a square swatch held by
its two upper corners), FABRIC a preset or a file, or "blender" for the settings that Blender begins with, N steps of its
solver in a frame of the video (64). The swatch hangs in the true shape of frame 0 until it is still, then its corners
follow the capture's. Distances are between the surfaces at the same (u, v), mean over the vertices, mm: of frame 0, and
mean over the fit frames and the later ones (OUT/CAPTURE.csv); and of each frame, m, as `weft evaluate --json` has them
(OUT/CAPTURE_FABRIC.json, for weft_validate_distance).
"""
import argparse
import json
import os
import struct
import subprocess
import sys
import tomllib

import bpy
import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts"))
from blender_capture import hold, shown_points

# Blender's frames are shorter than the video's: corners go straight on from one to the next.
PARTS = 4  # of a frame of the video
SETTLING = 30 * PARTS  # before frame 0
THICK_AIR = 5  # 1/s, rate at which speed decays while the swatch settles


def read_points(path):
    """Of a .pc2: frames x points x 3."""
    with open(path, "rb") as file:
        count, _, _, frames = struct.unpack("<iffi", file.read(32)[16:])
        return np.fromfile(file, "<f4").reshape(frames, count, 3).astype(float)


def refined(path):
    """Positions of the parts of frames: Lagrange's cubics through four frames."""
    padded = np.concatenate([2 * path[:1] - path[1:2], path, 2 * path[-1:] - path[-2:-1]])
    parts = []
    for s in np.arange(PARTS) / PARTS:
        weights = (-s * (s - 1) * (s - 2) / 6, (s + 1) * (s - 1) * (s - 2) / 2, -(s + 1) * s * (s - 2) / 2,
                   (s + 1) * s * (s - 1) / 6)
        parts.append(sum(w * padded[k:len(padded) - 3 + k] for k, w in enumerate(weights)))
    return np.concatenate([np.stack(parts, axis=1).reshape(-1, path.shape[1]), path[-1:]])


class Capture:
    def __init__(self, folder):
        with open(os.path.join(folder, "capture.toml"), "rb") as file:
            values = tomllib.load(file)
        self.name, self.rate = values["name"], values["video"]["frame_rate"]
        self.fit_frames = values["video"]["fit_frames"][1] + 1
        self.density = values["swatch"]["areal_density"]
        self.shown = read_points(os.path.join(folder, values["truth"]["points"]))
        if self.fit_frames >= len(self.shown):
            sys.exit(f"blender_motion: {self.name}: no frame after the fit frames")
        self.side = round(self.shown.shape[1] ** 0.5)  # vertices
        self.spacing = values["swatch"]["width"] / (self.side - 1)
        paths = np.loadtxt(os.path.join(folder, values["fixture"][0]["motion"]), delimiter=",", skiprows=1)
        self.corners = refined(paths[: len(self.shown), 1:]).reshape(-1, 2, 3)  # left, right; of each part


def averaged(x, weights, axis):
    """Inside: a vertex with its two neighbours along the axis; the rims as they are."""
    y = x.copy()
    inner, before, after = [[slice(None)] * 3 for _ in range(3)]
    inner[axis], before[axis], after[axis] = slice(1, -1), slice(0, -2), slice(2, None)
    y[tuple(inner)] = weights[0] * x[tuple(inner)] + weights[1] * (x[tuple(before)] + x[tuple(after)])
    return y


def surface_of(x, side):
    """Points of the Catmull-Clark surface over the vertices; the corners stay."""
    grid = x.reshape(side, side, 3)
    return averaged(averaged(grid, (2 / 3, 1 / 6), 0), (2 / 3, 1 / 6), 1).reshape(-1, 3)


def vertices_of(shown, side):
    """Whose surface that is."""
    x = shown.copy()
    for _ in range(60):  # each leaves at most 8/9 of the error
        x += shown - surface_of(x, side)
    return x


def hanging_swatch(scene, capture, paths, steps):
    """In the true shape of frame 0, at rest flat."""
    n = capture.side
    start = vertices_of(capture.shown[0], n)
    quads = [(j * n + i, j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i) for j in range(n - 1) for i in range(n - 1)]
    mesh = bpy.data.meshes.new("swatch")
    mesh.from_pydata([tuple(p) for p in start], [], quads)
    swatch = bpy.data.objects.new("swatch", mesh)
    scene.collection.objects.link(swatch)
    bpy.context.view_layer.objects.active = swatch
    swatch.shape_key_add(name="hanging")
    flat = swatch.shape_key_add(name="flat")
    at = np.array([(i * capture.spacing, 0, -j * capture.spacing) for j in range(n) for i in range(n)], np.float32)
    flat.data.foreach_set("co", at.ravel())
    swatch.vertex_groups.new(name="pins").add([0, n - 1], 1.0, "REPLACE")
    hold(scene, swatch, "left", 0, paths[:, 0])
    hold(scene, swatch, "right", n - 1, paths[:, 1])
    modifier = swatch.modifiers.new("Cloth", "CLOTH")
    modifier.settings.rest_shape_key = flat
    modifier.settings.vertex_group_mass = "pins"
    modifier.settings.quality = steps // PARTS
    modifier.collision_settings.use_collision = False
    modifier.point_cache.frame_end = len(paths)
    return swatch, modifier.settings


def settle(cloth, rate):
    """In thick air."""
    air = cloth.air_damping
    thick = max(air, THICK_AIR * 100 * cloth.mass / rate)
    for frame, value in ((1, thick), (SETTLING - 8 * PARTS, thick), (SETTLING - 4 * PARTS, air)):
        cloth.air_damping = value
        cloth.keyframe_insert("air_damping", frame=frame)


def motion(capture, script, steps):
    """Points of the surface, frame by frame; `script`: None for Blender's own settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.gravity = round(capture.rate * PARTS), (0, 0, -9.81)
    paths = np.concatenate([np.repeat(capture.corners[:1], SETTLING, axis=0), capture.corners])
    scene.frame_end = len(paths)
    swatch, cloth = hanging_swatch(scene, capture, paths, steps)
    if script:
        exec(compile(open(script).read(), script, "exec"), {})
    settle(cloth, capture.rate * PARTS)
    found = []
    for frame in range(1, len(paths) + 1):
        scene.frame_set(frame)
        if frame <= SETTLING or (frame - SETTLING - 1) % PARTS:
            continue
        found.append(surface_of(shown_points(swatch).astype(float), capture.side))
    return np.array(found)


def exported(weft, out, capture, fabric):
    name = os.path.splitext(os.path.basename(fabric))[0]
    if name == "fabric":
        name = os.path.basename(os.path.dirname(os.path.abspath(fabric)))
    script = os.path.join(out, f"{capture.name}_{name}.py")
    subprocess.run([weft, "export", fabric, "--to", "blender", "--spacing", str(capture.spacing), "--frame-rate",
                    str(capture.rate * PARTS), "--areal-density", str(capture.density), "--out", script],
                   check=True, stdout=subprocess.DEVNULL)
    return name, script


def evaluation(capture, apart):
    fit = capture.fit_frames
    part = lambda first, last: {"first": first, "last": last, "distance_mean": apart[first:last + 1].mean()}
    return {"fit": part(0, fit - 1), "validation": part(fit, len(apart) - 1),
            "frames": [{"frame": k, "distance_mean": d} for k, d in enumerate(apart)]}


def main():
    parser = argparse.ArgumentParser(prog="blender_motion")
    for name in ("weft", "out", "capture"):
        parser.add_argument(name)
    parser.add_argument("fabrics", nargs="+")
    parser.add_argument("--steps", type=int, default=64)
    a = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    if a.steps < PARTS or a.steps % PARTS:
        parser.error(f"--steps: {a.steps} is not a multiple of {PARTS}")
    os.makedirs(a.out, exist_ok=True)
    capture = Capture(a.capture)
    with open(os.path.join(a.out, f"{capture.name}.csv"), "w") as table:
        def put(line):
            print(line, flush=True)
            table.write(line + "\n")

        put("fabric,frame 0 (mm),fit frames (mm),later frames (mm)")
        for fabric in a.fabrics:
            name, script = (fabric, None) if fabric == "blender" else exported(a.weft, a.out, capture, fabric)
            apart = np.linalg.norm(motion(capture, script, a.steps) - capture.shown, axis=2).mean(axis=1)
            found = evaluation(capture, apart)
            put(f"{name},{1e3 * apart[0]:.2f}," +
                ",".join(f"{1e3 * found[part]['distance_mean']:.2f}" for part in ("fit", "validation")))
            with open(os.path.join(a.out, f"{capture.name}_{name}.json"), "w") as file:
                json.dump(found, file)


main()
