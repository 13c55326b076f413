"""What other simulators' studies of a capture have in common: a swatch held by its two upper corners, with the true
surface of each frame, and how far a simulated one is from it."""
import json
import os
import struct
import sys
import tomllib

import numpy as np


def read_points(path):
    """Of a .pc2: frames x points x 3."""
    with open(path, "rb") as file:
        count, _, _, frames = struct.unpack("<iffi", file.read(32)[16:])
        return np.fromfile(file, "<f4").reshape(frames, count, 3).astype(float)


def refined(path, parts):
    """Positions of the parts of frames: Lagrange's cubics through four frames."""
    padded = np.concatenate([2 * path[:1] - path[1:2], path, 2 * path[-1:] - path[-2:-1]])
    positions = []
    for s in np.arange(parts) / parts:
        weights = (-s * (s - 1) * (s - 2) / 6, (s + 1) * (s - 1) * (s - 2) / 2, -(s + 1) * s * (s - 2) / 2,
                   (s + 1) * s * (s - 1) / 6)
        positions.append(sum(w * padded[k:len(padded) - 3 + k] for k, w in enumerate(weights)))
    return np.concatenate([np.stack(positions, axis=1).reshape(-1, path.shape[1]), path[-1:]])


class Capture:
    def __init__(self, folder, parts):
        """`parts` of a frame have corners of their own."""
        with open(os.path.join(folder, "capture.toml"), "rb") as file:
            values = tomllib.load(file)
        self.name, self.rate = values["name"], values["video"]["frame_rate"]
        self.fit_frames = values["video"]["fit_frames"][1] + 1
        self.density = values["swatch"]["areal_density"]
        self.shown = read_points(os.path.join(folder, values["truth"]["points"]))
        if self.fit_frames >= len(self.shown):
            sys.exit(f"{self.name}: no frame after the fit frames")
        self.side = round(self.shown.shape[1] ** 0.5)  # vertices
        self.spacing = values["swatch"]["width"] / (self.side - 1)
        paths = np.loadtxt(os.path.join(folder, values["fixture"][0]["motion"]), delimiter=",", skiprows=1)
        self.corners = refined(paths[: len(self.shown), 1:], parts).reshape(-1, 2, 3)  # left, right; of each part


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


def name_of(fabric):
    name = os.path.splitext(os.path.basename(fabric))[0]
    return os.path.basename(os.path.dirname(os.path.abspath(fabric))) if name == "fabric" else name


def evaluation(capture, apart):
    fit = capture.fit_frames
    part = lambda first, last: {"first": first, "last": last, "distance_mean": apart[first:last + 1].mean()}
    return {"fit": part(0, fit - 1), "validation": part(fit, len(apart) - 1),
            "frames": [{"frame": k, "distance_mean": d} for k, d in enumerate(apart)]}


class Report:
    """Of the fabrics of a capture: lines of OUT/CAPTURE.csv, and OUT/CAPTURE_FABRIC.json."""

    def __init__(self, out, capture):
        os.makedirs(out, exist_ok=True)
        self.out, self.capture = out, capture
        self.table = open(os.path.join(out, f"{capture.name}.csv"), "w")
        self.put("fabric,frame 0 (mm),fit frames (mm),later frames (mm)")

    def put(self, line):
        print(line, flush=True)
        print(line, file=self.table, flush=True)

    def add(self, name, surfaces):
        apart = np.linalg.norm(surfaces - self.capture.shown, axis=2).mean(axis=1)
        found = evaluation(self.capture, apart)
        self.put(f"{name},{1e3 * apart[0]:.2f}," +
                 ",".join(f"{1e3 * found[part]['distance_mean']:.2f}" for part in ("fit", "validation")))
        with open(os.path.join(self.out, f"{self.capture.name}_{name}.json"), "w") as file:
            json.dump(found, file)
