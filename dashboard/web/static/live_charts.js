// The charts inside the scene's frame, which has the same origin: they get the tools of figure.js and cursors.js. What
// they show stands in the heading above each (data-chart); see dashboard/scene/drawing/chart.py.
import { Cursors } from "/static/cursors.js";
import { dress } from "/static/figure.js";
import { ask } from "/static/view.js";

const LOOK_MS = 500;
const NEW_MS = 3000;
const EDGE = /[+−]3σ$/;
const NAMELESS = "Value"; // what uPlot calls a series without a label
const frame = document.getElementById("scene");
const known = new WeakMap(); // chart -> when it was first seen
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

function describe(chart) {
  const { title = "", unit = "", origin = "", ranges = [], measured = null } = told(chart);
  const [x, ...data] = chart.data;
  const lines = () => chart.series.slice(1).map((series, k) => ({ series, k })).filter(({ series }) => series.scale === "y" && series.show && series.label && series.label !== NAMELESS && !EDGE.test(series.label))
    .map(({ series, k }) => ({
      label: series.label, color: series._stroke ?? series.stroke, dash: series.dash, width: 1.4, x, low: data[k], high: data[k],
      half: EDGE.test(chart.series[k + 2]?.label ?? "") ? [data[k + 1], data[k + 2]] : null,
    })).map((line) => ({ ...line, color: typeof line.color === "function" ? line.color(chart, 0) : line.color }));
  return { title, unit, origin, ranges, lines, measured: measured && asked(measured) ? measured : null };
}

function look() {
  const charts = frame.contentWindow?.__viserTestpoints?.uplots ?? {};
  for (const { chart } of Object.values(charts)) {
    const t = chart.data?.[0];
    if (!t?.length) continue;
    if (!known.has(chart)) {
      known.set(chart, Date.now());
      if (chart.scales.y) {
        dress(chart, () => describe(chart));
        cursors.add(chart, chart.root, () => describe(chart));
      }
    }
    // The scene keeps a chart's zoom as a share of its time axis, and reads that from a chart just made before the axis
    // has its limits: one second of thirty is then shown for good. Nobody can have zoomed a chart that is so new.
    const spans = chart.scales.x?.distr !== 3 && t[t.length - 1] > t[0];
    if (spans && Date.now() - known.get(chart) < NEW_MS) chart.setScale("x", { min: t[0], max: t[t.length - 1] });
  }
  if (cursors.at) cursors.refresh();
}
setInterval(look, LOOK_MS);
