// How far from the true surfaces of a capture MuJoCo moves cloth that `weft export --to mujoco` wrote.
//
//     node validation/mujoco_motion.mjs PACKAGES WEFT OUT CAPTURE FABRIC ... [--cells N]
//
// PACKAGES has node_modules with @mujoco/mujoco and smol-toml, WEFT is the program, OUT a folder for models and tables,
// CAPTURE a video capture with truth (of a square swatch held by its two upper corners), FABRIC a preset or a file; N cells
// along a side, which divide those of the truth (those of the truth). The swatch hangs in the true shape of frame 0 until
// it is still, then its corners follow the capture's. Distances are between the surfaces at the same (u, v), mean over the
// vertices, mm: of frame 0, and mean over the fit frames and the later ones (OUT/CAPTURE.csv); and of each frame, m, as
// `weft evaluate --json` has them (OUT/CAPTURE_FABRIC.json, for weft_validate_distance).
import fs from 'node:fs';
import path from 'node:path';
import { Cloth, exported, load } from './mujoco.mjs';

const kSettling = 1;  // s, before frame 0: in thick air, then in the fabric's own
const kThickUntil = 0.73, kOwnFrom = 0.87;  // s
const kThickAir = 5;  // 1/s, rate at which speed decays

const words = process.argv.slice(2), at = words.indexOf('--cells');
const asked = at < 0 ? undefined : Number(words.splice(at, 2)[1]);
const [packages, weft, out, folder, ...fabrics] = words;
const { mujoco, toml } = await load(packages);

/// Of a .pc2: frames of points.
function readPoints(file) {
  const bytes = fs.readFileSync(file), count = bytes.readInt32LE(16), frames = bytes.readInt32LE(28);
  const number = (k) => bytes.readFloatLE(32 + 4 * k);
  return Array.from({ length: frames }, (_, f) =>
    Array.from({ length: count }, (_, p) => [0, 1, 2].map((axis) => number(3 * (f * count + p) + axis))));
}

function readCapture() {
  const values = toml.parse(fs.readFileSync(path.join(folder, 'capture.toml'), 'utf8'));
  const shown = readPoints(path.join(folder, values.truth.points));
  const corners = fs.readFileSync(path.join(folder, values.fixture[0].motion), 'utf8').trim().split('\n').slice(1)
    .map((line) => line.split(',').slice(1).map(Number));
  const side = Math.round(Math.sqrt(shown[0].length));  // vertices
  return { name: values.name, rate: values.video.frame_rate, fitFrames: values.video.fit_frames[1] + 1,
    density: values.swatch.areal_density, hem: values.swatch.hem_width ?? 0, width: values.swatch.width, shown, corners, side };
}

/// A vertex with its two neighbours along each axis; rims along them alone, corners as they are: points of the
/// Catmull-Clark surface over the vertices.
function surfaceOf(x, side) {
  const averaged = (y, step, isInner) => y.map((p, k) => !isInner(k) ? p :
    p.map((value, axis) => 2 / 3 * value + (y[k - step][axis] + y[k + step][axis]) / 6));
  const inRow = averaged(x, 1, (k) => k % side > 0 && k % side < side - 1);
  return averaged(inRow, side, (k) => k >= side && k < side * (side - 1));
}

/// Whose surface that is.
function verticesOf(shown, side) {
  let x = shown;
  for (let n = 0; n < 60; ++n) {  // each leaves at most 8/9 of the error
    const surface = surfaceOf(x, side);
    x = x.map((p, k) => p.map((value, axis) => value + shown[k][axis] - surface[k][axis]));
  }
  return x;
}

/// Lagrange's cubic through four frames; straight on at the ends.
function between(frames, time) {
  const k = Math.min(Math.max(Math.floor(time), 0), frames.length - 2), s = time - k;
  const frame = (n) => n < 0 ? frames[0].map((v, i) => 2 * v - frames[1][i])
    : n >= frames.length ? frames.at(-1).map((v, i) => 2 * v - frames.at(-2)[i]) : frames[n];
  const weights = [-s * (s - 1) * (s - 2) / 6, (s + 1) * (s - 1) * (s - 2) / 2, -(s + 1) * s * (s - 2) / 2,
    (s + 1) * s * (s - 1) / 6];
  const near = [-1, 0, 1, 2].map((n) => frame(k + n));
  return frames[0].map((_, i) => weights.reduce((sum, w, n) => sum + w * near[n][i], 0));
}

