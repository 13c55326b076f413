"""Runs what `weft export --to blender` writes in Blender, against closed forms.

    blender -b --python validation/blender_cloth.py -- WEFT OUT

WEFT is the program, OUT a folder for the scripts and table.csv. Sheets of known fabrics fall, reach their terminal
speed, hang, swing up and down and bend under their own weight. Expected values are those of Blender's lattice, in which
every vertex has the same mass: sums over its rows instead of integrals, and a chain of hinges instead of the elastica.
Steps a frame are powers of two: with 40 or 80 rounding makes Blender 3.4 take one more than it should.
"""
import math
import os
import subprocess
import sys

import bpy
import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "scripts"))
from blender_capture import shown_points

GRAVITY = 9.81
RATE = 30

PARAMETERS = {
    "stretch_stiffness": (337.5, "N/m"), "shear_stiffness": (0.01, "N/m"), "bend_stiffness": (8.789e-6, "N m"),
    "stretch_damping": (0.09375, "N s/m"), "shear_damping": (0.001, "N s/m"), "bend_damping": (9e-8, "N m s"),
    "diagonal_stiffness": (675, "N/m"), "diagonal_damping": (0.1875, "N s/m"), "drag_linear": (0, "N s/m^3"),
    "drag_quadratic": (0, "N s^2/m^4"), "drag_degradation": (0, "s^2/m^2"), "drag_normal_linear": (0, "N s/m^3"),
}


def script_of(weft, out, name, density, spacing, **changed):
    """The exported script of a fabric that differs from PARAMETERS in `changed`."""
    toml = os.path.join(out, name + ".toml")
    with open(toml, "w") as file:
        file.write(f'format = "weft-fabric"\nversion = 1\nname = "{name}"\nmodel = "baraff-witkin-hinges"\n'
                   f"areal_density = {density}\n[parameters]\n")
        for key, (value, unit) in PARAMETERS.items():
            value = changed.get(key, value)
            lower = 0 if key.startswith("drag") else 1e-12
            file.write(f'{key} = {{ value = {value}, unit = "{unit}", lower = {lower}, upper = 1e6 }}\n')
    script = os.path.join(out, name + ".py")
    subprocess.run([weft, "export", toml, "--to", "blender", "--spacing", str(spacing), "--frame-rate", str(RATE),
                    "--out", script], check=True, stdout=subprocess.DEVNULL)
    return script


def sheet(columns, rows, spacing, vertical):
    """A new scene with a grid of that many quads: hanging, or lying in the x-y plane; row 0 first."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.gravity = RATE, (0, 0, -GRAVITY)
    place = (lambda i, j: (i * spacing, 0, -j * spacing)) if vertical else (lambda i, j: (i * spacing, j * spacing, 0))
    points = [place(i, j) for j in range(rows + 1) for i in range(columns + 1)]
    corner = lambda i, j: j * (columns + 1) + i
    quads = [(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1))
             for j in range(rows) for i in range(columns)]
    mesh = bpy.data.meshes.new("sheet")
    mesh.from_pydata(points, [], quads)
    cloth = bpy.data.objects.new("sheet", mesh)
    scene.collection.objects.link(cloth)
    bpy.context.view_layer.objects.active = cloth
    return cloth


def motion(cloth, script, pinned_rows, columns, frames, quality):
    """Positions of the vertices, frame by frame, from rest."""
    exec(compile(open(script).read(), script, "exec"), {})
    modifier = next(m for m in cloth.modifiers if m.type == "CLOTH")
    modifier.settings.quality = quality
    modifier.collision_settings.use_collision = False
    if pinned_rows:
        cloth.vertex_groups.new(name="pin").add(list(range(pinned_rows * (columns + 1))), 1.0, "REPLACE")
        modifier.settings.vertex_group_mass = "pin"
    modifier.point_cache.frame_end = frames
    scene, found = bpy.context.scene, []
    for frame in range(1, frames + 1):
        scene.frame_set(frame)
        found.append(shown_points(cloth).astype(float))
    return np.array(found)


def fall(weft, out):
    """Distance fallen, m, after a second; the scheme's first-order error in time is taken out."""
    script = script_of(weft, out, "falling", 0.3, 0.025)
    quality = 32
    x = motion(sheet(4, 4, 0.025, False), script, 0, 4, RATE + 1, quality)
    return -x[-1, :, 2].mean(), GRAVITY / 2 * (1 + 1 / (RATE * quality))


def terminal_speed(weft, out):
    drag, density = 0.9, 0.3
    script = script_of(weft, out, "slowed", density, 0.025, drag_normal_linear=drag, drag_linear=drag)
    x = motion(sheet(4, 4, 0.025, False), script, 0, 4, 4 * RATE, 16)
    return (x[-2, :, 2] - x[-1, :, 2]).mean() * RATE, GRAVITY * density / drag


