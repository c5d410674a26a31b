// The page of alarms: what is wrong, what people did about it, limits, notices. Asked every two seconds.
import { call, toast } from "/static/rest.js";
import { beep, notifies, possible, setNotify, setSound, sounds, tell } from "/static/told.js";

const byId = (id) => document.getElementById(id);
const mayOperate = byId("alarm-page").dataset.operator === "1";
const BARRED = byId("alarm-page").dataset.barred;
const EVERY_MS = 2000;
const WORDS = { unacknowledged: "not acknowledged", acknowledged: "acknowledged", returned: "over, not acknowledged", shelved: "shelved" };
const form = byId("limit"), ask = byId("ask"), sound = byId("sound"), notify = byId("notify");
let limits = [];

function node(name, text = "", className = "") {
  const made = document.createElement(name);
  made.textContent = text;
  made.className = className;
  return made;
}

const when = (s) => (s ? new Date(s * 1000).toISOString().slice(0, 19).replace("T", " ") : "");
const span = (s) => (s >= 5400 ? `${(s / 3600).toFixed(1)} h` : s >= 90 ? `${Math.ceil(s / 60)} min` : `${Math.ceil(s)} s`);

function order(text, act, enabled = mayOperate, why = BARRED) {
  const button = node("button", text);
  button.type = "button";
  button.disabled = !enabled;
  button.title = enabled ? "" : why;
  button.addEventListener("click", act);
  return button;
}

async function give(path, body) {
  try {
    const now = await call(`alarms/${path}`, body);
    if (now.message) toast(now.message, "notice");
    show(now);
    return true;
  } catch (error) {
    toast(error.message);
    return false;
  }
}

// A question with a text, and for the shelf a time; calls act(text, seconds) when it is answered.
function question(title, what, withTime, act) {
  byId("ask-title").textContent = title;
  byId("ask-what").textContent = what;
  byId("ask-for").hidden = !withTime;
  const fields = ask.querySelector("form").elements;
  fields.text.value = "";
  ask.addEventListener("close", () => {
    if (ask.returnValue === "yes") act(fields.text.value.trim(), Number(fields.seconds.value));
  }, { once: true });
  ask.returnValue = "no";
  ask.showModal();
  fields.text.focus();
}

function table(heads, rows, empty) {
  if (!rows.length) return node("p", empty, "dim");
  const made = node("table"), head = made.createTHead().insertRow(), body = made.createTBody();
  for (const text of heads) head.append(node("th", text));
  for (const row of rows) {
    const line = body.insertRow();
    line.className = row.className ?? "";
    row.cells.forEach((parts, k) => {
      const cell = line.insertCell();
      cell.dataset.label = heads[k];
      cell.append(...[parts].flat());
    });
    line.lastElementChild.className = row.orders ? "orders" : "";
  }
  return made;
}

// Drawn anew only where something has changed, so that what has the focus keeps it.
function put(place, drawn, key) {
  const text = JSON.stringify(key);
  if (place.dataset.drawn === text) return;
  place.dataset.drawn = text;
  place.replaceChildren(drawn);
}

function pointRow(one) {
  const about = { device: one.device, id: one.id };
  const state = [node("span", one.state === "shelved" ? `shelved, ${span(one.shelved_s)} left` : WORDS[one.state])];
  if (one.state === "shelved" && one.active) state.push(node("span", "there", "tag"));
  if (one.unknown) state.push(node("span", "not known now", "tag unknown"));
  if (one.chattering) state.push(node("span", "chattering", "tag"));
  if (one.first_out) state.push(node("span", "first", "tag"));
  const by = one.state === "shelved" ? `${one.shelved_by}${one.reason ? `: ${one.reason}` : ""}` : one.acknowledged_by && `${one.acknowledged_by}${one.note ? `: ${one.note}` : ""}`;
  if (by) state.push(node("span", by, "dim"));
  const what = node("strong", one.title);
  what.title = Object.entries(one.words).map(([word, meaning]) => `${word}: ${meaning}`).join("\n");
  const since = [node("span", when(one.raised_s))];
  if (one.returned_s) since.push(node("span", `until ${when(one.returned_s).slice(11)}`, "dim"));
  if (one.times > 1) since.push(node("span", `${one.times} times`, "dim"));
  const owed = one.state === "unacknowledged" || one.state === "returned";
  const orders = [];
  if (owed) orders.push(order("Acknowledge", () => question(`Acknowledge: ${one.title}`, "Note", false, (note) => give("acknowledge", { ...about, note }))));
  if (one.state === "shelved") orders.push(order("Take off the shelf", () => give("unshelve", about)));
  else orders.push(order("Shelve", () => question(`Silence: ${one.title}`, "Reason", true, (reason, seconds) => give("shelve", { ...about, reason, seconds }))));
  return { className: one.state, orders: true, cells: [node("span", one.level, `level ${one.level}`), one.device || "bench", [what, node("span", one.text, "dim")], state, since, orders] };
}

