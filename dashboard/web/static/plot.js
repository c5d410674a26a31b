// Line plots over time on a canvas: least and greatest per point, gaps, marks, a shared window, a readout.
// Drag to zoom, double click (or double tap) for all of it, arrow keys to move, + and - to zoom.

const FONT = "12px system-ui, 'DejaVu Sans', sans-serif";
const MARGIN = { left: 58, right: 10, top: 8, bottom: 22 };
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function ticks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + step * 1e-9; v += step) found.push(Math.abs(v) < step * 1e-9 ? 0 : v);
  return { step, found };
}

const digits = (step) => Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)));

export class Plot {
  // lines: [{label, color, dash, width, alpha, t0, dt, low, high}]; group shares the window of time.
  constructor(figure, group) {
    this.group = group;
    this.canvas = figure.querySelector("canvas");
    this.readout = figure.querySelector("output");
    this.lines = [];
    this.marks = [];
    group.plots.push(this);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.listen();
  }

  set(lines, marks) {
    this.lines = lines;
    this.marks = marks;
    this.draw();
  }

  x(t) {
    const [a, b] = this.group.window;
    return MARGIN.left + ((t - a) / (b - a)) * (this.width - MARGIN.left - MARGIN.right);
  }

  time(x) {
    const [a, b] = this.group.window;
    return a + ((x - MARGIN.left) / (this.width - MARGIN.left - MARGIN.right)) * (b - a);
  }

  y(v) {
    return MARGIN.top + ((this.top - v) / (this.top - this.bottom)) * (this.height - MARGIN.top - MARGIN.bottom);
  }

  scale() {
    const [a, b] = this.group.window;
    let low = Infinity, high = -Infinity;
    for (const line of this.lines) {
      if (line.hidden) continue;
      const first = Math.max(0, Math.floor((a - line.t0) / line.dt)), last = Math.min(line.low.length - 1, Math.ceil((b - line.t0) / line.dt));
      for (let k = first; k <= last; k++) {
        if (line.low[k] === null) continue;
        low = Math.min(low, line.low[k]);
        high = Math.max(high, line.high[k]);
      }
    }
    if (!(high >= low)) [low, high] = [-1, 1];
    const margin = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
    this.bottom = low - margin;
    this.top = high + margin;
  }

  draw() {
    const box = this.canvas.getBoundingClientRect();
    if (!box.width) return;
    const ratio = window.devicePixelRatio || 1;
    this.width = box.width;
    this.height = box.height;
    this.canvas.width = Math.round(box.width * ratio);
    this.canvas.height = Math.round(box.height * ratio);
    const c = this.canvas.getContext("2d");
    c.scale(ratio, ratio);
    c.font = FONT;
    this.scale();
    this.grid(c);
    c.save();
    c.beginPath();
    c.rect(MARGIN.left, MARGIN.top, this.width - MARGIN.left - MARGIN.right, this.height - MARGIN.top - MARGIN.bottom);
    c.clip();
    for (const mark of this.marks) this.mark(c, mark);
    for (const line of this.lines) if (!line.hidden) this.line(c, line);
    if (this.drag) {
      c.fillStyle = style("--blue");
      c.globalAlpha = 0.2;
      c.fillRect(Math.min(this.drag.from, this.drag.to), MARGIN.top, Math.abs(this.drag.to - this.drag.from), this.height);
    }
    c.restore();
    if (this.group.pointer !== null) this.pointer(c);
  }

  grid(c) {
    const [a, b] = this.group.window;
    c.strokeStyle = style("--line");
    c.fillStyle = style("--dim");
    c.lineWidth = 1;
    c.textBaseline = "middle";
    c.textAlign = "right";
    const vertical = ticks(this.bottom, this.top, Math.max(2, this.height / 30));
    for (const v of vertical.found) {
      const y = Math.round(this.y(v)) + 0.5;
      c.beginPath(); c.moveTo(MARGIN.left, y); c.lineTo(this.width - MARGIN.right, y); c.stroke();
      c.fillText(v.toFixed(digits(vertical.step)), MARGIN.left - 6, y);
    }
    c.textBaseline = "top";
    c.textAlign = "center";
    const along = ticks(a, b, Math.max(2, this.width / 110));
    for (const t of along.found) {
      const x = Math.round(this.x(t)) + 0.5;
      c.beginPath(); c.moveTo(x, MARGIN.top); c.lineTo(x, this.height - MARGIN.bottom); c.stroke();
      c.fillText(`${t.toFixed(digits(along.step))} s`, x, this.height - MARGIN.bottom + 5);
    }
  }

