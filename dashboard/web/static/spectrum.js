// Spectral density and Allan deviation of one curve of a recording: of the stretch between the cursors, else of what is
// shown. The figures come from every value of the curve, not from the points of the screen.
import { axis, onTheme, style } from "/static/chart.js";
import { pictures } from "/static/cursors.js";
import { call } from "/static/rest.js";

const { uPlot } = window;
const LOOK_MS = 300;
const FIRST = "omega_z";
const ENDS = 1e-3; // of a decade
const power = (v) => (v >= 0.01 && v < 1e5 ? String(Number(v.toPrecision(1))) : v.toExponential(0).replace("-", "−"));

// Whole decades around some values; a logarithmic axis has no others that are sure to end its search for ticks.
function decades(values) {
  const low = Math.floor(Math.log10(Math.min(...values)) + ENDS), high = Math.ceil(Math.log10(Math.max(...values)) - ENDS);
  return [10 ** low, 10 ** Math.max(high, low + 1)];
}

class Figure {
  constructor(root) {
    Object.assign(this, { root, host: root.querySelector(".chart"), chart: null, told: null });
    new ResizeObserver(() => this.chart ? this.chart.setSize({ width: this.host.clientWidth, height: this.host.clientHeight }) : this.draw()).observe(this.host);
    onTheme(() => this.draw());
  }

  // told: {title, unit, across, x, y}; null for nothing.
  set(told) {
    this.root.hidden = !told;
    this.told = told;
    this.draw();
  }

  draw() {
    this.chart?.destroy();
    this.chart = null;
    const { clientWidth: width, clientHeight: height } = this.host;
    if (!this.told || !width || !height) return;
    const { title, unit, across, x, y } = this.told;
    this.root.querySelector("figcaption > span").textContent = title;
    this.root.querySelector("small").textContent = `${unit} over ${across}`;
    const whole = { values: (_, splits) => splits.map((v) => (v && Math.abs(Math.log10(v) - Math.round(Math.log10(v))) < 1e-6 ? power(v) : "")) };
    this.chart = new uPlot({
      width, height, legend: { show: false }, padding: [8, 14, 0, 0], cursor: { show: false },
      series: [{}, { scale: "level", stroke: style("--blue"), width: 1.5, points: { show: false } }],
      scales: { x: { time: false, distr: 3, auto: false, range: decades(x) }, level: { distr: 3, auto: false, range: decades(y) } },
      axes: [axis("", { size: 32, incrs: undefined, ...whole }), axis("", { size: 58, scale: "level", incrs: undefined, ...whole })],
    }, [x, y], this.host);
    const figure = () => ({ title, unit, across, ranges: [], high: "level", lines: () => [{ label: "", color: "#0072b2", width: 1.4, x, low: y, high: y }] });
    this.root.querySelector(".gf-tools")?.remove();
    pictures(this.chart, this.root, figure);
  }
}

// root holds the choice and two figures; stretch() gives [begin, end], own() a person's expressions.
export class Spectrum {
  constructor(root, path, { stretch, own }) {
    Object.assign(this, { root, path, stretch, own, turn: 0, timer: 0, names: [], asked: "" });
    this.choice = root.querySelector("select");
    this.said = root.querySelector("[role=status]");
    [this.density, this.allan] = [...root.querySelectorAll("figure")].map((one) => new Figure(one));
    this.choice.addEventListener("change", () => this.ask());
    root.addEventListener("toggle", () => root.open && this.begin());
  }

  async begin() {
    if (!this.names.length) {
      const { channels } = await call(`${this.path}/channels`).catch(() => ({ channels: [] }));
      this.names = channels;
    }
    this.offer();
    this.ask();
  }

  offer() {
    const before = this.choice.value, lines = this.own();
    const names = [...this.names.map(({ name, who }) => [name, `${name} · ${who}`]), ...lines.map((line) => [line, line])];
    this.choice.replaceChildren(...names.map(([name, shown]) => new Option(shown, name)));
    const known = names.map(([name]) => name);
    this.choice.value = [before, FIRST].find((name) => known.includes(name)) ?? known[0] ?? "";
  }

  // The stretch or the curves may have changed.
  changed() {
    if (!this.root.open) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => (this.names.length ? (this.offer(), this.ask()) : this.begin()), LOOK_MS);
  }

  async ask() {
    const curve = this.choice.value, [begin, end] = this.stretch();
    const query = new URLSearchParams({ curve, begin, end }).toString();
    if (!curve || query === this.asked) return;
    const mine = ++this.turn;
    const told = await call(`${this.path}/spectrum?${query}`).catch((error) => ({ said: error.message }));
    if (mine !== this.turn) return;
    this.asked = told.unit === undefined ? "" : query;
    this.said.textContent = `${begin.toFixed(2)} to ${end.toFixed(2)} s: ${told.said}.`;
    const { unit } = told, of = this.choice.selectedOptions[0]?.textContent ?? curve;
    this.density.set(told.density && { ...told.density, title: `Spectral density of ${of}`, unit: `${unit}/√Hz`, across: "frequency, Hz" });
    const walk = told.allan?.random_walk;
    const n = walk === null || walk === undefined ? "" : `, N = ${Number(walk.toPrecision(3))} ${unit}·√s`;
    this.allan.set(told.allan && { ...told.allan, title: `Allan deviation${n}`, unit, across: "τ, s" });
  }
}
