// The view inside the frame: what it states of itself, and how it is asked for something else. See scene/workspaces.py.
const frame = document.getElementById("scene");
const SPACING_MS = 150; // the scene takes an input's newest value only
const AGAIN_MS = 2000;

export let state = null;
const wish = {}; // what the person chose; a view that begins anew is asked again
let pending = {}, count = 0, sent = 0, last = "";
const listeners = [];

export const whenStated = (listener) => listeners.push(listener);

let stand = null; // what answers where there is no scene, see plain.js

export const standIn = (answer) => { stand = answer; };

// The state of the view, as it or who stands in for it says.
export function stateIs(now) {
  state = now;
  for (const listener of listeners) listener(now);
}

// Ask once.
export function ask(fields) {
  if (stand) stand(fields);
  else Object.assign(pending, fields);
}

// Ask, and hold to it when the connection is made anew.
export function choose(fields) {
  Object.assign(wish, fields);
  if ("p" in fields) delete wish.w; // a page is in one workspace: two wishes would turn it to and fro
  else if ("w" in fields) delete wish.p;
  ask(fields);
}

// A stretch of time as a link has it: UTC, s.
export const zoomed = (zoom) => (zoom?.length === 2 ? zoom.map((t) => t.toFixed(4)).join("_") : "none");
export const lines = (derived) => derived.map((one) => one.text).join(";");

const stated = (now) => ({
  w: now.workspace, p: now.page, device: now.device, window: now.window,
  size: now.size, layers: now.layers.join("."), follow: now.follow ? "1" : "0", dark: now.dark ? "1" : "0", pause: now.paused ? "1" : "0",
  zoom: zoomed(now.zoom), derived: lines(now.derived), quality: now.quality ?? "full",
});

// `moment`: with what is of this moment only, which a link has and what is kept for the person has not.
export function link(now, moment = true) {
  const of = stated(now);
  const fields = new URLSearchParams({ w: of.w, p: of.p });
  if (of.device) fields.set("device", of.device);
  fields.set("window", of.window);
  if (of.layers !== "truth.estimates.sensors.rate.trajectory.fixes.ellipsoid.grid") fields.set("layers", of.layers);
  if (of.derived) fields.set("derived", of.derived);
  if (moment && of.zoom !== "none") fields.set("zoom", of.zoom);
  return fields.toString();
}

function flush() {
  const doc = frame.contentDocument;
  const input = doc?.querySelector("div:has(> .gf-state) + div input");
  if (!input || Date.now() - sent < SPACING_MS || !Object.keys(pending).length) return;
  sent = Date.now();
  input.setAttribute("aria-label", "What the page asks of the view");
  input.tabIndex = -1;
  const line = new URLSearchParams({ ...pending, n: String(++count) }).toString();
  pending = {};
  const kind = frame.contentWindow;
  Object.getOwnPropertyDescriptor(kind.HTMLInputElement.prototype, "value").set.call(input, line);
  input.dispatchEvent(new kind.Event("input", { bubbles: true }));
}

function look() {
  if (stand) return;
  const text = frame.contentDocument?.querySelector(".gf-state")?.dataset.state;
  if (text && text !== last) {
    last = text;
    for (const area of frame.contentDocument.querySelectorAll("[data-scrollarea-viewport]:not([tabindex])")) {
      area.tabIndex = 0; // what scrolls is reached by the keyboard
    }
    stateIs(JSON.parse(text));
  }
  if (state && Date.now() - sent > AGAIN_MS) {
    const now = stated(state);
    for (const [key, value] of Object.entries(wish)) {
      if (key in now && now[key] !== value && (key !== "device" || state.devices.includes(value))) ask({ [key]: value });
    }
  }
  flush();
}
setInterval(look, 100);
