"""Runs what `weft export --to arcsim` writes in ARCSim, against closed forms.

    python3 validation/arcsim_cloth.py ARCSIM WEFT OUT

ARCSIM and WEFT are the programs, OUT a folder for scenes and table.csv. Sheets of known fabrics hang, are sheared, bend
and fall under their own weight, along, across and at 45 degrees to the threads.
"""
import csv
import json
import math
import os
import sys

from arcsim import GRAVITY, Sheet, exported


def fabric(out, name, model, density, values):
    """A file of weft's; `values`: name to (value, unit)."""
    path = os.path.join(out, f"{name}.toml")
    with open(path, "w") as file:
        file.write(f'format = "weft-fabric"\nversion = 1\nname = "{name}"\nmodel = "{model}"\nareal_density = {density}\n[parameters]\n')
        for key, (value, unit) in values.items():
            file.write(f'{key} = {{ value = {value}, unit = "{unit}" }}\n')
    return path


def motion_fabric(out, name, density, **changed):
    values = {
        "stretch_stiffness": (60, "N/m"), "shear_stiffness": (25, "N/m"), "bend_stiffness": (2e-5, "N m"),
        "stretch_damping": (0.06, "N s/m"), "shear_damping": (0.025, "N s/m"), "bend_damping": (2e-8, "N m s"),
        "drag_linear": (0, "N s/m^3"), "drag_quadratic": (0, "N s^2/m^4"), "drag_degradation": (0, "s^2/m^2"),
    }
    for key, value in changed.items():
        values[key] = (value, values[key][1] if key in values else "N m")
    return fabric(out, name, "baraff-witkin", density, values)


def table_fabric(out, name, density, membrane, bends):
    """`membrane`: uu, uv, vv, shear at every stretch; `bends`: weft, diagonal, warp, each at five curvatures."""
    values = {}
    for row in ("rest", "weft", "deg22", "deg45", "deg67", "warp"):
        for entry, value in zip(("uu", "uv", "vv", "shear"), membrane):
            values[f"{row}_{entry}"] = (value, "N/m")
    for row, stiffness in zip(("weft", "diagonal", "warp"), bends):
        for k, value in enumerate(stiffness):
            values[f"{row}_bend_{10 * k}"] = (value, "N m")
    return fabric(out, name, "piecewise-linear", density, values)


def hanging_elongation(stiffness, density, length, rows):
    """Of a strip of elements that resist Green's strain, with lumped masses, by its own weight."""
    h, sum_ = length / rows, 0
    for element in range(rows):
        force = density * GRAVITY * (length - (element + 0.5) * h)
        stretch = 1.0
        for _ in range(50):
            stress = stiffness * stretch * (stretch**2 - 1) / 2
            stretch -= (stress - force) / (stiffness * (3 * stretch**2 - 1) / 2)
        sum_ += h * (stretch - 1)
    return sum_


def elastica_drop(stiffness, density, length):
    """Of the tip of a heavy cantilever; `stiffness(curvature)`: secant, N m. Shooting from the clamp."""

    def rotated(moment):  # at the clamp; returns what is left of it at the tip, and the drop
        n = 2000
        h, angle, drop, m = length / n, 0.0, 0.0, moment
        for k in range(n):
            def slopes(s, a, m):
                curvature = 0.0
                for _ in range(60):
                    curvature = m / stiffness(curvature)
                return curvature, -density * GRAVITY * (length - s) * math.cos(a)
            c1, d1 = slopes(k * h, angle, m)
            c2, d2 = slopes((k + 0.5) * h, angle + h / 2 * c1, m + h / 2 * d1)
            drop += h * math.sin(angle + h / 2 * c1)
            angle, m = angle + h * c2, m + h * d2
        return m, drop

    low, high = 0.0, density * GRAVITY * length**2 / 2
    for _ in range(60):
        middle = (low + high) / 2
        if rotated(middle)[0] > 0:
            high = middle
        else:
            low = middle
    return rotated(high)[1]


def extrapolated(a, b, c):
    """Each with twice as many cells as the one before: first and second order taken out."""
    return (a - 6 * b + 8 * c) / 3


