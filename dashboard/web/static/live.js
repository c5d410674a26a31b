// The bar above the scene: device, where its data come from, recording, replay. Polled once a second.
import { call, toast } from "/static/rest.js";

const byId = (id) => document.getElementById(id);
const device = byId("device"), source = byId("source"), record = byId("record"), replay = byId("replay");
const mayOperate = record.dataset.operator === "1";
let recording = null;
let silent = 0;

const clock = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

function showDevices(devices) {
  const one = devices.find((d) => d.connected) ?? devices[0];
  if (!one) return showDevice("none", "no device yet", "");
  const more = devices.length > 1 ? ` +${devices.length - 1}` : "";
  const state = one.stale ? "stale" : one.connected ? "live" : "lost";
  const words = { stale: `silent for ${Math.round(one.age_s)} s`, live: `${one.sample_rate_hz.toFixed(0)} Hz`, lost: "not connected" };
  showDevice(state, `${one.name}${more}`, words[state], one.message);
  source.hidden = one.source === "unknown";
  source.textContent = one.source;
  source.className = `badge ${one.source}`;
}

function showDevice(state, name, detail, title = "") {
  device.dataset.state = state;
  device.title = title;
  const [, text] = device.children;
  text.replaceChildren(name);
  if (detail) {
    const small = document.createElement("small");
    small.textContent = detail;
    text.append(" ", small);
  }
}

function showRecording(now) {
  recording = now;
  record.disabled = !mayOperate || !now.available;
  record.classList.toggle("on", now.recording);
  record.setAttribute("aria-pressed", String(now.recording));
  record.querySelector("span").textContent = now.recording ? `Stop ${clock(now.seconds)}` : "Record";
  record.title = now.message || (now.recording ? `${now.session}, ${now.messages} messages, ${now.lost} lost` : "");
  if (!mayOperate) record.title = "Recording takes the role operator";
  replay.hidden = !now.replaying;
  replay.disabled = !mayOperate;
  replay.textContent = `Stop replay`;
  replay.title = now.replaying;
}

async function poll() {
  if (!document.hidden) {
    try {
      const [devices, state] = await Promise.all([call("devices"), call("recording")]);
      showDevices(devices);
      showRecording(state);
      silent = 0;
    } catch {
      if (++silent === 3) {
        showDevice("lost", "dashboard does not answer", "");
        record.disabled = true;
      }
    }
  }
  setTimeout(poll, 1000);
}

record.addEventListener("click", async () => {
  record.disabled = true;
  try {
    showRecording(recording.recording ? await call("recording/stop", {}) : await call("recording/start", {}));
    toast(recording.recording ? `Recording ${recording.session}` : `Recorded ${recording.session}`, "notice");
  } catch (error) {
    toast(error.message);
    record.disabled = false;
  }
});

replay.addEventListener("click", async () => {
  try {
    showRecording(await call("replay/stop", {}));
  } catch (error) {
    toast(error.message);
  }
});

poll();

// The scene keeps a chart's zoom as a share of its time axis, and reads that from a chart just made before the axis has
// its limits: one second of thirty is then shown for good. Nobody can have zoomed a chart that is so new: show all of it.
const firstSeen = new WeakMap();
const NEW_MS = 3000;

function showWholeOfNewCharts() {
  const charts = byId("scene").contentWindow?.__viserTestpoints?.uplots ?? {};
  for (const { chart } of Object.values(charts)) {
    if (!firstSeen.has(chart)) firstSeen.set(chart, Date.now());
    const t = chart.data?.[0];
    if (t?.length && Date.now() - firstSeen.get(chart) < NEW_MS) chart.setScale("x", { min: t[0], max: t[t.length - 1] });
  }
}
setInterval(showWholeOfNewCharts, 500);