  mark(c, mark) {
    const x = this.x(mark.t);
    c.save();
    c.strokeStyle = c.fillStyle = mark.color;
    c.setLineDash([3, 3]);
    c.beginPath(); c.moveTo(x, MARGIN.top); c.lineTo(x, this.height); c.stroke();
    c.textBaseline = "top";
    c.textAlign = x > this.width - 120 ? "right" : "left";
    c.fillText(mark.text.slice(0, 40), x + (c.textAlign === "left" ? 4 : -4), MARGIN.top + 2);
    c.restore();
  }

  line(c, line) {
    const [a, b] = this.group.window;
    c.save();
    c.strokeStyle = line.color;
    c.lineWidth = line.width ?? 1.4;
    c.globalAlpha = line.alpha ?? 1;
    c.setLineDash(line.dash ?? []);
    c.lineJoin = "round";
    c.beginPath();
    let pen = false;
    const first = Math.max(0, Math.floor((a - line.t0) / line.dt) - 1), last = Math.min(line.low.length - 1, Math.ceil((b - line.t0) / line.dt) + 1);
    for (let k = first; k <= last; k++) {
      if (line.low[k] === null) { pen = false; continue; }
      const x = this.x(line.t0 + k * line.dt);
      const low = this.y(line.low[k]);
      if (pen) c.lineTo(x, low); else c.moveTo(x, low);
      if (line.high !== line.low) c.lineTo(x, this.y(line.high[k]));
      pen = true;
    }
    c.stroke();
    c.restore();
  }

  pointer(c) {
    const t = this.group.pointer, x = this.x(t);
    if (x < MARGIN.left || x > this.width - MARGIN.right) return;
    c.strokeStyle = style("--dim");
    c.beginPath(); c.moveTo(x, MARGIN.top); c.lineTo(x, this.height - MARGIN.bottom); c.stroke();
  }

  say() {
    const t = this.group.pointer;
    if (t === null) { this.readout.textContent = ""; return; }
    const values = this.lines.filter((line) => !line.hidden).map((line) => {
      const k = Math.round((t - line.t0) / line.dt);
      const low = line.low[k];
      return low === undefined || low === null ? null : `${line.short} ${((low + line.high[k]) / 2).toFixed(3)}`;
    }).filter(Boolean);
    this.readout.textContent = `${t.toFixed(2)} s: ${values.join(", ")}`;
  }

  listen() {
    const at = (event) => event.clientX - this.canvas.getBoundingClientRect().left;
    this.canvas.addEventListener("pointerdown", (event) => {
      this.drag = { from: at(event), to: at(event) };
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (this.drag) this.drag.to = at(event);
      this.group.point(this.time(at(event)));
    });
    this.canvas.addEventListener("pointerleave", () => this.group.point(null));
    const end = (event) => {
      const drag = this.drag;
      this.drag = null;
      if (!drag) return;
      if (Math.abs(drag.to - drag.from) > 8) this.group.look(this.time(Math.min(drag.from, drag.to)), this.time(Math.max(drag.from, drag.to)));
      else if (event.type === "pointerup") this.group.click(this.time(drag.to));
      this.draw();
    };
    this.canvas.addEventListener("pointerup", end);
    this.canvas.addEventListener("pointercancel", end);
    this.canvas.addEventListener("dblclick", () => this.group.look(...this.group.span));
    this.canvas.addEventListener("keydown", (event) => {
      const [a, b] = this.group.window, w = b - a;
      const moves = { ArrowLeft: [a - w / 4, b - w / 4], ArrowRight: [a + w / 4, b + w / 4], "+": [a + w / 4, b - w / 4], "-": [a - w / 2, b + w / 2], 0: this.group.span };
      if (!(event.key in moves)) return;
      event.preventDefault();
      this.group.look(...moves[event.key]);
    });
  }
}

