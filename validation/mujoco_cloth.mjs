// Runs what `weft export --to mujoco` writes in MuJoCo, against closed forms.
//
//     node validation/mujoco_cloth.mjs PACKAGES WEFT OUT
//
// PACKAGES has node_modules with @mujoco/mujoco and smol-toml, WEFT is the program, OUT a folder for the models and
// table.csv. Sheets of known fabrics reach their terminal speed, hang, swing up and down and bend under their own weight,
// and are deformed by hand.
import fs from 'node:fs';
import path from 'node:path';
import { Cloth, exported, load } from './mujoco.mjs';

const kGravity = 9.81;
const kParameters = {
  stretch_stiffness: [337.5, 'N/m'], shear_stiffness: [0.01, 'N/m'], bend_stiffness: [8.789e-6, 'N m'],
  stretch_damping: [0.09375, 'N s/m'], shear_damping: [0.001, 'N s/m'], bend_damping: [9e-8, 'N m s'],
  diagonal_stiffness: [1e-6, 'N/m'], diagonal_damping: [1e-9, 'N s/m'], drag_linear: [0, 'N s/m^3'],
  drag_quadratic: [0, 'N s^2/m^4'], drag_degradation: [0, 's^2/m^2'], drag_normal_linear: [0, 'N s/m^3'],
};

const [packages, weft, out] = process.argv.slice(2);
const { mujoco } = await load(packages);
fs.mkdirSync(out, { recursive: true });

/// Of a fabric that differs from kParameters in `changed`; `edit` changes the model's text.
function sheet(name, density, spacing, columns, rows, held, changed, edit = (xml) => xml) {
  const file = path.join(out, `${name}.toml`);
  const lines = Object.entries(kParameters).map(([key, [value, unit]]) =>
    `${key} = { value = ${changed[key] ?? value}, unit = "${unit}", lower = ${key.startsWith('drag') ? 0 : 1e-12}, upper = 1e6 }`);
  fs.writeFileSync(file, `format = "weft-fabric"\nversion = 1\nname = "${name}"\nmodel = "baraff-witkin-hinges"\n` +
    `areal_density = ${density}\n[parameters]\n${lines.join('\n')}\n`);
  const xml = exported(weft, file, path.join(out, `${name}.xml`), ['--spacing', spacing, '--cells', columns, rows, '--hold', held]);
  return new Cloth(mujoco, edit(xml), columns, rows);
}

const withGravity = (x, y, z) => (xml) => xml.replace('<option ', `<option gravity="${x} ${y} ${z}" `);

function terminalSpeed() {
  const drag = 0.9, density = 0.3;
  const cloth = sheet('slowed', density, 0.025, 4, 4, 'none', { drag_normal_linear: drag, drag_linear: drag });
  cloth.step(4);
  return [-cloth.data.qvel[cloth.dof(2, 2) + 2], kGravity * density / drag];
}

/// Of a sheet that hangs by its upper edge.
function elongation() {
  const k = 30, density = 0.3, h = 0.0125, rows = 40, length = h * rows;
  const cloth = sheet('hanging', density, h, 4, rows, 'edge',
    { stretch_stiffness: k, stretch_damping: 0.2, drag_normal_linear: 1.5, drag_linear: 1.5 });
  cloth.step(5);
  return [-cloth.mean(rows, 2) - length, density * kGravity * length * length / 2 / k];
}

/// Rate at which the slowest stretching mode of a hanging sheet decays, 1/s: from one peak to the next.
function decay() {
  const k = 30, c = 0.3, density = 0.3, h = 0.0125, rows = 40;
  const cloth = sheet('bouncing', density, h, 2, rows, 'edge', { stretch_stiffness: k, stretch_damping: c }, withGravity(0, 0, 0));
  const wave = (row) => Math.sin(Math.PI * row / (2 * rows));
  for (let row = 1; row <= rows; ++row)
    for (let column = 0; column <= 2; ++column) cloth.data.qpos[cloth.dof(column, row) + 2] = -1e-3 * wave(row);
  const omega = 2 * Math.sqrt(k / density) / h * Math.sin(Math.PI / (4 * rows));
  const rate = c / k * omega * omega / 2, period = 2 * Math.PI / Math.sqrt(omega * omega - rate * rate);
  mujoco.mj_forward(cloth.model, cloth.data);
  const below = () => -cloth.mean(rows, 2) - h * rows;
  const before = below();
  cloth.step(period);
  return [-Math.log(below() / before) / cloth.data.time, rate];
}

