// The row of workspaces: tabs, window, pause, view, notes; and what of it is kept for the person and for a link.
import { call, toast } from "/static/rest.js";
import { Derived } from "/static/derived.js";
import { listen } from "/static/keys.js";
import { drawTabs, moveByArrows } from "/static/tabs.js";
import { ask, choose, link, state, whenStated } from "/static/view.js";

const byId = (id) => document.getElementById(id);
const desk = byId("desk"), rooms = byId("rooms"), pages = byId("pages"), absent = byId("absent"), note = byId("note");
const ROOMS = ["watch", "test", "diagnose", "calibrate", "navigate"];
const KEPT = ["w", "p", "device", "window", "layers", "derived", "zoom"];
const SAVE_MS = 1500;
export const mayOperate = desk.dataset.operator === "1";
export const BARRED = desk.dataset.barred; // why no order here is this person's

const root = document.documentElement;
const isDark = () => (root.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";

// What a link asks comes first, then what was saved; the saved device gives way to a replay just begun.
function begin() {
  const asked = new URLSearchParams(location.search), saved = new URLSearchParams(desk.dataset.view);
  const fields = { dark: isDark() ? "1" : "0" };
  const linked = asked.has("w") || asked.has("p");
  for (const key of KEPT) {
    const from = asked.has(key) ? asked : linked && (key === "w" || key === "p") ? null : saved;
    if (from?.get(key) && !(key === "device" && from === saved)) fields[key] = from.get(key);
  }
  if (fields.p && !fields.w) delete fields.w;
  choose(fields);
  if (saved.get("device") && !asked.get("device")) ask({ prefer: saved.get("device") });
}

let saving = 0;
function keep() {
  clearTimeout(saving);
  saving = setTimeout(() => {
    if (state) call("me/view", { view: link(state, false) }).catch(() => {});
  }, SAVE_MS);
}

function chosen(fields) {
  choose(fields);
  keep();
}

export function turnTo(page, device) {
  chosen(device ? { p: page, device } : { p: page });
}

function draw(now) {
  const there = now.rooms.filter((room) => room.pages.length || room.key === now.workspace);
  drawTabs(rooms, there.map(({ key, title, hint }) => ({ key, title, hint: `${hint} (key ${ROOMS.indexOf(key) + 1})` })),
    now.workspace, (key) => chosen({ w: key }));
  const room = now.rooms.find((one) => one.key === now.workspace) ?? { pages: [], absent: [] };
  const tabs = room.pages.slice();
  if (!tabs.some((page) => page.key === now.page)) tabs.push({ key: now.page, title: now.title, hint: now.missing });
  drawTabs(pages, tabs, now.page, (key) => chosen({ p: key }));
  drawAbsent(now.rooms.filter((one) => one === room || !one.pages.length).flatMap((one) => one.absent));
  derived.show(now.derived);
  byId("window").value = now.window;
  const pause = byId("pause");
  pause.setAttribute("aria-pressed", String(now.paused));
  pause.textContent = now.paused ? "Go on" : "Pause";
  byId("paused").hidden = !now.paused;
  byId("follow").checked = now.follow;
  for (const box of byId("layers").querySelectorAll("input")) box.checked = now.layers.includes(box.value);
  byId("stage").setAttribute("aria-label", `${now.title}, ${now.device || "no device"}`);
  history.replaceState(null, "", `/?${link(now)}`);
}

const derived = new Derived(byId("derived"), {
  named: async () => (state?.device ? call(`devices/${encodeURIComponent(state.device)}/channels`) : { channels: [], functions: [] }),
  changed: (list) => chosen(list.length ? { derived: list.join(";"), p: "derived" } : { derived: "" }),
});

function drawAbsent(missing) {
  absent.hidden = !missing.length;
  const key = JSON.stringify(missing);
  if (absent.dataset.drawn === key) return;
  absent.dataset.drawn = key;
  absent.querySelector("dl").replaceChildren(...missing.flatMap(({ title, why }) => {
    const name = document.createElement("dt"), reason = document.createElement("dd");
    name.textContent = title;
    reason.textContent = why;
    return [name, reason];
  }));
}

const LAYERS = ["truth", "estimates", "sensors", "rate", "trajectory", "fixes", "ellipsoid", "grid"];
byId("layers").append(...LAYERS.map((layer) => {
  const label = document.createElement("label"), box = document.createElement("input");
  label.className = "tick";
  Object.assign(box, { type: "checkbox", value: layer, checked: true });
  label.append(box, ` ${layer}`);
  box.addEventListener("change", () => chosen({
    layers: [...byId("layers").querySelectorAll("input:checked")].map((one) => one.value).join("."),
  }));
  return label;
}));

const togglePause = () => ask({ pause: state?.paused ? "0" : "1" });
const resetCamera = () => ask({ do: "camera" });
const toggleFollow = () => choose({ follow: state?.follow ? "0" : "1" });

byId("window").addEventListener("change", (event) => chosen({ window: event.target.value, zoom: "none" }));
byId("pause").addEventListener("click", togglePause);
byId("paused").querySelector("button").addEventListener("click", togglePause);
byId("follow").addEventListener("change", toggleFollow);
byId("camera").addEventListener("click", resetCamera);
byId("devices").addEventListener("change", (event) => chosen({ device: event.target.value }));
document.addEventListener("gyrofree-theme", () => choose({ dark: isDark() ? "1" : "0" }));
byId("share").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText(location.href);
    toast("The link to this view is copied", "notice");
  } catch {
    toast(`The link to this view: ${location.href}`, "notice");
  }
});

async function remark(mark) {
  const text = note.value.trim();
  if (!mark && !text) return note.focus();
  if (!state?.device) return toast("There is no device to note something of");
  try {
    const kept = await call(`devices/${encodeURIComponent(state.device)}/notes`, { text, mark });
    note.value = "";
    toast(kept.message, "notice");
  } catch (error) {
    toast(error.message);
  }
}
byId("remark").addEventListener("submit", (event) => {
  event.preventDefault();
  if (mayOperate) remark(false);
});
byId("mark").addEventListener("click", () => remark(true));
if (!mayOperate) {
  for (const part of byId("remark").elements) Object.assign(part, { disabled: true, title: BARRED });
  if (innerWidth < 720) note.placeholder = BARRED; // a phone shows no title
}

const toggleTheme = () => document.querySelector("[data-theme-toggle]").click();
listen({
  ...Object.fromEntries(ROOMS.map((room, k) => [String(k + 1), () => chosen({ w: room })])),
  p: togglePause, f: toggleFollow, r: resetCamera, d: toggleTheme,
  n: () => { focus(); note.focus(); },
  m: () => (mayOperate ? remark(true) : toast(BARRED)),
  k: () => ask({ do: "play" }), j: () => ask({ do: "back" }), l: () => ask({ do: "on" }),
}, byId("scene"));
moveByArrows(rooms);
moveByArrows(pages);
// The scene's panels fit the page: of a phone, a tablet held upright, one held across, a desk.
const sizeOf = () => (innerWidth < 600 ? "s" : innerWidth < 1000 ? "n" : innerWidth < 1200 ? "m" : "l");
const fit = () => choose({ size: sizeOf() });
addEventListener("resize", () => sizeOf() !== size && fit(size = sizeOf()));
let size = sizeOf();
whenStated(draw);
fit();
begin();
