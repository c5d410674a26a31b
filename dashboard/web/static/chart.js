// Charts over time, drawn by uPlot: least and greatest of every point as a band, gaps, marks, one
// window and one cursor for all charts of a group. Drag to zoom, double click (or double tap) for
// all of it, arrow keys to move, + and - to zoom.

import { Cursors } from "/static/cursors.js";
import { keyed, selectable } from "/static/drag.js";
import { dress, gapsOf } from "/static/figure.js";

const { uPlot } = window; // vendor/uplot, a classic script before this module
const FONT = "12px system-ui, 'DejaVu Sans', sans-serif";
const LOOK_MS = 120; // a window that still changes asks for no new points
const UNTOLD = 2; // uPlot.join: null is a gap, also for the times that only another line has

const STEPS = Array.from({ length: 16 }, (_, k) => [1, 2, 5].map((n) => n * 10 ** (k - 8))).flat();

export const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const digits = (step) => Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)));

// How an axis looks; unit stands behind each number.
export function axis(unit, more) {
  return {
    stroke: style("--dim"), font: FONT, gap: 6,
    incrs: STEPS, grid: { stroke: style("--line"), width: 1 }, ticks: { show: false },
    values: (_, splits, __, ___, step) => splits.map((v) => `${v.toFixed(digits(step)).replace("-", "−")}${unit}`),
    ...more,
  };
}

export const faded = (color, alpha) => color + Math.round(255 * alpha).toString(16).padStart(2, "0");

// Calls redraw when the theme changes, by a person or by the system.
export function onTheme(redraw) {
  document.addEventListener("gyrofree-theme", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

// One table of times for all lines: [times, low, high of the first, low ...]; high where it differs.
function table(lines) {
  if (!lines.length) return [[]];
  return uPlot.join(lines.map(({ t0, dt, low, high }) => {
    const times = Array.from(low, (_, k) => t0 + k * dt);
    return high === low ? [times, low] : [times, low, high];
  }), lines.map(({ low, high }) => (high === low ? [0, UNTOLD] : [0, UNTOLD, UNTOLD])));
}

// unsureOf(n): stretches in which the nth line is not vouched for, which are dotted by figure.js.
function seriesOf(lines, unsureOf) {
  const series = [{}], bands = [];
  for (const [n, line] of lines.entries()) {
    const look = {
      gaps: (u, at, from, to, found) => gapsOf(u, found, unsureOf(n)),
      label: line.short, stroke: faded(line.color, line.alpha ?? 1), width: line.width ?? 1.4,
      dash: line.dash?.length ? line.dash : undefined, points: { show: false },
    };
    series.push(look);
    if (line.high === line.low) continue;
    bands.push({ series: [series.length, series.length - 1], fill: faded(line.color, 0.45 * (line.alpha ?? 1)) });
    series.push(look);
  }
  return { series, bands };
}

// A margin above and below what is seen; something around zero where nothing is.
function range(_, low, high) {
  if (low === null || !(high >= low)) return [-1, 1];
  const margin = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
  return [low - margin, high + margin];
}

export class Plot {
  // lines: [{label, short, color, dash, width, alpha, hidden, t0, dt, low, high}]; group: window and cursor.
  constructor(figure, group) {
    this.group = group;
    this.root = figure.querySelector(".chart");
    this.readout = figure.querySelector("output");
    this.title = figure.querySelector("figcaption > span")?.textContent ?? "";
    this.unit = figure.querySelector("small")?.textContent ?? "";
    this.lines = [];
    this.marks = this.shades = [];
    group.plots.push(this);
    new ResizeObserver(() => this.resize()).observe(this.root);
    this.root.addEventListener("keydown", (event) => group.key(event));
  }

  // shades: [from, until, word] of what a filter does not vouch for.
  set(lines, marks, shades = []) {
    this.marks = marks;
    this.shades = shades;
    this.lines = lines.filter((line) => !line.hidden);
    const shape = JSON.stringify(this.lines.map((l) => [l.short, l.color, l.dash, l.width, l.alpha, l.high === l.low]));
    if (this.shape !== shape) this.build();
    else this.chart?.setData(table(this.lines), false);
    this.shape = shape;
    this.look();
    if (this.group.cursors.at) this.group.cursors.refresh();
  }

  build() {
    this.chart?.destroy();
    this.chart = null;
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!width || !height) return; // hidden: built when there is room
    this.chart = new uPlot({
      width, height, ...seriesOf(this.lines, (n) => this.lines[n]?.unsure ?? []), legend: { show: false }, padding: [8, 18, 0, 0],
      scales: { x: { time: false, auto: false, range: (_, a, b) => [a, b] }, y: { range } },
      axes: [axis(" s", { space: 60, size: 42 }), axis("", { space: 22, size: 58 })],
      cursor: {
        y: false, points: { show: false }, drag: { x: false, y: false },
        sync: { key: this.group.cursorKey, scales: ["x", null] },
        bind: { mousedown: () => () => {}, dblclick: () => () => this.group.look(...this.group.span) },
      },
      hooks: { setCursor: [(u) => this.say(u)] },
    }, table(this.lines), this.root);
    dress(this.chart, () => this.described());
    selectable(this.chart, (a, b) => this.group.look(a, b), (t) => this.group.click(t));
    const figure = this.root.parentElement;
    figure.querySelectorAll(".gf-tools, .gf-between").forEach((old) => old.remove());
    this.group.cursors.add(this.chart, figure, () => this.described());
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!this.chart && this.shape !== undefined) {
      this.build();
      this.look();
    } else if (this.chart && width) this.chart.setSize({ width, height });
  }

  look() {
    const [min, max] = this.group.window;
    this.chart?.setScale("x", { min, max });
  }

  // As figure.js wants it.
  described() {
    const lines = this.lines.map((line) => {
      const x = Array.from(line.low, (_, k) => line.t0 + k * line.dt);
      return { label: line.short, color: line.color, dash: line.dash, width: line.width, x, low: line.low, high: line.high, unsure: (line.unsure ?? []).map(([, , word]) => word).sort().at(-1), faint: line.unsure ?? [] };
    });
    const fresh = this.lines.every((line) => line.measured && line.asked === this.group.asked);
    return {
      title: this.title, unit: this.unit, origin: this.group.origin, of: this.group.of, provisional: this.group.provisional, done: true,
      ranges: [...this.shades.map(([from, until, word]) => [from, until, word, word]), ...this.marks.map((mark) => [mark.t, mark.until ?? mark.t, mark.text, mark.kind ?? "mark"])], lines: () => lines,
      measured: fresh ? Object.fromEntries(this.lines.map((line) => [line.short, line.measured])) : null,
    };
  }

  // Time and values under the cursor, of this chart or of another of the group.
  say(u) {
    if (!(u.cursor.left >= 0)) { this.readout.textContent = ""; return; }
    const t = u.posToVal(u.cursor.left, "x");
    const values = this.lines.map((line) => {
      const k = Math.round((t - line.t0) / line.dt), low = line.low[k];
      if (low === undefined || low === null) return null;
      const unsure = (line.unsure ?? []).find(([from, until]) => t >= from && t < until);
      return `${line.short} ${unsure ? unsure[2] : ((low + line.high[k]) / 2).toFixed(3).replace("-", "−")}`;
    }).filter(Boolean);
    this.readout.textContent = `${t.toFixed(2)} s: ${values.join(", ")}`;
  }
}