def strip_of(across, along, diagonal):
    """N m, of a strip of a grid whose diagonals alternate, bent over edges of stiffness `across` with its own edges free:
    vertices between hinges give way until the energy is least, which couples the two curvatures."""
    total = across + along + 4 * diagonal
    d11, d22, d12 = across * (along + 4 * diagonal) / total, along * (across + 4 * diagonal) / total, across * along / total
    return d11 - d12**2 / d22


def at(curve, curvature):
    """Of a row of a table."""
    place = min(abs(curvature) / 10, len(curve) - 1 - 1e-9)
    k = int(place)
    return curve[k] + (place - k) * (curve[k + 1] - curve[k])


class Studies:
    def __init__(self, arcsim, weft, out):
        self.arcsim, self.weft, self.out = arcsim, weft, out
        self.rows = []

    def note(self, what, unit, found, expected):
        self.rows.append((what, unit, found, expected))
        print(f"{what}, {unit}: {found:.6g}, expected {expected:.6g}, ratio {found / expected:.4f}", flush=True)

    def sheet(self, name, file, length, width, cells, across, degrees=0.0, mesh="any", **options):
        exported_ = exported(self.weft, file, os.path.join(self.out, f"{name}.json"), *(["--mesh", mesh] if mesh != "any" else []))
        return Sheet(self.arcsim, os.path.join(self.out, name), exported_, length, width, cells, across, degrees, **options)

    def elongation(self, what, name, file, degrees, stiffness, density):
        length, rows = 0.5, 20
        sheet = self.sheet(name, file, length, 0.05, rows, 2, degrees, held_rows=1, damping=0.2)
        x = sheet.run(gravity=(0, -GRAVITY, 0), step=0.02, steps=400)
        self.note(what, "m", -x[-1][1] - length, hanging_elongation(stiffness, density, length, rows))

    def shear(self, name, file, modulus, density):
        """Short and wide: at mid-width of a sheet that hangs sideways."""
        length, rows, across = 0.05, 10, 200
        sheet = self.sheet(name, file, length, 1.0, rows, across, held_rows=1, damping=0.2)
        x = sheet.run(gravity=(-0.1 * GRAVITY, 0, 0), step=0.02, steps=200)
        middle = rows * (across + 1) + across // 2
        h = length / rows  # lumped masses: the mean of both ends of a row
        expected = sum(h * 0.1 * density * GRAVITY * (length - (k + 0.5) * h) / modulus for k in range(rows))
        self.note("shear of a wide sheet by its own weight", "m", -x[middle][0], expected)

    def bend(self, what, name, file, degrees, stiffness, density, length=0.03, upwards=False, mesh="any"):
        """Of a cantilever's tip. The row of hinges at the clamp stands for half a cell of it, too: first order in the cells."""
        drops = []
        for cells in (10, 20, 40):
            h = length / cells
            sheet = self.sheet(f"{name}_{cells}", file, length + h, 4 * h, cells + 1, 4, degrees, mesh, held_rows=2, damping=0.05)
            x = sheet.run(gravity=(0, 0, GRAVITY if upwards else -GRAVITY), step=0.005, steps=1000)
            tip = x[-(sheet.across + 1):]
            drops.append(abs(sum(p[2] for p in tip)) / len(tip))
        self.note(what, "m", extrapolated(*drops), elastica_drop(stiffness, density, length))

    def fall(self, name, along):
        linear, quadratic, density = 0.9, 1.4, 0.3
        file = motion_fabric(self.out, name, density, drag_linear=linear, drag_quadratic=quadratic)
        sheet = self.sheet(name, file, 0.1, 0.1, 4, 4)
        frames = sheet.frames(gravity=(-GRAVITY, 0, 0) if along else (0, 0, -GRAVITY), step=0.005, steps=800)
        axis = 0 if along else 2
        speed = (frames[-2][0][axis] - frames[-1][0][axis]) / sheet.frame_time
        what, expected = ("along the surface", density * GRAVITY / linear) if along else ("along the normal", math.sqrt(density * GRAVITY / quadratic))
        self.note(f"terminal speed {what}", "m/s", speed, expected)

    def decay(self, name):
        """Of the slowest stretching mode of a hanging sheet; the implicit step's own damping, linear in it, taken out."""
        density, stiffness, damping, length, rows = 0.3, 60, 0.3, 0.5, 20
        file = motion_fabric(self.out, name, density, stretch_stiffness=stiffness, stretch_damping=damping, shear_damping=damping * 25 / 60, bend_damping=damping * 2e-5 / 60)
        rates = []
        for step in (0.002, 0.001):
            sheet = self.sheet(f"{name}_{step}", file, length, 0.05, rows, 2, held_rows=1)
            steps = round(1.2 / step)
            frames = sheet.frames(gravity=(0, -0.01 * GRAVITY, 0), step=step, steps=steps)
            tip = [-f[-1][1] - length for f in frames]
            rest = hanging_elongation(stiffness, density * 0.01, length, rows)
            peaks = [k for k in range(1, len(tip) - 1) if (tip[k] - rest) > (tip[k - 1] - rest) and tip[k] >= tip[k + 1]]
            a, b = peaks[1], peaks[4]
            rates.append(math.log((tip[a] - rest) / (tip[b] - rest)) / ((b - a) * sheet.frame_time))
        # of rows springs with lumped masses, half a one at the tip
        h = length / rows
        omega2 = stiffness / (density * h * h) * 4 * math.sin(math.pi / (4 * rows)) ** 2
        self.note("decay of its slowest stretching mode", "1/s", 2 * rates[1] - rates[0], damping / stiffness * omega2 / 2)