/// Positions of the vertices, frame by frame.
function motion(capture, cells, xml) {
  const cloth = new Cloth(mujoco, xml, cells, cells), { model, data } = cloth;
  const stride = (capture.side - 1) / cells;
  const start = verticesOf(capture.shown[0], capture.side);
  for (let row = 0; row <= cells; ++row)
    for (let column = 0; column <= cells; ++column) {
      const dof = cloth.dof(column, row), rest = cloth.restOf(column, row);
      const point = start[row * stride * capture.side + column * stride];
      if (dof >= 0) for (let axis = 0; axis < 3; ++axis) data.qpos[dof + axis] = point[axis] - rest[axis];
    }
  const left = 3 * model.body_mocapid[cloth.bodyOf(0, 0)], right = 3 * model.body_mocapid[cloth.bodyOf(cells, 0)];
  const hold = (corners) => {
    for (let axis = 0; axis < 3; ++axis) {
      data.mocap_pos[left + axis] = corners[axis];
      data.mocap_pos[right + axis] = corners[3 + axis];
    }
  };
  const advance = (from, to, each) => {  // s
    const steps = Math.round((to - from) / model.opt.timestep);
    for (let k = 0; k < steps; ++k) {
      each(from + (k + 1) * (to - from) / steps);
      mujoco.mj_step(model, data);
    }
    cloth.requireStable();
  };

  const own = [...model.dof_damping];
  const thick = own.map((value, dof) => Math.max(value, kThickAir * model.body_mass[model.dof_bodyid[dof]]));
  const breathe = (share) => own.forEach((value, dof) => { model.dof_damping[dof] = value + share * (thick[dof] - value); });
  hold(capture.corners[0]);
  breathe(1);
  advance(0, kThickUntil, () => {});
  for (let k = 1; k <= 10; ++k) {
    breathe(1 - k / 10);
    advance(0, (kOwnFrom - kThickUntil) / 10, () => {});
  }
  advance(0, kSettling - kOwnFrom, () => {});
  const found = [];
  for (let frame = 0; frame < capture.shown.length; ++frame) {
    if (frame > 0) advance((frame - 1) / capture.rate, frame / capture.rate, (time) => hold(between(capture.corners, time * capture.rate)));
    mujoco.mj_kinematics(model, data);
    found.push(cloth.positions());
  }
  cloth.free();
  return found;
}

function distances(capture, cells, found) {
  const stride = (capture.side - 1) / cells;
  return found.map((points, frame) => {
    const surface = surfaceOf(points, cells + 1);
    const apart = surface.map((p, k) => {
      const row = Math.floor(k / (cells + 1)), column = k % (cells + 1);
      return Math.hypot(...capture.shown[frame][row * stride * capture.side + column * stride].map((v, axis) => v - p[axis]));
    });
    return apart.reduce((sum, value) => sum + value, 0) / apart.length;
  });
}

function evaluation(capture, apart) {
  const part = (first, last) => {
    const all = apart.slice(first, last + 1);
    return { first, last, distance_mean: all.reduce((sum, value) => sum + value, 0) / all.length };
  };
  return { fit: part(0, capture.fitFrames - 1), validation: part(capture.fitFrames, apart.length - 1),
    frames: apart.map((distance_mean, frame) => ({ frame, distance_mean })) };
}

fs.mkdirSync(out, { recursive: true });
const capture = readCapture(), cells = asked ?? capture.side - 1;
if (!Number.isInteger((capture.side - 1) / cells)) throw new Error(`--cells: ${cells} does not divide ${capture.side - 1}`);
const table = ['fabric,frame 0 (mm),fit frames (mm),later frames (mm),seconds'];
console.log(table[0]);
for (const fabric of fabrics) {
  const own = path.basename(fabric, path.extname(fabric));
  const name = own === 'fabric' ? path.basename(path.dirname(path.resolve(fabric))) : own;
  const xml = exported(weft, fabric, path.join(out, `${capture.name}_${name}.xml`), ['--spacing', capture.width / cells, '--cells', cells,
    cells, '--hold', 'corners', '--areal-density', capture.density, '--hem-width', capture.hem]);
  const begun = performance.now();
  const found = evaluation(capture, distances(capture, cells, motion(capture, cells, xml)));
  const mm = [found.frames[0].distance_mean, found.fit.distance_mean, found.validation.distance_mean].map((d) => (1e3 * d).toFixed(2));
  table.push(`${name},${mm.join(',')},${((performance.now() - begun) / 1e3).toFixed(0)}`);
  console.log(table.at(-1));
  fs.writeFileSync(path.join(out, `${capture.name}_${name}.json`), JSON.stringify(found));
}
fs.writeFileSync(path.join(out, `${capture.name}.csv`), table.join('\n') + '\n');