// Charts with one axis of time. `onLook(begin, end)` after a change of the window, `click(t)` for a click.
export class Group {
  static count = 0;

  constructor(onLook, click = () => {}) {
    this.plots = [];
    this.span = this.window = [0, 1];
    this.asked = ""; // the stretch that the server is asked to measure
    Object.assign(this, { origin: "s", of: "every sample", provisional: false });
    this.cursors = new Cursors((a, b) => {
      this.asked = a === null ? "" : `${a}_${b}`;
      clearTimeout(this.timer);
      if (this.asked) this.timer = setTimeout(() => this.onLook(...this.window), LOOK_MS);
    });
    this.cursorKey = `charts ${Group.count++}`;
    Object.assign(this, { onLook, click });
    onTheme(() => this.plots.forEach((plot) => { if (plot.chart) { plot.build(); plot.look(); } }));
  }

  // What lies between the cursors, else what is shown.
  stretch() {
    const at = this.cursors.at;
    return at ? [Math.min(...at), Math.max(...at)] : this.window;
  }

  remove(plot) {
    plot.chart?.destroy();
    this.plots = this.plots.filter((one) => one !== plot);
  }

  look(begin, end) {
    const [a, b] = this.span;
    const width = Math.min(b - a, Math.max(1e-3, end - begin));
    begin = Math.min(Math.max(a, begin), b - width);
    this.window = [begin, begin + width];
    for (const plot of this.plots) plot.look();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.onLook(...this.window), LOOK_MS);
  }

  key(event) {
    if (event.defaultPrevented) return;
    const to = keyed(event.key, this.window, this.span);
    if (!to) return;
    event.preventDefault();
    this.look(...to);
  }
}
