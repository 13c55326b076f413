"""How far from the true surfaces of a capture ARCSim's cloth moves with what `weft export --to arcsim` writes.

    python3 validation/arcsim_motion.py ARCSIM WEFT OUT CAPTURE FABRIC ... [--steps N]

ARCSIM and WEFT are the programs, OUT a folder for scenes and tables, CAPTURE a video capture with truth (of a square
swatch held by its two upper corners), FABRIC a preset or a file, N steps in a frame of the video (16). The swatch hangs
in the true shape of frame 0, on the cells of the truth, until it is still, then its corners follow the capture's. What
is printed and written is that of blender_motion.py.
"""
import argparse
import os

import numpy as np
from arcsim import GRAVITY, Sheet, exported
from filmed_swatch import Capture, Report, name_of, surface_of, vertices_of

SETTLING = 150  # frames before frame 0
RETURNING = 10  # of those, in which the corners go where they belong


def motion(arcsim, folder, fabric, capture, steps):
    """Points of the surface, frame by frame."""
    n = capture.side - 1
    width, step = n * capture.spacing, 1 / (capture.rate * steps)
    sheet = Sheet(arcsim, folder, fabric, width, width, n, n, start=vertices_of(capture.shown[0], capture.side))
    weight, corners = (0, 0, -GRAVITY), (0, n)
    # ARCSim relaxes what it begins with, without its weight, the corners, too.
    relaxed = np.array(sheet.frames(weight, step, 1)[0])[list(corners)]
    away = np.concatenate([np.zeros((1, 2, 3)), np.repeat(capture.corners[:1] - relaxed, SETTLING - RETURNING, axis=0),
                           capture.corners - relaxed])
    times = np.concatenate([[0], np.arange(RETURNING + 1, len(away) + RETURNING)])
    held = {node: np.stack([np.interp(np.arange(times[-1] + 1), times, away[:, k, axis]) for axis in range(3)], axis=1)
            for k, node in enumerate(corners)}
    frames = sheet.frames(weight, step, int(times[-1]) * steps, every=steps, held=held)
    return np.array([surface_of(np.array(x), capture.side) for x in frames[-len(capture.shown):]])


def main():
    parser = argparse.ArgumentParser(prog="arcsim_motion")
    for name in ("arcsim", "weft", "out", "capture"):
        parser.add_argument(name)
    parser.add_argument("fabrics", nargs="+")
    parser.add_argument("--steps", type=int, default=16)
    a = parser.parse_args()
    capture = Capture(a.capture, 1)
    report = Report(a.out, capture)
    for fabric in a.fabrics:
        name = name_of(fabric)
        folder = os.path.join(a.out, f"{capture.name}_{name}")
        os.makedirs(folder, exist_ok=True)
        settings = exported(a.weft, fabric, os.path.join(folder, "material.json"), "--areal-density", str(capture.density),
                            "--mesh", "alternating")
        report.add(name, motion(a.arcsim, folder, settings, capture, a.steps))


main()
