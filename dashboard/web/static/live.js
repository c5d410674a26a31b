// The bar above the scene: device, where its data come from, alarms, recording, replay. Polled once a second.
import "/static/live_charts.js";
import { call, toast } from "/static/rest.js";
import { command, whenCommand } from "/static/command.js";
import { BARRED, mayOperate, turnTo } from "/static/desk.js";
import { tell } from "/static/told.js";
import { state } from "/static/view.js";

const byId = (id) => document.getElementById(id);
const device = byId("device"), choice = byId("devices"), source = byId("source"), late = byId("late"), alarms = byId("alarms");
const record = byId("record"), replay = byId("replay"), session = byId("session");
const SURE_MS = 4000; // in which a second click ends the recording
const SHOWN = 3; // alarms; the others are counted
let recording = null;
let sure = 0;
let silent = 0;

const clock = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

function showDevices(devices) {
  const one = devices.find((d) => d.name === state?.device) ?? devices.find((d) => d.connected) ?? devices[0];
  showChoice(state?.devices ?? devices.map((d) => d.name), state?.device ?? one?.name);
  late.hidden = !one?.late?.shown;
  late.textContent = one?.late?.said ?? "";
  late.title = one?.late?.details ?? "";
  if (!one) {
    source.hidden = true;
    return showDevice("none", state?.device || "no device yet", state?.device ? "" : "waiting for a gateway");
  }
  const kind = one.stale ? "stale" : one.connected ? "live" : "lost";
  const words = { stale: `silent for ${Math.round(one.age_s)} s`, live: `${one.sample_rate_hz.toFixed(0)} Hz`, lost: "not connected" };
  showDevice(kind, one.name, words[kind], one.message);
  source.hidden = one.source === "unknown";
  source.textContent = one.source;
  source.className = `badge ${one.source}`;
}

function showChoice(names, chosen) {
  choice.hidden = names.length < 2;
  device.classList.toggle("chosen-beside", names.length > 1);
  const key = JSON.stringify(names);
  if (choice.dataset.drawn !== key) {
    choice.dataset.drawn = key;
    choice.replaceChildren(...names.map((name) => new Option(name, name)));
  }
  if (chosen && document.activeElement !== choice) choice.value = chosen;
}

function showDevice(kind, name, detail, title = "") {
  device.dataset.state = kind;
  device.title = title;
  const [, text] = device.children;
  const strong = document.createElement("b"), small = document.createElement("small");
  strong.textContent = name;
  small.textContent = detail;
  text.replaceChildren(strong, " ", small);
}

// Of all devices; those of the one that is shown stand first.
function showAlarms(devices, bench) {
  const mine = (d) => d.name === state?.device;
  const found = [...bench, ...devices.slice().sort((a, b) => mine(b) - mine(a))
    .flatMap((d) => d.alarms.map((alarm) => ({ ...alarm, device: d.name, other: !mine(d) })))];
  tell(found);
  const key = JSON.stringify(found);
  if (alarms.dataset.drawn === key) return;
  alarms.dataset.drawn = key;
  alarms.hidden = !found.length;
  alarms.replaceChildren(...found.slice(0, SHOWN).map(alarmButton));
  if (found.length > SHOWN) {
    const more = document.createElement("span");
    more.textContent = `and ${found.length - SHOWN} more`;
    more.title = found.slice(SHOWN).map((alarm) => `${alarm.title}: ${alarm.text}`).join("\n");
    alarms.append(more);
  }
}

// A text with the first of each word explained; words: [[word, meaning]].
function explained(text, words) {
  const found = words.map(([word, meaning]) => [text.toLowerCase().indexOf(word.toLowerCase()), word, meaning])
    .filter(([at]) => at >= 0).sort(([a], [b]) => a - b);
  const parts = [];
  let done = 0;
  for (const [at, word, meaning] of found) {
    if (at < done) continue;
    const term = document.createElement("abbr");
    Object.assign(term, { textContent: text.slice(at, at + word.length), title: meaning });
    parts.push(text.slice(done, at), term);
    done = at + word.length;
  }
  return [...parts, text.slice(done)];
}

function alarmButton(alarm) {
  const button = document.createElement(alarm.page ? "button" : "span");
  const strong = document.createElement("b"), text = document.createElement("span"), words = Object.entries(alarm.words);
  strong.append(...explained(`▲ ${alarm.other ? `${alarm.device}: ` : ""}${alarm.title}`, words));
  text.append(...explained(alarm.text, words));
  button.className = `alarm ${alarm.level} ${alarm.state}`;
  const noted = alarm.state === "acknowledged" ? ["acknowledged"] : [];
  button.title = [alarm.text, ...noted, ...words.map(([word, meaning]) => `${word}: ${meaning}`)].join("\n");
  button.append(strong, text);
  if (alarm.page) {
    button.type = "button";
    button.addEventListener("click", () => turnTo(alarm.page, alarm.other ? alarm.device : undefined));
  }
  return button;
}

function showRecording(now) {
  recording = now;
  const may = mayOperate && command.may;
  record.disabled = !may || !now.available;
  record.classList.toggle("on", now.recording);
  record.setAttribute("aria-pressed", String(now.recording));
  if (!now.recording) sure = 0;
  const asks = sure > Date.now();
  record.classList.toggle("asks", asks);
  record.querySelector("span").textContent = now.recording ? `${asks ? "Really stop" : "Stop"} ${clock(now.seconds)}` : "Record";
  record.title = now.message || (now.recording ? `${now.session}, ${now.messages} messages, ${now.lost} lost` : "");
  session.disabled = !may || !now.available || now.recording;
  session.placeholder = now.recording ? now.session : "Session name";
  session.title = now.recording ? now.session : "Empty: it is called by its time";
  if (!may) record.title = session.title = BARRED || command.why;
  replay.hidden = !now.replaying;
  replay.disabled = !mayOperate;
  replay.textContent = `Stop replay`;
  replay.title = mayOperate ? now.replaying : `${now.replaying}: ${BARRED}`;
}

async function poll() {
  if (!document.hidden) {
    try {
      const [devices, now] = await Promise.all([call("devices"), call("recording")]);
      showDevices(devices);
      showAlarms(devices, now.alarms);
      showRecording(now);
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

async function startOrStop() {
  if (recording.recording && sure < Date.now()) {
    sure = Date.now() + SURE_MS;
    showRecording(recording);
    setTimeout(() => showRecording(recording), SURE_MS + 50);
    return;
  }
  record.disabled = true;
  sure = 0;
  try {
    const name = session.value.trim();
    showRecording(recording.recording ? await call("recording/stop", {}) : await call("recording/start", { name }));
    if (recording.recording) session.value = "";
    toast(recording.recording ? `Recording ${recording.session}` : `Recorded ${recording.session}`, "notice");
  } catch (error) {
    toast(error.message);
    record.disabled = false;
  }
}
record.addEventListener("click", startOrStop);
session.addEventListener("keydown", (event) => {
  if (event.key === "Enter" && !record.disabled && !recording?.recording) startOrStop();
});

replay.addEventListener("click", async () => {
  try {
    showRecording(await call("replay/stop", {}));
  } catch (error) {
    toast(error.message);
  }
});

whenCommand(() => recording && showRecording(recording));
poll();

