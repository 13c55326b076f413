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
import os
import subprocess
import sys

import bpy
import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts"))
from blender_capture import hold, shown_points

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from filmed_swatch import Capture, Report, name_of, surface_of, vertices_of

# Blender's frames are shorter than the video's: corners go straight on from one to the next.
PARTS = 4  # of a frame of the video
SETTLING = 30 * PARTS  # before frame 0
THICK_AIR = 5  # 1/s, rate at which speed decays while the swatch settles


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
    name = name_of(fabric)
    script = os.path.join(out, f"{capture.name}_{name}.py")
    subprocess.run([weft, "export", fabric, "--to", "blender", "--spacing", str(capture.spacing), "--frame-rate",
                    str(capture.rate * PARTS), "--areal-density", str(capture.density), "--out", script],
                   check=True, stdout=subprocess.DEVNULL)
    return name, script


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
    capture = Capture(a.capture, PARTS)
    report = Report(a.out, capture)
    for fabric in a.fabrics:
        name, script = (fabric, None) if fabric == "blender" else exported(a.weft, a.out, capture, fabric)
        report.add(name, motion(capture, script, a.steps))


main()
