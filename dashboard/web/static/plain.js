// The live page where the browser has no WebGL: the scene and its panels cannot be there, so it says why, and shows
// the newest values and the way on a plain grid.
import { hasWebgl } from "/static/map/tiles.js";
import { call } from "/static/rest.js";
import { standIn, state, stateIs } from "/static/view.js";

const EVERY_MS = 1000;
const DEG = 180 / Math.PI;
const page = { key: "map", title: "Map", hint: "Where it goes, on a plain grid" };
const room = { key: "navigate", title: "Navigate", hint: "Position and newest values", pages: [page], absent: [] };
const now = {
  devices: [], device: "", workspace: room.key, page: page.key, title: page.title, missing: "", rooms: [room], window: "30", paused: false,
  utc0: 0, zoom: [], kept: true, derived: [], dark: true, follow: true, size: "l", layers: [],
};
const number = (v, digits) => (v === null || v === undefined ? "–" : v.toFixed(digits).replace("-", "−"));

function answer(fields) {
  for (const key of ["device", "size"]) if (fields[key]) now[key] = fields[key];
  for (const [key, name] of [["follow", "follow"], ["pause", "paused"], ["dark", "dark"]]) if (key in fields) now[name] = fields[key] === "1";
  if (fields.prefer && !now.device) now.device = fields.prefer;
  if (state) stateIs({ ...now });
}

// What a device's leading estimators say, as [name, value]; what is not known has no number.
async function values(name) {
  const path = `devices/${encodeURIComponent(name)}`, rows = [];
  const { ways } = await call(`${path}/map?since=1e12`);
  // what navigates says its place, what does not its rate
  const nav = ways.length ? await call(`${path}/nav`).catch(() => null) : null;
  const rate = nav ? null : await call(`${path}/rate`).catch(() => null);
  rate?.omega_radps.forEach((v, k) => {
    const seen = rate.sight[k] ?? "valid";
    rows.push([`ω${"xyz"[k]}, °/s`, seen === "blind" ? "blind" : `${seen === "ambiguous" ? "± " : ""}${number(v === null ? v : v * DEG, 1)}`]);
  });
  if (rate?.why) rows.push(["", rate.why]);
  if (nav) {
    rows.push(["latitude, °", number(nav.latitude_deg, 6)], ["longitude, °", number(nav.longitude_deg, 6)]);
    const v = nav.v_n_mps;
    rows.push(["speed, km/h", number(v && Math.hypot(v[0], v[1]) * 3.6, 1)]);
    if (nav.why) rows.push(["", nav.why]);
  }
  if (rate?.stale || nav?.stale) rows.push(["", "silent: these values are old"]);
  return rows.length ? rows : [["", "no estimator speaks of this device"]];
}

async function poll(list) {
  try {
    const devices = await call("devices");
    now.devices = devices.map((one) => one.name);
    if (!now.devices.includes(now.device)) now.device = now.devices[0] ?? "";
    stateIs({ ...now });
    const rows = now.device ? await values(now.device) : [["", "no device has spoken yet"]];
    list.replaceChildren(...rows.flatMap(([name, value]) => {
      const term = document.createElement("dt"), told = document.createElement("dd");
      term.textContent = name;
      told.textContent = value;
      return [term, told];
    }));
  } catch { /* the bar says that the dashboard does not answer */ }
  setTimeout(() => poll(list), EVERY_MS);
}

if (hasWebgl()) document.getElementById("scene").src = "/scene/"; // from here, so that it is not begun in vain
else {
  const why = document.getElementById("plain");
  document.body.classList.add("no-webgl");
  why.hidden = false;
  standIn(answer);
  poll(why.querySelector("dl"));
}
