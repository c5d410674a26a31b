// The charts inside the scene's frame, which has the same origin: they get the tools of figure.js and cursors.js. What
// they show stands in the heading above each (data-chart); see dashboard/scene/drawing/chart.py.
import { Cursors, pictures } from "/static/cursors.js";
import { keyed, selectable } from "/static/drag.js";
import { dress, gapsOf } from "/static/figure.js";
import { ask, choose, state, whenStated, zoomed } from "/static/view.js";

const LOOK_MS = 250;
const LEAST_S = 0.01; // of a zoom
const EDGE = /[+−]3σ$/;
const NAMELESS = "Value"; // what uPlot calls a series without a label
const frame = document.getElementById("scene");
const known = new WeakSet(); // charts that have their tools
const banner = document.getElementById("zoomed");
let stretch = "";

const cursors = new Cursors((a, b) => {
  stretch = a === null ? "" : `${a}_${b}`;
  ask({ cursors: stretch || "none" });
});

// The heading of a chart is the nearest one above it.
function headingOf(chart, headings) {
  let found = null;
  for (const one of headings) {
    if (one.compareDocumentPosition(chart.root) & Node.DOCUMENT_POSITION_FOLLOWING) found = one;
    else break;
  }
  return found;
}

function told(chart) {
  const heading = headingOf(chart, chart.root.ownerDocument.querySelectorAll(".gf-chart[data-chart]"));
  try {
    return JSON.parse(heading?.dataset.chart ?? "{}");
  } catch {
    return {};
  }
}

const asked = (measured) => Object.values(measured ?? {}).every(({ at }) => `${at[0]}_${at[1]}` === stretch);

const overTime = (chart) => chart.scales.x.distr !== 3; // a spectrum has logarithmic axes
const upright = (chart) => (overTime(chart) ? "y" : "level");

// A line that is not known for a while is no line there, though the points that were sent go on.
function holed(chart) {
  chart.series.forEach((series, k) => {
    if (!k) return;
    const { label = "" } = series, mine = label.replace(EDGE, "").trim();
    series.gaps = (u, at, from, to, found) => {
      const { holes = {}, faint = {} } = told(u);
      const own = mine === label ? (faint[label] ?? []) : (holes[label] ?? []); // a band where it is not known
      return gapsOf(u, found, [...(holes[mine] ?? []), ...own]);
    };
  });
}

function describe(chart) {
  const { title = "", unit = "", origin = "", across = "", ranges = [], shades = [], unsure = {}, faint = {}, measured = null } = told(chart), high = upright(chart);
  const [x, ...data] = chart.data;
  const lines = () => chart.series.slice(1).map((series, k) => ({ series, k })).filter(({ series }) => series.scale === high && series.show && series.label && series.label !== NAMELESS && !EDGE.test(series.label))
    .map(({ series, k }) => ({
      label: overTime(chart) ? series.label : "", color: series._stroke ?? series.stroke, dash: series.dash, width: 1.4, x, low: data[k], high: data[k],
      unsure: unsure[series.label], faint: faint[series.label] ?? [],
      half: EDGE.test(chart.series[k + 2]?.label ?? "") ? [data[k + 1], data[k + 2]] : null,
    })).map((line) => ({ ...line, color: typeof line.color === "function" ? line.color(chart, 0) : line.color }));
  return { title, unit, origin, across, ranges, shades, lines, high, measured: measured && asked(measured) ? measured : null };
}

// A zoom is the view's, so that its charts are drawn anew from every sample, stay while data come in, and are the same
// on every page and in the link. Times of a chart are s on the device's axis; those of a zoom are UTC.
function zoom(a, b) {
  if (!state || !(b - a >= LEAST_S)) return;
  choose({ zoom: zoomed([a + state.utc0, b + state.utc0]) });
}
const follow = () => choose({ zoom: "none" });

function press(event, chart) {
  if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "0") { event.preventDefault(); return follow(); }
  const to = keyed(event.key, [chart.scales.x.min, chart.scales.x.max], null);
  if (!to) return;
  event.preventDefault();
  event.stopPropagation();
  zoom(...to);
}

function equip(chart) {
  known.add(chart);
  if (!overTime(chart)) return pictures(chart, chart.root, () => describe(chart));
  dress(chart, () => describe(chart));
  cursors.add(chart, chart.root, () => describe(chart));
  const mine = (event) => event.stopImmediatePropagation(); // uPlot would zoom in what it has been sent
  chart.over.addEventListener("mousedown", mine, true);
  chart.over.addEventListener("dblclick", (event) => { mine(event); follow(); }, true);
  selectable(chart, zoom);
  chart.root.addEventListener("keydown", (event) => press(event, chart));
}

function look() {
  const charts = frame.contentWindow?.__viserTestpoints?.uplots ?? {};
  for (const { chart } of Object.values(charts)) {
    const t = chart.data?.[0];
    if (!t?.length) continue;
    if (!known.has(chart)) equip(chart);
    if (overTime(chart)) holed(chart); // series may be new ones
    // The scene keeps a chart's zoom as a share of its time axis, and reads that from a chart just made before the axis
    // has its limits: one second of thirty is then shown for good. Over time, what is sent is what is to be seen.
    const { min, max } = chart.scales.x, off = min !== t[0] || max !== t[t.length - 1];
    if (off && overTime(chart) && t[t.length - 1] > t[0]) chart.setScale("x", { min: t[0], max: t[t.length - 1] });
  }
  if (cursors.at) cursors.refresh();
}
setInterval(look, LOOK_MS);

const clock = (s) => new Date(s * 1000).toISOString().slice(11, 23);

whenStated((now) => {
  const is = now.zoom.length === 2;
  banner.hidden = !is;
  if (!is) return;
  const [a, b] = now.zoom, long = (b - a).toPrecision(3);
  banner.querySelector("span").textContent = now.kept
    ? `Zoomed: ${clock(a)} to ${clock(b)} UTC, ${long} s · data keep coming in`
    : `Zoomed: ${clock(a)} to ${clock(b)} UTC: data of that time are not held here any more`;
});
banner.querySelector("button").addEventListener("click", follow);