function limitRow(one) {
  const sides = [one.above !== null ? `above ${one.above}` : "", one.below !== null ? `below ${one.below}` : ""].filter(Boolean).join(" or ");
  const more = [one.dead_band ? `dead band ${one.dead_band}` : "", one.on_delay_s ? `after ${one.on_delay_s} s` : "", one.off_delay_s ? `ends after ${one.off_delay_s} s` : "", one.unknown === "alarm" ? "not known is an alarm" : ""].filter(Boolean).join(", ");
  const readings = one.readings.map((r) => node("span", `${r.device}: ${r.value === null ? r.said : `${Number(r.value.toPrecision(5))} ${r.unit} · ${r.said}`}`, r.value === null ? "dim unknown" : "dim"));
  const why = one.fixed ? "It stands in gyrofree.toml, and is changed there" : BARRED;
  const may = mayOperate && !one.fixed;
  const orders = [order("Change", () => edit(one), may, why), order("Remove", () => give("limits/remove", { name: one.name }), may, why)];
  const name = [node("strong", one.name), node("span", one.fixed ? "of gyrofree.toml" : `by ${one.user}`, "dim")];
  return { orders: true, cells: [name, [node("code", one.field), node("span", one.device || "every device", "dim")], [node("span", `${sides}${one.unit ? ` ${one.unit}` : ""}`), node("span", more, "dim")], node("span", one.level, `level ${one.level}`), readings.length ? readings : node("span", "no device yet", "dim"), orders] };
}

function edit(one) {
  for (const part of form.elements) {
    if (part.name) part.value = one[part.name] ?? "";
  }
  form.elements.field.focus();
}

function show(now) {
  limits = now.limits;
  const trouble = byId("trouble");
  trouble.hidden = !now.trouble;
  trouble.textContent = now.trouble;
  const there = now.alarms.filter((one) => one.state !== "normal");
  const steady = there.map((one) => ({ ...one, shelved_s: Math.ceil(one.shelved_s / 60) }));
  byId("kept").hidden = Boolean(now.part);
  byId("part").hidden = !now.part;
  byId("part").textContent = now.part ? now.message : "";
  put(byId("points"), now.trouble && now.part ? node("p", "Not known now.", "dim") : table(["Level", "Device", "What", "State", "Since (UTC)", "Orders"], there.map(pointRow), "Nothing is wrong, and nothing waits to be acknowledged."), steady);
  put(byId("limits"), table(["Name", "Field", "Limit", "Level", "Now", "Orders"], limits.map(limitRow), "No limit is set."), limits);
  const ways = now.ways.map((way) => ({ cells: [way.name, String(way.sent), String(way.waiting), String(way.given_up), node("span", way.fault || "well", way.fault ? "fault" : "dim")] }));
  put(byId("ways"), table(["Way", "Sent", "Waiting", "Given up", "Last attempt"], ways, "No way out is set: [alarms.webhook] or [alarms.mail] in gyrofree.toml."), now.ways);
  const history = now.history.slice(0, 100).map((one) => ({ cells: [when(one.at_s), one.device || "bench", node("span", one.level, `level ${one.level}`), one.title, one.what, [one.who, node("span", one.text, "dim")]] }));
  put(byId("history"), table(["When (UTC)", "Device", "Level", "Alarm", "What", "Who"], history, "Nothing has happened yet."), now.history[0] ?? null);
  tell(now.alarms);
}

async function poll() {
  try {
    show(await call("alarms"));
  } catch (error) {
    byId("trouble").hidden = false;
    byId("trouble").textContent = error.message;
  }
  setTimeout(poll, EVERY_MS);
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const given = Object.fromEntries(new FormData(form));
  const number = (name) => (given[name] === "" ? undefined : Number(given[name]));
  const numbers = Object.fromEntries(["above", "below", "dead_band", "on_delay_s", "off_delay_s"].map((name) => [name, number(name)]));
  if (await give("limits", { ...given, ...numbers })) form.reset();
});

byId("test").addEventListener("click", () => give("test", {}));

function showNotify() {
  notify.setAttribute("aria-pressed", String(notifies()));
  notify.textContent = notifies() ? "Notices here: on" : "Notify me here";
  notify.disabled = !possible;
  notify.title = possible ? "Notices of this browser, while a page of the dashboard is open" : "Browsers allow notices over https or localhost only";
}

notify.addEventListener("click", async () => {
  try {
    await setNotify(!notifies());
  } catch (error) {
    toast(error.message);
  }
  showNotify();
});

sound.checked = sounds();
sound.addEventListener("change", () => {
  setSound(sound.checked);
  if (sound.checked) beep();
});

async function offer() {
  try {
    const devices = await call("devices");
    for (const { name } of devices) form.elements.device.append(new Option(name, name));
    const known = devices.length ? await call(`devices/${encodeURIComponent(devices[0].name)}/channels`) : { channels: [] };
    byId("channels").replaceChildren(...known.channels.map((one) => Object.assign(new Option(one.name, one.name), { label: [one.unit, one.who].filter(Boolean).join(", ") })));
  } catch {
    // Names are an offer; without them they are typed.
  }
}

showNotify();
offer();
poll();
