// Where a recording went, on the map, and the satellites at the moment that was chosen in a plot.
import { EMPTY, MapView, metre, points } from "/static/map/map.js";
import { call } from "/static/rest.js";

const AGAIN_MS = 700;
const by = (id) => document.getElementById(id);
const dark = () => (document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
let view = null, sky = null, known = [], at;

export async function showMap(path, moment) {
  at = moment;
  for (;;) {
    const told = await call(`${path}/map`).catch(() => null); // why it cannot be drawn is said above the plots
    if (!told) return;
    if (told.ways?.length) draw(told.ways);
    if (told.state === "done") return;
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
  }
}

function draw(told) {
  by("where").hidden = false;
  document.querySelector("main").dataset.mapped = "";
  view ??= new MapView(by("session-map"), "Map of the recording");
  known = told.map((way) => ({ ...way, ...points(way.latitude_deg, way.longitude_deg) }));
  redraw();
}

// The moment that was chosen: its places with what was said of their accuracy; of the end until one is chosen.
export function showAt(t) {
  at = t;
  if (known.length) redraw();
}

function nearest(times) {
  if (at === undefined) return times.length - 1;
  let best = 0;
  for (let k = 1; k < times.length; k++) if (Math.abs(times[k] - at) < Math.abs(times[best] - at)) best = k;
  return best;
}

function inWords(ellipse, quality, t) {
  const sure = ellipse ? `± ${metre(ellipse[0])} × ${metre(ellipse[1])} (2σ)` : "accuracy not said";
  return `${quality ? `${quality}, ` : ""}${sure} at ${t.toFixed(1)}\u00a0s`;
}

function redraw() {
  const several = new Set(known.map((way) => way.device)).size > 1, [first] = known;
  const ways = [], fixes = { x: [], y: [], quality: [], accuracy: [] }, said = [];
  let newest = -1;
  for (const way of known) {
    const k = nearest(way.t), ellipse = way.ellipse[k];
    said.push({ colour: way.dots ? "#8c8c8c" : way.colour, dots: way.dots, title: `${several ? `${way.device} ` : ""}${way.title}`, text: inWords(ellipse, way.dots ? way.quality[k] : "", way.t[k]) });
    if (way.dots) {
      newest = fixes.x.length + k;
      fixes.x.push(...way.x);
      fixes.y.push(...way.y);
      fixes.quality.push(...way.quality);
      fixes.accuracy.push(...way.ellipse.map((one) => one && northEast(one)));
    } else ways.push({ x: way.x, y: way.y, whole: true, colour: way.colour, now: { x: way.x[k], y: way.y[k], ellipse, heading: null, stale: false } });
  }
  view.set({ ...EMPTY, ways, fixes: { ...fixes, at: newest }, origin: { x: first.x[0], y: first.y[0] }, said });
}

// A receiver's accuracy lies along north and east.
const northEast = ([longer, shorter, bearing]) => (Math.abs(Math.cos(bearing)) > 0.5 ? [longer, shorter] : [shorter, longer]);

export async function showSky(path, at) {
  sky = { path, at };
  const told = await call(`${path}/sky?${new URLSearchParams({ at_s: at, dark: dark() })}`).catch(() => null);
  if (sky.at !== at || (!told && by("above").hidden)) return;
  by("above").hidden = false;
  by("sky-plot").hidden = !told;
  by("sky-said").textContent = told ? `At ${told.t_s.toFixed(1)} s: ${told.said}.` : "The receiver says nothing of satellites near this moment.";
  if (!told) return;
  by("sky-plot").src = `data:image/svg+xml,${encodeURIComponent(told.svg)}`;
  by("sky-plot").alt = `Sky plot: ${told.said}`;
}
document.addEventListener("gyrofree-theme", () => sky && showSky(sky.path, sky.at));
