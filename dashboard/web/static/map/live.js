// The map of the live page: it takes the place of the scene while the page "Map" is open.
import { EMPTY, MapView, metre, points } from "/static/map/map.js";
import { mercator } from "/static/map/camera.js";
import { call } from "/static/rest.js";
import { choose, state, whenStated } from "/static/view.js";

const PAGE = "map";
const EVERY_MS = 300;
const FIXES = 6000; // kept
const DEG = 180 / Math.PI;
const host = document.getElementById("map"), frame = document.getElementById("scene");
let view = null, known = null;

// What the browser has of one device; begun anew with its axis of time.
const blank = (device, run) => ({ device, run, since: -1e12, ways: new Map(), rejected: { state: "", x: [], y: [] }, fixes: { x: [], y: [], quality: [], accuracy: [] } });

function grow(way, told) {
  if (told.state !== way.state || told.from !== way.x.length) {
    if (told.from) return; // of an answer that came too late
    Object.assign(way, { state: told.state, x: [], y: [] });
  }
  const { x, y } = points(told.latitude_deg, told.longitude_deg);
  way.x.push(...x);
  way.y.push(...y);
}

function placeOf(now) {
  if (now.latitude_deg === null) return null;
  const [x, y] = mercator(now.latitude_deg, now.longitude_deg);
  return { x, y, ellipse: now.ellipse, heading: now.heading_rad, stale: now.stale };
}

function inWords({ now }) {
  const parts = [];
  if (now.ellipse) parts.push(`± ${metre(now.ellipse[0])} × ${metre(now.ellipse[1])} (2σ)`);
  if (now.heading_rad !== null) parts.push(`heading ${(((now.heading_rad * DEG) % 360) + 360).toFixed(0) % 360}°`);
  if (now.why) parts.push(now.latitude_deg === null ? `no position: ${now.why}` : now.why);
  if (now.stale) parts.push("silent");
  return parts.join(" · ");
}

function receiverInWords({ quality, satellites, accuracy_m, why }) {
  if (quality === "none") return `no position: ${why}`;
  return [satellites ? `${quality}, ${satellites} satellites` : quality, accuracy_m ? `± ${metre(accuracy_m)} (2σ)` : "", why].filter(Boolean).join(" · ");
}

// The leading filter in a few words, which stand there also while the rest is folded.
function titleOf({ ways: [lead], receiver }) {
  if (!lead) return receiver.quality === "none" ? "No position" : `Receiver: ${receiver.quality}`;
  const { ellipse, latitude_deg } = lead.now;
  return `${lead.title}: ${latitude_deg === null ? "no position" : ellipse ? `± ${metre(ellipse[0])}` : "accuracy not known"}`;
}

function take(told) {
  if (known?.device !== told.device || known.run !== told.run) {
    known = blank(told.device, told.run);
    if (view) view.fitted = false;
  }
  for (const way of told.ways) {
    if (!known.ways.has(way.name)) known.ways.set(way.name, { state: "", x: [], y: [] });
    grow(known.ways.get(way.name), way);
  }
  grow(known.rejected, told.rejected);
  const { fixes } = known, fresh = points(told.fixes.latitude_deg, told.fixes.longitude_deg);
  for (const [key, values] of [["x", fresh.x], ["y", fresh.y], ["quality", told.fixes.quality], ["accuracy", told.fixes.accuracy_ne_m]]) {
    fixes[key].push(...values);
    fixes[key].splice(0, Math.max(0, fixes[key].length - FIXES));
  }
  if (told.fixes.t.length) known.since = told.fixes.t.at(-1);
  const ways = told.ways.map((way) => ({ ...known.ways.get(way.name), colour: way.colour, now: placeOf(way.now) }));
  const first = ways.find((way) => way.x.length) ?? { x: fixes.x, y: fixes.y };
  view.set({
    ways, fixes, rejected: known.rejected, origin: first.x.length ? { x: first.x[0], y: first.y[0] } : null,
    said: [
      ...told.ways.map((way) => ({ colour: way.colour, title: way.title, text: inWords(way) })),
      { colour: "#8c8c8c", dots: true, title: "receiver", text: receiverInWords(told.receiver) },
      ...(known.rejected.x.length ? [{ title: "✕", text: "fixes that the leading filter did not believe" }] : []),
    ],
    title: titleOf(told),
  });
}

async function poll() {
  const open = state?.page === PAGE && state.device && !document.hidden;
  if (open && view && !state.paused) {
    const { device } = state;
    const mine = known?.device === device ? known : null;
    const have = mine ? [...mine.ways, ["rejected", mine.rejected]].filter(([, way]) => way.state).map(([name, way]) => `${name}:${way.state}:${way.x.length}`) : [];
    try {
      const told = await call(`devices/${encodeURIComponent(device)}/map?${new URLSearchParams({ have: have.join(","), since: mine?.since ?? -1e12 })}`);
      const anew = mine && told.run !== mine.run; // its answer is of the old axis of time
      if (anew) known = null;
      else if (state.device === device) take(told);
    } catch {
      view.set({ ...(view.model ?? EMPTY), said: [{ colour: "#8c8c8c", title: device, text: "the dashboard does not answer" }] });
    }
  }
  setTimeout(poll, EVERY_MS);
}

// The part of the frame that its docked panels leave free; on a phone what is above their sheet.
function room() {
  const doc = frame.contentDocument, box = { left: 0, top: 0, right: frame.clientWidth, bottom: frame.clientHeight };
  for (const dock of doc?.querySelectorAll("[data-dock-region]") ?? []) {
    const edge = dock.getBoundingClientRect();
    if (!edge.width) continue;
    if (dock.dataset.dockRegion === "left") box.left = Math.max(box.left, edge.right);
    if (dock.dataset.dockRegion === "right") box.right = Math.min(box.right, edge.left);
  }
  for (const sheet of state?.size === "s" ? (doc?.querySelectorAll('div[style*="position: fixed"]') ?? []) : []) {
    const edge = sheet.getBoundingClientRect();
    if (edge.width > 0.8 * box.right && edge.top > 100) box.bottom = Math.min(box.bottom, edge.top);
  }
  return box;
}

function place() {
  if (host.hidden) return;
  const { left, top, right, bottom } = room();
  Object.assign(host.style, { left: `${frame.offsetLeft + left}px`, top: `${frame.offsetTop + top}px`, width: `${right - left}px`, height: `${bottom - top}px` });
}

whenStated((now) => {
  const open = now.page === PAGE;
  if (host.hidden === open) {
    host.hidden = !open;
    place();
  }
  if (open && !view) view = new MapView(host, "Map of the way", { follow: (on) => choose({ follow: on ? "1" : "0" }) });
  view?.setFollow(now.follow);
});
setInterval(place, 400);
addEventListener("resize", place);
poll();
