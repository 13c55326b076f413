#include "weft/report/report_assets.h"

namespace weft {

const std::string_view report_css = R"css(
:root {
  color-scheme: light dark;
  --ground: #ffffff; --raised: #f6f7f9; --ink: #1d2126; --soft: #59616b; --faint: #8a929c;
  --line: #dfe3e8; --accent: #0072b2; --warn: #9a5b00; --warn-ground: #fdf5e6; --warn-line: #e6b866;
  --fine: #00704f; --plot-grid: #e6e8eb; --plot-region: #f1f3f6;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ground: #16181b; --raised: #1f2226; --ink: #e7e9ec; --soft: #a9b0b9; --faint: #7d858f;
    --line: #33383e; --accent: #5db4ec; --warn: #f0c070; --warn-ground: #2b2416; --warn-line: #7a5c22;
    --fine: #4fc79c; --plot-grid: #2b3036; --plot-region: #1f2327;
  }
  .weft-plot .ground { fill: transparent; }
  .weft-plot text { fill: var(--ink); }
  .weft-plot .tick-label, .weft-plot .region-label { fill: var(--soft); }
  .weft-plot .note { stroke: var(--ground); }
  .weft-plot .cell-value { fill: revert-layer; }
  .weft-plot .note-mark { stroke: var(--ink); }
  .weft-plot .s0.stroke { stroke: #e7e9ec; } .weft-plot .s0.fill { fill: #e7e9ec; }
  .weft-plot .s1.stroke { stroke: #4aa8e6; } .weft-plot .s1.fill { fill: #4aa8e6; }
  .weft-plot .s2.stroke { stroke: #f08a4b; } .weft-plot .s2.fill { fill: #f08a4b; }
  .weft-plot .s3.stroke { stroke: #2fc397; } .weft-plot .s3.fill { fill: #2fc397; }
  .weft-plot .s7.stroke { stroke: #9aa1aa; } .weft-plot .s7.fill { fill: #9aa1aa; }
  .weft-plot .hatch-ground { fill: #2a2e33; } .weft-plot .hatch-line { stroke: #59616b; }
}
.weft-plot .grid { stroke: var(--plot-grid); }
.weft-plot .region { fill: var(--plot-region); }
.weft-plot .region-label { stroke: var(--plot-region); }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; scroll-behavior: smooth; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.55 system-ui, "Segoe UI", Helvetica, Arial, "DejaVu Sans", sans-serif; }
main, header.page, footer.page { max-width: 1180px; margin: 0 auto; padding: 0 28px; }
header.page { padding-top: 36px; }
h1 { font-size: 28px; line-height: 1.25; margin: 4px 0 4px; font-weight: 650; letter-spacing: -0.01em;
  overflow-wrap: anywhere; }
h2 { font-size: 20px; margin: 48px 0 12px; padding-top: 20px; border-top: 1px solid var(--line);
  font-weight: 640; }
h3 { font-size: 16px; margin: 28px 0 8px; font-weight: 640; overflow-wrap: anywhere; }
p { margin: 0 0 12px; max-width: 76ch; }
.brand { color: var(--soft); font-size: 13px; letter-spacing: 0.02em; }
.subtitle { color: var(--soft); margin: 0; overflow-wrap: anywhere; }
nav { margin: 18px 0 0; font-size: 14px; display: flex; flex-wrap: wrap; gap: 4px 18px; }
nav a, .data { color: var(--accent); text-decoration: none; }
nav a:hover, .data:hover { text-decoration: underline; }
.warnings { margin: 26px 0 0; padding: 14px 20px 16px; background: var(--warn-ground);
  border: 1px solid var(--warn-line); border-radius: 8px; }
.warnings h2 { margin: 0 0 6px; padding: 0; border: 0; font-size: 16px; color: var(--warn); }
.warnings ul { margin: 0; padding-left: 20px; }
.warnings li { margin: 4px 0; max-width: 90ch; overflow-wrap: anywhere; }
.quiet { margin: 26px 0 0; color: var(--fine); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr)); gap: 12px;
  margin: 26px 0 0; }
.tile { background: var(--raised); border-radius: 8px; padding: 12px 16px 12px; }
.tile .name { color: var(--soft); font-size: 13px; }
.tile .number { font-size: 24px; font-weight: 620; line-height: 1.35; letter-spacing: -0.01em; }
.tile .detail { color: var(--soft); font-size: 13px; }
table { border-collapse: collapse; width: 100%; font-size: 14px; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 560; color: var(--soft); font-size: 13px; padding: 6px 14px 6px 0;
  border-bottom: 1px solid var(--line); vertical-align: bottom; }
td { padding: 9px 14px 9px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.n, th.n { text-align: right; }
td.n { white-space: nowrap; }
td .minor, .minor { color: var(--soft); font-size: 13px; }
.parameter .value { font-weight: 620; white-space: nowrap; }
.parameter.weak .value { font-weight: 450; color: var(--soft); }
.status { white-space: nowrap; }
.status.warn { color: var(--warn); font-weight: 560; }
.status.fine { color: var(--fine); }
.status.held { color: var(--soft); }
.range { min-width: 190px; padding-top: 14px; }
.track { position: relative; height: 6px; border-radius: 3px; background: var(--line); margin: 0 7px; }
.track .interval { position: absolute; top: 0; height: 6px; border-radius: 3px; min-width: 2px;
  background: var(--accent); opacity: 0.4; }
.track .start { position: absolute; top: -3px; height: 12px; width: 2px; margin-left: -1px;
  background: var(--faint); }
.track .estimate { position: absolute; top: -4px; width: 14px; height: 14px; margin-left: -7px;
  border-radius: 50%; background: var(--accent); border: 2px solid var(--ground); }
.weak .track .estimate { background: var(--ground); border-color: var(--faint); }
.ends { display: flex; justify-content: space-between; color: var(--soft); font-size: 12px;
  margin-top: 7px; gap: 12px; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 500px), 1fr));
  gap: 20px 28px; align-items: start; margin: 16px 0; }
.figures:not(:has(*)) { display: none; }
.figures.small { grid-template-columns: repeat(auto-fit, minmax(min(100%, 320px), 1fr)); }
figure { margin: 0; min-width: 0; }
.plot .scroll { overflow-x: auto; }
.plot svg { display: block; width: 100%; height: auto; max-width: 760px; min-width: 440px; }
.small .plot svg { min-width: 300px; max-width: 420px; }
.plot figcaption { color: var(--soft); font-size: 13px; margin-top: 2px; max-width: 76ch; }
.data { white-space: nowrap; }
.plot svg.seekable { cursor: crosshair; }
.cursor { stroke: var(--ink); stroke-width: 1; stroke-dasharray: 3 3; pointer-events: none; }
.viewer { background: var(--raised); border-radius: 10px; padding: 16px; margin: 16px 0 8px; }
.viewer:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
.panels { display: grid; grid-template-columns: repeat(3, minmax(0, 1fr)); gap: 12px 14px;
  max-width: 1040px; margin: 0 auto;
  grid-template-areas: "measured simulated silhouettes" "measured_angles simulated_angles difference"; }
.panel img { display: block; width: 100%; height: auto; border-radius: 4px; background: #18191c; }
.panel figcaption { font-size: 13px; margin: 4px 0 0; display: flex; flex-wrap: wrap;
  justify-content: space-between; gap: 0 12px; }
.key { color: var(--soft); font-size: 12px; display: inline-flex; align-items: center; gap: 5px; }
.swatch { display: inline-block; width: 10px; height: 10px; border-radius: 2px; }
.scale { display: inline-block; width: 96px; height: 9px; border-radius: 2px; }
.shapes { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 460px), 1fr));
  gap: 16px 20px; margin: 12px 0; }