/// Of a sheet that nothing holds, deformed uniformly: minus the work of its forces in as much again, over strain and
/// area, N/m.
function stiffness(name, changed, strained) {
  const h = 0.0125, cells = 8, area = (h * cells) ** 2, strain = 1e-4;
  const cloth = sheet(name, 0.3, h, cells, cells, 'none', changed, withGravity(0, 0, 0));
  for (let row = 0; row <= cells; ++row)
    for (let column = 0; column <= cells; ++column) {
      const [x, , z] = cloth.restOf(column, row), at = cloth.dof(column, row);
      [cloth.data.qpos[at], , cloth.data.qpos[at + 2]] = strained(x, z).map((by) => by * strain);
    }
  mujoco.mj_forward(cloth.model, cloth.data);
  let work = 0;
  for (let row = 0; row <= cells; ++row)
    for (let column = 0; column <= cells; ++column) {
      const [x, , z] = cloth.restOf(column, row), at = cloth.dof(column, row), by = strained(x, z);
      work += cloth.data.qfrc_passive[at] * by[0] + cloth.data.qfrc_passive[at + 2] * by[2];
    }
  return -work / strain / area;
}

/// With the narrowing that the lattice wants.
function stretch() {
  const k = 100, shear = 40;
  const thread = (k + Math.hypot(k, 2 * shear)) / 2, narrowing = shear / thread;
  const strained = (x, z) => [x, 0, -narrowing * z];
  return [stiffness('stretched', { stretch_stiffness: k, shear_stiffness: shear }, strained), k];
}

function shear() {
  const sheared = (x, z) => [z, 0, 0];
  return [stiffness('sheared', { stretch_stiffness: 100, shear_stiffness: 40 }, sheared), 40];
}

/// One of the diagonals is taut: half of their stiffness is resisted at 45 degrees, a quarter of that as shear.
function diagonals() {
  const sheared = (x, z) => [z, 0, 0];
  return [stiffness('taut', { shear_stiffness: 1e-6, diagonal_stiffness: 200 }, sheared), 200 / 4];
}

/// By a damper that nothing moves.
function clamp(cloth, isHeld) {
  for (let row = 0; row <= cloth.rows; ++row)
    for (let column = 0; column <= cloth.columns; ++column) {
      const at = cloth.dof(column, row);
      if (at >= 0 && isHeld(column, row)) for (let axis = 0; axis < 3; ++axis) cloth.model.dof_damping[at + axis] = 1e6;
    }
}

const kBend = { stretch_stiffness: 300, shear_stiffness: 100, stretch_damping: 0.02, shear_damping: 0.02, bend_stiffness: 2e-3,
  bend_damping: 1e-7, drag_normal_linear: 2, drag_linear: 2 };
const kLight = 0.3;  // m/s^2, so that it is linear

/// Of a cantilever: along the threads a strip has the flexural rigidity of the lattice, 2.5 / sqrt(10) of the mean, and
/// 2.4 where its sides are free to curl; between them.
function tip(cells) {
  const density = 0.2, length = 0.2, h = length / cells, rows = cells + 1;
  const cloth = sheet(`bending_${cells}`, density, h, 4, rows, 'edge', kBend, withGravity(0, -kLight, 0));
  clamp(cloth, (column, row) => row === 1);
  cloth.step(1.5);
  const bend = 2.45 / Math.sqrt(10) * kBend.bend_stiffness;
  return [-cloth.mean(rows, 1), density * kLight * length ** 4 / 8 / bend];
}

/// Of a square held along its diagonal: a strip at 45 degrees that narrows to nothing.
function corner(cells) {
  const density = 0.2, side = 0.2, length = side / Math.SQRT2;
  const cloth = sheet(`corner_${cells}`, density, side / cells, cells, cells, 'none', kBend, withGravity(0, -kLight, 0));
  clamp(cloth, (column, row) => column + row <= cells);
  cloth.step(1);
  const bend = 4 / Math.sqrt(10) * kBend.bend_stiffness;
  return [-cloth.position(cells, cells)[1], density * kLight * length ** 4 / 24 / bend];
}

/// The row that a clamp ends in gives way: of first order in the width of cells, which is taken out.
function refined(study) {
  return () => {
    const [[coarse], [fine, expected]] = [study(10), study(20)];
    return [2 * fine - coarse, expected];
  };
}

const lines = ['what,unit,mujoco,expected,ratio'];
for (const [what, unit, study] of [
  ['terminal speed', 'm/s', terminalSpeed], ['elongation under its own weight', 'm', elongation],
  ['decay of stretching', '1/s', decay], ['stretch', 'N/m', stretch], ['shear', 'N/m', shear],
  ['shear by diagonals', 'N/m', diagonals], ['tip of a strip along the threads by refinement', 'm', refined(tip)],
  ['tip of a corner at 45 degrees by refinement', 'm', refined(corner)]]) {
  const [found, expected] = study();
  lines.push(`${what},${unit},${found.toPrecision(6)},${expected.toPrecision(6)},${(found / expected).toFixed(4)}`);
  console.log(lines.at(-1));
}
fs.writeFileSync(path.join(out, 'table.csv'), lines.join('\n') + '\n');
