// Two cursors for all charts of a page, and what lies between them: mean, sigma, RMS, slope, peak to peak. The figures
// come from `measure(a, b)`, that is from every sample; what is told to be `drawn` comes from the points of the screen.
import { saveSvg, savePng } from "/static/figure.js";

const COLOURS = ["#e0a000", "#1e9c9c"];
const GRIP = 8; // px

const digits = (v) => (v === null || v === undefined || !Number.isFinite(v) ? "–" : (v !== 0 && (Math.abs(v) < 1e-3 || Math.abs(v) >= 1e5) ? v.toExponential(2) : String(Number(v.toPrecision(4)))).replace("-", "−"));

// Of what is drawn: the middle of least and greatest of every point.
export function drawn(line, a, b) {
  const x = [], y = [];
  for (let k = 0; k < line.x.length; k++) {
    const low = line.low[k], high = line.high[k];
    if (line.x[k] < a || line.x[k] > b || low === null || low === undefined || !Number.isFinite(low)) continue;
    x.push(line.x[k]);
    y.push((low + high) / 2);
  }
  const n = y.length, sum = (values) => values.reduce((s, v) => s + v, 0);
  if (n < 2) return { n, mean: n ? y[0] : null, sigma: null, rms: null, slope: null, p2p: null };
  const mean = sum(y) / n, middle = sum(x) / n;
  return {
    n, mean, sigma: Math.sqrt(sum(y.map((v) => (v - mean) ** 2)) / (n - 1)), rms: Math.sqrt(sum(y.map((v) => v * v)) / n),
    slope: sum(x.map((t, k) => (t - middle) * (y[k] - mean))) / sum(x.map((t) => (t - middle) ** 2)), p2p: Math.max(...y) - Math.min(...y),
  };
}

// The tools that save a chart as a picture; host gets them.
export function pictures(u, host, describe) {
  const doc = host.ownerDocument, bar = doc.createElement("div");
  bar.className = "gf-tools";
  const button = (label, title, work) => {
    const made = doc.createElement("button");
    Object.assign(made, { type: "button", textContent: label, title });
    made.setAttribute("aria-label", title);
    made.addEventListener("click", work);
    bar.append(made);
    return made;
  };
  button("SVG", "Save the figure as SVG", () => saveSvg(u, describe()));
  button("PNG", "Save the figure as PNG", () => savePng(u, describe()));
  (host.querySelector("figcaption") ?? host).append(bar);
  return { bar, button };
}

// Charts that share two cursors. changed(a, b) after each change, with nulls when there are none.
export class Cursors {
  constructor(changed = () => {}) {
    Object.assign(this, { changed, at: null, active: 0, held: new Set() });
  }

  // describe() gives the figure (figure.js) with `measured`: {label: {n, mean, ...}} or null; host takes tools and table.
  add(u, host, describe) {
    const one = { u, host, describe, table: null };
    for (const old of [...this.held]) if (!old.u.root.isConnected) this.held.delete(old);
    this.held.add(one);
    this.tools(one);
    (u.hooks.draw ??= []).push(() => this.draw(u));
    host.addEventListener("keydown", (event) => this.key(event, u), true);
    u.over.addEventListener("pointerdown", (event) => this.down(event, u), true);
    this.show(one);
  }

  tools(one) {
    const { bar, button } = pictures(one.u, one.host, one.describe);
    one.switch = button("‖", "Two cursors (key C; arrows move one, X takes the other, Esc clears)", () => this.toggle(one.u));
    bar.prepend(one.switch);
    if (!one.host.querySelector("[tabindex]")) one.host.tabIndex = 0;
  }

  toggle(u) {
    if (this.at) return this.set(null);
    const { min, max } = u.scales.x;
    this.set([min + (max - min) / 3, min + (2 * (max - min)) / 3]);
  }

  set(at) {
    this.at = at;
    this.changed(...(at ? [Math.min(...at), Math.max(...at)] : [null, null]));
    this.refresh();
  }

  refresh() {
    for (const one of this.held) {
      if (!one.u.root.isConnected) { this.held.delete(one); continue; }
      one.u.redraw(false);
      this.show(one);
    }
  }