def elongation(weft, out):
    """Of a sheet that hangs by its upper edge; row r carries the rows below it."""
    k, density, h, rows = 30.0, 0.3, 0.0125, 40
    script = script_of(weft, out, "hanging", density, h, stretch_stiffness=k, diagonal_stiffness=1e-3, stretch_damping=2,
                       drag_normal_linear=1.5, drag_linear=1.5)
    x = motion(sheet(4, rows, h, True), script, 1, 4, 4 * RATE, 16)
    return -x[-1, -5:, 2].mean() - rows * h, density * GRAVITY * h * h * rows * (rows + 1) / 2 / k


def decay(weft, out):
    """Rate at which the slowest stretching mode of a hanging sheet decays, 1/s, beside the scheme's own."""
    k, c, density, h, rows, quality = 30.0, 0.3, 0.3, 0.0125, 40, 128
    script = script_of(weft, out, "bouncing", density, h, stretch_stiffness=k, diagonal_stiffness=1e-3, stretch_damping=c,
                       diagonal_damping=1e-6)
    x = motion(sheet(2, rows, h, True), script, 1, 2, RATE + RATE // 2, quality)
    sag = -x[:, -3:, 2].mean(axis=1) - rows * h
    end = density * GRAVITY * h * h * rows * (rows + 1) / 2 / k
    omega = 2 * math.sqrt(k / density) / h * math.sin(math.pi / (2 * (2 * rows + 1)))
    numerical = omega * omega / (2 * RATE * quality)
    # Least squares of a decaying oscillation over the rate and its two amplitudes.
    time = np.arange(len(sag)) / RATE
    skip = 3  # frames, until the faster modes are gone

    def misfit(rate):
        basis = np.stack([np.exp(-rate * time) * np.cos(frequency(rate) * time),
                          np.exp(-rate * time) * np.sin(frequency(rate) * time)], axis=1)[skip:]
        amplitudes = np.linalg.lstsq(basis, (sag - end)[skip:], rcond=None)[0]
        return np.linalg.norm(basis @ amplitudes - (sag - end)[skip:])

    frequency = lambda rate: math.sqrt(max(omega * omega - rate * rate, 0))
    rates = np.linspace(0.5, 15, 2901)
    best = rates[np.argmin([misfit(rate) for rate in rates])]
    return best - numerical, c / k * omega * omega / 2


def chain_tip(bend, weight, links, length):
    """How far the last of `links` links sinks, of which the first is clamped level. `bend`: moment per angle of a hinge,
    `weight`: of each joint. Newton's method on the angles."""
    angle = np.zeros(links)
    below = weight * (links - np.arange(links))  # carried by the outer end of each link
    for _ in range(100):
        differences = np.diff(np.concatenate([[0], angle]))
        gradient = bend * differences
        gradient[:-1] -= bend * differences[1:]
        gradient -= below * length * np.cos(angle)
        hessian = np.diag(below * length * np.sin(angle) + 2 * bend)
        hessian[-1, -1] -= bend
        hessian -= bend * (np.eye(links, k=1) + np.eye(links, k=-1))
        step = np.linalg.solve(hessian, gradient)
        angle -= step / max(1, np.abs(step).max() / 0.3)
    return length * np.sin(angle).sum()


def sinking_tip(weft, out):
    """Of a strip clamped by two rows; its rim has whole masses and no hinges."""
    bend, density, h, rows, columns = 2e-3, 0.2, 0.0125, 17, 8
    script = script_of(weft, out, "bending", density, h, stretch_stiffness=2000, diagonal_stiffness=4000, bend_stiffness=bend,
                       stretch_damping=0.05, diagonal_damping=0.1, bend_damping=1e-7, drag_normal_linear=1, drag_linear=1)
    x = motion(sheet(columns, rows, h, False), script, 2, columns, 6 * RATE, 128)
    expected = chain_tip(bend * columns, density * h * h * (columns + 1) * GRAVITY, rows - 1, h)
    return -x[-1, -(columns + 1):, 2].mean(), expected


def main():
    weft, out = sys.argv[sys.argv.index("--") + 1:]
    os.makedirs(out, exist_ok=True)
    lines = ["what,unit,blender,expected,ratio"]
    for what, unit, study in [("fall in a second", "m", fall), ("terminal speed", "m/s", terminal_speed),
                              ("elongation under its own weight", "m", elongation),
                              ("decay of stretching", "1/s", decay), ("tip of a cantilever", "m", sinking_tip)]:
        found, expected = study(weft, out)
        lines.append(f"{what},{unit},{found:.6g},{expected:.6g},{found / expected:.4f}")
        print(lines[-1], flush=True)
    with open(os.path.join(out, "table.csv"), "w") as file:
        file.write("\n".join(lines) + "\n")


main()
