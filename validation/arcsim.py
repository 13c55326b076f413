"""Scenes for ARCSim of sheets of a fabric that weft exported."""
import gzip
import json
import math
import os
import struct
import subprocess

GRAVITY = 9.81  # m/s^2
HANDLES = 1e6  # N/m, of what holds a vertex


def exported(weft, fabric, material, *options):
    """Settings of `weft export`, which writes the material."""
    done = subprocess.run([weft, "export", fabric, "--to", "arcsim", "--out", material, "--json", *options],
                          check=True, capture_output=True, text=True)
    return {"material": material, **json.loads(done.stdout)["settings"]}


def read_state(path):
    """Positions of the nodes of the first mesh."""
    with gzip.open(path) as file:
        state = file.read()
    vertices, = struct.unpack_from("<i", state, 16)  # after version, frame, time
    at = 20 + vertices * 8 * (3 + 9)  # place in the material, sizing
    nodes, = struct.unpack_from("<i", state, at)
    size = 4 + 4 + 4 * 24 + 1  # label, flag; embedding, position, older position, velocity; preserve
    return [struct.unpack_from("<3d", state, at + 4 + k * size + 8 + 24) for k in range(nodes)]


class Sheet:
    """A grid of cells, hanging down from y = 0 in the plane z = 0, or begun at `start`; triangles alternate. `degrees`:
    from the axis across the sheet to the weft. The first `held_rows` rows of vertices are held."""

    def __init__(self, arcsim, folder, fabric, length, width, cells, across, degrees=0.0, held_rows=0, damping=None, start=None):
        self.arcsim, self.folder, self.fabric = arcsim, folder, fabric
        self.across, self.held_rows = across, held_rows
        self.damping = fabric["damping"] if damping is None else damping
        os.makedirs(folder, exist_ok=True)
        self.mesh = os.path.join(folder, "grid.obj")
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        with open(self.mesh, "w") as file:
            for j in range(cells + 1):
                for i in range(across + 1):
                    x, y = (i / across - 0.5) * width, -j / cells * length
                    at = (x, y, 0) if start is None else start[j * (across + 1) + i]
                    file.write(f"vt {c * x + s * y:.12g} {-s * x + c * y:.12g}\nv {at[0]:.12g} {at[1]:.12g} {at[2]:.12g}\n")
                    if j < held_rows:
                        file.write("nl 1\n")
            for j in range(cells):
                for i in range(across):
                    a = j * (across + 1) + i + 1
                    b, d = a + 1, a + across + 1
                    e = d + 1
                    for face in ((a, d, b), (b, d, e)) if (i + j) % 2 else ((a, d, e), (a, e, b)):
                        file.write("f " + " ".join(f"{k}/{k}" for k in face) + "\n")

    def frames(self, gravity, step, steps, every=1, held=None):
        """Vertices of each frame of `every` steps. `held`: vertex to what it is moved by at the times of the frames."""
        self.frame_time = step * every
        scene = self.scene(gravity, every, steps // every, held or {})
        frames, scene_file = (os.path.join(self.folder, name) for name in ("frames", "scene.json"))
        os.makedirs(frames, exist_ok=True)
        with open(scene_file, "w") as file:
            json.dump(scene, file)
        with open(os.path.join(self.folder, "log"), "w") as log:
            done = subprocess.run([self.arcsim, "simulateoffline", scene_file, frames], stdout=log, stderr=log,
                                  env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
        if done.returncode:
            raise RuntimeError(f"{self.arcsim} ended with {done.returncode}: see {self.folder}/log")
        return [read_state(os.path.join(frames, f"{k:05d}.bin")) for k in range(steps // every + 1)]

    def run(self, gravity, step, steps):
        return self.frames(gravity, step, steps, every=steps)[-1]

    def scene(self, gravity, every, frames, held):
        motions = [[{"time": k * self.frame_time, "transform": {"translate": list(x)}} for k, x in enumerate(path)]
                   for path in held.values()]
        return {
            "frame_time": self.frame_time, "frame_steps": every, "end_frame": frames,
            # elements that ARCSim finds smaller than a thousandth of this size have no stiffness, all of them without it
            "cloths": [{"mesh": self.mesh, "remeshing": {"size": [1e-3, 1]},
                        "materials": [{"data": self.fabric["material"], "damping": self.damping}]}],
            "motions": motions,
            "handles": ([{"label": 1}] if self.held_rows else []) +
                       [{"nodes": [node], "motion": k} for k, node in enumerate(held)],
            "gravity": gravity,
            "wind": {"density": self.fabric["wind_density"], "drag": self.fabric["wind_drag"]},
            "disable": ["proximity", "strainlimiting", "collision", "remeshing", "separation", "popfilter", "plasticity",
                        "fracture"],
            "magic": {"handle_stiffness": HANDLES},
        }