  key(event, u) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const done = () => { event.preventDefault(); event.stopImmediatePropagation(); };
    if (event.key.toLowerCase() === "c") { done(); this.toggle(u); }
    if (!this.at) return;
    if (event.key === "Escape") { done(); this.set(null); }
    if (event.key.toLowerCase() === "x") { done(); this.active = 1 - this.active; this.refresh(); }
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!way) return;
    done();
    const { min, max } = u.scales.x, at = [...this.at];
    at[this.active] = Math.min(max, Math.max(min, at[this.active] + (way * (max - min)) / (event.shiftKey ? 10 : 100)));
    this.set(at);
  }

  // A press near a cursor takes it along.
  down(event, u) {
    if (!this.at || event.button) return;
    const place = (e) => e.clientX - u.over.getBoundingClientRect().left;
    const near = this.at.map((t) => Math.abs(u.valToPos(t, "x") - place(event)));
    const mine = near[0] <= near[1] ? 0 : 1;
    if (near[mine] > GRIP) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.active = mine;
    const swallow = (e) => { e.preventDefault(); e.stopImmediatePropagation(); };
    const move = (e) => {
      const at = [...this.at];
      at[mine] = u.posToVal(Math.min(u.over.clientWidth, Math.max(0, place(e))), "x");
      this.at = at;
      this.refresh();
    };
    const end = () => {
      u.over.removeEventListener("pointermove", move, true);
      this.set(this.at);
    };
    u.over.addEventListener("mousedown", swallow, { capture: true, once: true }); // the chart would zoom
    u.over.setPointerCapture(event.pointerId);
    u.over.addEventListener("pointermove", move, true);
    for (const kind of ["pointerup", "pointercancel"]) u.over.addEventListener(kind, end, { once: true });
  }

  draw(u) {
    if (!this.at) return;
    const c = u.ctx, { left, top, width, height } = u.bbox, px = devicePixelRatio;
    c.save();
    c.setLineDash([]);
    this.at.forEach((t, k) => {
      const x = u.valToPos(t, "x", true);
      if (x < left || x > left + width) return;
      c.strokeStyle = c.fillStyle = COLOURS[k];
      c.lineWidth = (k === this.active ? 2 : 1.2) * px;
      c.beginPath(); c.moveTo(x, top); c.lineTo(x, top + height); c.stroke();
      c.font = `bold ${11 * px}px sans-serif`;
      c.textBaseline = "bottom";
      c.textAlign = "left";
      c.fillText("AB"[k], x + 3 * px, top + height - 2 * px);
    });
    c.restore();
  }

  show(one) {
    one.switch.setAttribute("aria-pressed", String(Boolean(this.at)));
    if (!this.at) { one.table?.remove(); one.table = null; return; }
    const doc = one.host.ownerDocument;
    if (!one.table) {
      one.table = doc.createElement("div");
      one.table.className = "gf-between";
      one.table.setAttribute("role", "status");
      one.host.append(one.table);
    }
    const [a, b] = [Math.min(...this.at), Math.max(...this.at)], figure = one.describe(), unit = figure.unit;
    const cell = (tag, words) => { const made = doc.createElement(tag); made.textContent = words; return made; };
    const row = (tag, cells) => { const made = doc.createElement("tr"); made.append(...cells.map((words) => cell(tag, words))); return made; };
    const table = doc.createElement("table");
    table.append(row("th", ["", `mean, ${unit}`, "σ", "RMS", `slope, ${unit}/s`, "peak to peak", "n"]));
    let rough = false;
    for (const line of figure.lines().filter((l) => l.label)) {
      const told = figure.measured?.[line.label], found = told ?? (line.unsure ? { n: "…", word: line.unsure } : drawn(line, a, b));
      rough ||= !told;
      const of = found.word ? `${found.n} of ${found.of ?? "…"}, else ${found.word}` : String(found.n);
      const made = row("td", [line.label, found.n === 0 && found.word ? found.word : digits(found.mean), digits(found.sigma), digits(found.rms), digits(found.slope), digits(found.p2p), of]);
      made.firstChild.style.color = line.color;
      table.append(made);
    }
    const words = `A to B, ${a.toFixed(3)} s to ${b.toFixed(3)} s: ${(b - a).toFixed(3)} s, ${rough ? "of the points drawn" : `of ${figure.of ?? "every sample"}`}${figure.provisional ? "; provisional: the recording is still being read" : ""}`;
    one.table.classList.toggle("provisional", Boolean(figure.provisional || rough));
    one.table.replaceChildren(cell("p", words), table);
  }
}