// Plots with one axis of time. `onLook(begin, end)` after a change of the window, `onClick(t)` for a click.
export class Group {
  constructor(onLook, onClick = () => {}) {
    this.plots = [];
    this.span = this.window = [0, 1];
    this.pointer = null;
    this.onLook = onLook;
    this.click = onClick;
  }

  look(begin, end) {
    const [a, b] = this.span;
    const width = Math.min(b - a, Math.max(1e-3, end - begin));
    begin = Math.min(Math.max(a, begin), b - width);
    this.window = [begin, begin + width];
    this.draw();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.onLook(...this.window), 120);
  }

  point(t) {
    this.pointer = t;
    this.draw();
    for (const plot of this.plots) plot.say();
  }

  draw() {
    for (const plot of this.plots) plot.draw();
  }
}

// North over east, both to one scale. tracks: [{label, color, dash, dots, north, east}]
export function drawTracks(canvas, tracks) {
  const box = canvas.getBoundingClientRect();
  if (!box.width) return;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(box.width * ratio);
  canvas.height = Math.round(box.height * ratio);
  const c = canvas.getContext("2d");
  c.scale(ratio, ratio);
  c.font = FONT;
  const shown = tracks.filter((track) => !track.hidden && track.east.length);
  let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const track of shown) {
    for (let k = 0; k < track.east.length; k++) {
      west = Math.min(west, track.east[k]); east = Math.max(east, track.east[k]);
      south = Math.min(south, track.north[k]); north = Math.max(north, track.north[k]);
    }
  }
  if (!(east >= west)) return;
  const inner = { w: box.width - MARGIN.left - MARGIN.right, h: box.height - MARGIN.top - MARGIN.bottom };
  const metre = Math.max((east - west) / inner.w, (north - south) / inner.h, 0.01 / inner.w) * 1.08;
  const middle = { e: (east + west) / 2, n: (north + south) / 2 };
  const x = (e) => MARGIN.left + inner.w / 2 + (e - middle.e) / metre;
  const y = (n) => MARGIN.top + inner.h / 2 - (n - middle.n) / metre;
  c.strokeStyle = style("--line");
  c.fillStyle = style("--dim");
  const across = ticks(middle.e - (metre * inner.w) / 2, middle.e + (metre * inner.w) / 2, inner.w / 110);
  const up = ticks(middle.n - (metre * inner.h) / 2, middle.n + (metre * inner.h) / 2, inner.h / 60);
  c.textAlign = "center";
  c.textBaseline = "top";
  for (const e of across.found) {
    c.beginPath(); c.moveTo(x(e), MARGIN.top); c.lineTo(x(e), box.height - MARGIN.bottom); c.stroke();
    c.fillText(`${e.toFixed(digits(across.step))} m`, x(e), box.height - MARGIN.bottom + 5);
  }
  c.textAlign = "right";
  c.textBaseline = "middle";
  for (const n of up.found) {
    c.beginPath(); c.moveTo(MARGIN.left, y(n)); c.lineTo(box.width - MARGIN.right, y(n)); c.stroke();
    c.fillText(n.toFixed(digits(up.step)), MARGIN.left - 6, y(n));
  }
  for (const track of shown) {
    c.strokeStyle = c.fillStyle = track.color;
    c.setLineDash(track.dash ?? []);
    c.lineWidth = 1.6;
    c.beginPath();
    track.east.forEach((e, k) => {
      if (track.dots) c.rect(x(e) - 1, y(track.north[k]) - 1, 2, 2);
      else if (k) c.lineTo(x(e), y(track.north[k])); else c.moveTo(x(e), y(track.north[k]));
    });
    if (track.dots) c.fill(); else c.stroke();
  }
}
