// Where a recording went, on the map, and the satellites at the moment that was chosen in a plot.
import { EMPTY, MapView, points } from "/static/map/map.js";
import { call } from "/static/rest.js";

const AGAIN_MS = 700;
const by = (id) => document.getElementById(id);
const dark = () => (document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
let view = null, sky = null;

export async function showMap(path) {
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
  const lines = told.filter((way) => !way.dots), dots = told.filter((way) => way.dots);
  const ways = [...lines, ...dots].map((way) => ({ ...points(way.latitude_deg, way.longitude_deg), colour: way.colour, dots: way.dots }));
  const [first] = ways, several = new Set(told.map((way) => way.device)).size > 1;
  const said = told.map((way) => ({ colour: way.colour, dots: way.dots, title: `${several ? `${way.device} ` : ""}${way.title}`, text: "" }));
  view.set({ ...EMPTY, ways, origin: { x: first.x[0], y: first.y[0] }, said });
}

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
