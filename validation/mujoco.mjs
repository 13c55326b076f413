// MuJoCo, and what `weft export --to mujoco` writes, for the two studies.
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

/// Both packages are installed under `folder`.
export async function load(folder) {
  const entry = (...parts) => import(pathToFileURL(path.join(folder, 'node_modules', ...parts)).href);
  const mujoco = await (await entry('@mujoco', 'mujoco', 'mujoco.js')).default();
  const toml = await entry('smol-toml', 'dist', 'index.js');
  return { mujoco, toml };
}

/// The exported model of a fabric, as text.
export function exported(weft, fabric, out, options) {
  execFileSync(weft, ['export', fabric, '--to', 'mujoco', '--out', out, ...options.map(String)], { stdio: ['ignore', 'ignore', 'inherit'] });
  return fs.readFileSync(out, 'utf8');
}

/// A model in motion, with its vertices by column and row.
export class Cloth {
  constructor(mujoco, xml, columns, rows) {
    this.mujoco = mujoco;
    this.model = mujoco.MjModel.from_xml_string(xml);
    this.data = new mujoco.MjData(this.model);
    this.columns = columns;
    this.rows = rows;
    const names = [...xml.matchAll(/<body name="([^"]*)"/g)].map((match) => match[1]);
    this.body = new Map(names.map((name, k) => [name, k + 1]));  // 0 is the world
    mujoco.mj_forward(this.model, this.data);
  }
  bodyOf(column, row) { return this.body.get(`cloth_${column}_${row}`); }
  position(column, row) {
    const k = 3 * this.bodyOf(column, row);
    return [...this.data.xpos.slice(k, k + 3)];
  }
  /// Address of the first of three numbers in qpos, qvel and dof_*; -1 for a held vertex.
  dof(column, row) { return this.model.body_dofadr[this.bodyOf(column, row)]; }
  restOf(column, row) {
    const k = 3 * this.bodyOf(column, row);
    return [...this.model.body_pos.slice(k, k + 3)];
  }
  /// Row by row.
  positions() {
    const all = [];
    for (let row = 0; row <= this.rows; ++row)
      for (let column = 0; column <= this.columns; ++column) all.push(this.position(column, row));
    return all;
  }
  mean(row, axis) {
    let sum = 0;
    for (let column = 0; column <= this.columns; ++column) sum += this.position(column, row)[axis];
    return sum / (this.columns + 1);
  }
  step(seconds) {
    const steps = Math.round(seconds / this.model.opt.timestep);
    for (let k = 0; k < steps; ++k) this.mujoco.mj_step(this.model, this.data);
    this.requireStable();
  }
  /// MuJoCo begins again, with a warning in its log, where a state is not finite.
  requireStable() {
    if (!(this.data.time > 0)) throw new Error('the simulation diverged');
  }
  free() {
    this.data.delete();
    this.model.delete();
  }
}