.shapes .pair { display: flex; gap: 8px; background: #ffffff; border-radius: 6px; }
.shapes img { width: calc(50% - 4px); height: auto; object-fit: contain; }
.shapes figcaption { color: var(--soft); font-size: 13px; }
h4 { font-size: 14px; margin: 20px 0 4px; font-weight: 640; }
.controls { display: flex; align-items: center; gap: 12px; margin: 16px auto 4px; max-width: 1040px; }
.controls input[type=range] { flex: 1; min-width: 0; accent-color: var(--accent); margin: 0; height: 24px; }
.controls button, .controls select { font: inherit; font-size: 14px; color: var(--ink); height: 34px;
  background: var(--ground); border: 1px solid var(--line); border-radius: 6px; padding: 0 12px;
  cursor: pointer; }
.controls .play { min-width: 78px; }
.controls button:hover { border-color: var(--faint); }
.readout { margin: 6px auto 0; max-width: 1040px; font-size: 14px; font-variant-numeric: tabular-nums;
  display: flex; flex-wrap: wrap; gap: 2px 20px; color: var(--soft); }
.readout b { color: var(--ink); font-weight: 600; }
.hint { color: var(--soft); font-size: 13px; margin: 6px auto 0; max-width: 1040px; }
code, pre { font: 13px/1.5 ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono", monospace; }
pre { background: var(--raised); border-radius: 8px; padding: 12px 16px; margin: 0 0 16px;
  white-space: pre-wrap; overflow-wrap: anywhere; }
.facts { display: grid; grid-template-columns: max-content 1fr; gap: 4px 24px; margin: 0 0 20px;
  font-size: 14px; }
.facts dt { color: var(--soft); }
.facts dd { margin: 0; overflow-wrap: anywhere; }
.columns { columns: 2 380px; column-gap: 48px; }
.columns .facts { display: block; }
.columns .facts div { display: flex; justify-content: space-between; gap: 20px; break-inside: avoid;
  border-bottom: 1px solid var(--line); padding: 3px 0; }
.columns .facts dd { text-align: right; }
footer.page { color: var(--soft); font-size: 13px; padding-top: 40px; padding-bottom: 48px; }
@media (max-width: 760px) {
  main, header.page, footer.page { padding-left: 16px; padding-right: 16px; }
  header.page { padding-top: 22px; }
  h1 { font-size: 23px; }
  .tiles { grid-template-columns: 1fr 1fr; }
  .tile { padding: 10px 12px; } .tile .number { font-size: 20px; }
  .viewer { margin-left: -16px; margin-right: -16px; border-radius: 0; padding: 12px 16px; }
  .panels { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 10px;
    grid-template-areas: "measured simulated" "measured_angles simulated_angles"
      "silhouettes difference"; }
  .controls { flex-wrap: wrap; } .controls input[type=range] { order: -1; flex-basis: 100%; }
  table, tbody, tr, td { display: block; width: 100%; }
  thead { display: none; }
  tr { border-bottom: 1px solid var(--line); padding: 10px 0; }
  td, td.n { border: 0; padding: 2px 0; display: flex; justify-content: space-between; gap: 18px;
    text-align: right; white-space: normal; }
  td::before { content: attr(data-name); color: var(--soft); text-align: left; flex: none; }
  td.lead { display: block; text-align: left; padding-bottom: 4px; }
  td.lead::before, td.range::before { content: none; }
  td.range { display: block; padding-top: 12px; }
  .facts { grid-template-columns: 1fr; gap: 0; } .facts dd { margin-bottom: 8px; }
}
@media print {
  .controls, .hint, nav, .data { display: none; }
  .viewer, figure, tr { break-inside: avoid; }
}
)css";

const std::string_view report_js = R"js(
(() => {
  'use strict';
  const kinds = ['measured', 'simulated', 'silhouettes', 'measured_angles', 'simulated_angles',
                 'difference'];
  const viewers = [];

  // A plot's x axis is linear from data-x-lower at data-left to data-x-upper at data-right, in px.
  const cursorIn = (svg) => {
    const d = svg.dataset, ns = svg.namespaceURI;
    const left = +d.left, right = +d.right, lower = +d.xLower, upper = +d.xUpper;
    const line = svg.appendChild(document.createElementNS(ns, 'line'));
    line.setAttribute('class', 'cursor');
    line.setAttribute('y1', d.top);
    line.setAttribute('y2', d.bottom);
    return {
      move(value) {
        const x = left + (right - left) * (value - lower) / (upper - lower);
        line.setAttribute('x1', x);
        line.setAttribute('x2', x);
      },
      valueAt(event) {
        const box = svg.getBoundingClientRect();
        const x = (event.clientX - box.left) * svg.viewBox.baseVal.width / box.width;
        return lower + (upper - lower) * (x - left) / (right - left);
      }
    };
  };

  const nearest = (values, value) => {
    let best = 0;
    values.forEach((v, i) => { if (Math.abs(v - value) < Math.abs(values[best] - value)) best = i; });
    return best;
  };

  const setUp = (root) => {
    const data = JSON.parse(root.querySelector('script').textContent);
    const images = kinds.map((kind) => root.querySelector('.' + kind + ' img'));
    const slider = root.querySelector('input'), play = root.querySelector('.play');
    const speed = root.querySelector('select'), readout = root.querySelector('.readout');
    const count = data.frames.length;
    const cursors = [];
    let index = 0, timer = 0, last = 0, debt = 0;

    const show = (i) => {
      index = (i % count + count) % count;
      kinds.forEach((kind, k) => { images[k].src = data[kind][index]; });
      slider.value = index;
      slider.setAttribute('aria-valuetext', 'frame ' + data.frames[index]);
      readout.innerHTML = data.readouts[index];
      cursors.forEach(({cursor, values}) => cursor.move(values[index]));
    };
    const stop = () => {
      cancelAnimationFrame(timer);
      timer = 0;
      play.textContent = '\u25B6 Play';
    };
    const tick = (now) => {
      debt += (now - last) / 1000 * data.rate * +speed.value;
      last = now;
      const steps = Math.floor(debt);
      debt -= steps;
      if (steps > 0) show(index + steps);
      timer = requestAnimationFrame(tick);
    };
    const toggle = () => {
      if (timer) { stop(); return; }
      debt = 0;
      last = performance.now();
      play.textContent = '\u275A\u275A Pause';
      timer = requestAnimationFrame(tick);
    };

    const viewer = {root, toggle, step(by) { stop(); show(index + by); },
                    first() { stop(); show(0); }, last() { stop(); show(count - 1); }};
    root.closest('.capture').querySelectorAll('[data-along]').forEach((figure) => {
      const svg = figure.querySelector('svg');
      const values = figure.dataset.along === 'time' ? data.times : data.frames;
      const cursor = cursorIn(svg);
      cursors.push({cursor, values});
      svg.classList.add('seekable');
      svg.addEventListener('click', (event) => {
        stop();
        show(nearest(values, cursor.valueAt(event)));
      });
    });
    slider.addEventListener('input', () => { stop(); show(+slider.value); });
    play.addEventListener('click', toggle);
    root.addEventListener('pointerdown', () => { active = viewer; });
    root.addEventListener('focusin', () => { active = viewer; });
    show(0);
    viewers.push(viewer);
  };

  let active = null;
  document.querySelectorAll('.viewer').forEach(setUp);
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const viewer = active || viewers[0];
    if (!viewer || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    const inside = viewer.root.contains(event.target);
    if (event.key === 'ArrowRight') viewer.step(1);
    else if (event.key === 'ArrowLeft') viewer.step(-1);
    else if (inside && event.key === 'Home') viewer.first();
    else if (inside && event.key === 'End') viewer.last();
    else if (inside && event.key === ' ' && event.target.tagName !== 'BUTTON') viewer.toggle();
    else return;
    event.preventDefault();
  });
})();
)js";

}  // namespace weft