def main():
    arcsim, weft, out = sys.argv[1:]
    os.makedirs(out, exist_ok=True)
    s = Studies(arcsim, weft, out)
    plain = motion_fabric(out, "plain", 0.2)
    s.fall("falls", False)
    s.fall("glides", True)
    s.elongation("elongation of a hanging sheet, 60 N/m", "warp", plain, 0, 60, 0.2)
    s.elongation("at 45 degrees, shear of 25 N/m", "bias", plain, 45, 1 / (1 / 120 + 1 / 100), 0.2)
    s.shear("sheared", plain, 25, 0.2)
    s.decay("decays")
    membrane = (80, 10, 120, 40)
    coupled = table_fabric(out, "coupled", 0.2, membrane, [[1e-5] * 5] * 3)
    s.elongation("a table: along the warp, 120 - 10^2/80 N/m", "coupled_warp", coupled, 0, 120 - 100 / 80, 0.2)
    s.elongation("along the weft, 80 - 10^2/120 N/m", "coupled_weft", coupled, 90, 80 - 100 / 120, 0.2)
    # Diagonals of the cells that hardly bend keep the vertices between the hinges from giving way.
    membrane = (2000, 0, 2000, 500)
    stiff = 1e-3
    hinged = table_fabric(out, "hinged", 0.2, membrane, [[1e-5] * 5, [stiff] * 5, [4e-5] * 5])
    s.bend("drop of a cantilever, 4e-5 N m along the warp", "hinged_warp", hinged, 0, lambda k: strip_of(4e-5, 1e-5, stiff), 0.2)
    s.bend("1e-5 N m along the weft", "hinged_weft", hinged, 90, lambda k: strip_of(1e-5, 4e-5, stiff), 0.2)
    curve = [1e-5, 3e-5, 4e-5, 4e-5, 4e-5]
    rising = table_fabric(out, "rising", 0.2, membrane, [[1e-5] * 5, [stiff] * 5, curve])
    s.bend("a table that rises with curvature, to one side", "rising", rising, 0, lambda k: at(curve, k), 0.2, upwards=True)
    s.bend("the same, to the other side", "falling", rising, 0, lambda k: at(curve, k), 0.2)
    s.bend("a filmed fabric, 2e-5 N m: 0.8 of it, as diagonals alternate", "bent", plain, 0, lambda k: strip_of(2e-5, 2e-5, 2e-5), 0.2)
    thread = math.sqrt(2) * 2e-5
    s.bend("--mesh alternating: 0.83 of it", "bent_on_grid", plain, 0, lambda k: strip_of(thread, thread, 1e-5), 0.2,
           mesh="alternating")
    with open(os.path.join(out, "table.csv"), "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["what", "unit", "arcsim", "expected", "ratio"])
        for what, unit, found, expected in s.rows:
            writer.writerow([what, unit, f"{found:.8g}", f"{expected:.8g}", f"{found / expected:.6f}"])


main()
