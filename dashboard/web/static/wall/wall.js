// A display that nobody touches and that runs for days: every node is there from the beginning and only its text changes, so nothing grows.
import { Cube } from "/static/wall/cube.js";

const byId = (id) => document.getElementById(id);
const SILENT_MS = 3000; // without a word of the dashboard: what is seen is old
const AGAIN_MS = 4000; // between two tries to be connected
const REFUSED_MS = 15000; // the same, for one that is not let in
const BUILD = document.body.dataset.build;
const device = new URLSearchParams(location.search).get("device") ?? "";
const cube = new Cube(byId("cube"));
const rows = [...document.querySelectorAll(".row")], alarms = [...document.querySelectorAll("#alarms p:not(#more)")];
let source = null, tried = 0, spoke = 0, reloading = false;
let pose = null, posed = 0, now = null, why = "";

function text(node, value) {
  if (node.textContent !== value) node.textContent = value;
}

function connect() {
  tried = performance.now();
  source?.close();
  source = new EventSource(`/wall/stream?${new URLSearchParams({ device })}`);
  source.addEventListener("state", (event) => {
    heard();
    now = JSON.parse(event.data);
    why = "";
    if (now.build !== BUILD) renew();
    show();
  });
  source.addEventListener("pose", (event) => {
    heard();
    pose = JSON.parse(event.data);
    posed = performance.now();
  });
  source.addEventListener("end", (event) => {
    why = JSON.parse(event.data).why;
    source.close();
  });
  source.addEventListener("error", () => source.readyState === EventSource.CLOSED && ask());
}

const heard = () => { spoke = performance.now(); };

// The stream was refused: the reason is asked for, as an event source does not tell it. It may also be that another
// version serves, in which the stream is another.
async function ask() {
  try {
    const answer = await fetch("/wall/stream", { signal: AbortSignal.timeout(3000) });
    why = answer.ok ? "" : (await answer.json()).error;
    await answer.body?.cancel().catch(() => {});
  } catch {
    why = "";
  }
  if (why) renew();
}

// Another version serves: only when its page answers, and is another, is this one given up for it. Should the dashboard
// go again while it loads, the guard within the page (wall.html) loads it once more.
async function renew() {
  if (reloading) return;
  reloading = true;
  try {
    const answer = await fetch("/wall", { cache: "no-store", signal: AbortSignal.timeout(10000) });
    const built = answer.ok && /data-build="(\w+)"/.exec(await answer.text());
    if (built && built[1] !== BUILD) location.replace(`/wall${location.search}`);
  } catch {
    // The next word of the dashboard tries again.
  }
  reloading = false;
}

function show() {
  text(byId("device"), now.device || "no board yet");
  const origin = byId("source");
  text(origin, now.source ?? "");
  origin.dataset.source = now.source ?? "";
  for (const [k, row] of rows.entries()) {
    const one = now.rows[k];
    row.hidden = !one;
    if (!one) continue;
    row.dataset.known = one.known ? "1" : "0";
    const [name, value, unit, note] = row.children;
    text(name, one.name);
    text(value, one.value);
    text(unit, one.unit);
    text(note, one.note);
  }
  for (const [k, line] of alarms.entries()) {
    const one = now.alarms[k];
    text(line, one ? `${one.title}: ${one.text}` : "");
    line.dataset.level = one?.level ?? "";
  }
  text(byId("more"), now.more ? `and ${now.more} more` : "");
  text(byId("recording"), now.recording);
  text(byId("procedure"), now.procedure ?? "");
  text(byId("command"), now.command);
  text(byId("places"), now.places.length > 1 ? now.places.map((one) => `${one.name} ${one.state}`).join(" · ") : "");
  text(byId("boards"), now.boards.map((one) => `${one.name} ${one.stale ? "silent" : "live"}`).join(" · "));
}

const ago = (s) => (s < 120 ? `${Math.floor(s)} s` : s < 7200 ? `${Math.floor(s / 60)} MIN` : s < 172800 ? `${Math.floor(s / 3600)} H` : `${Math.floor(s / 86400)} DAYS`);

// What is old is dimmed, and for how long nothing came is said: once a second, by this display's own clock.
function look() {
  const at = performance.now(), silent = (at - spoke) / 1000, gone = !spoke || at - spoke > SILENT_MS;
  const age = pose && now?.there && pose.age_s !== null ? pose.age_s + (at - posed) / 1000 : null;
  const old = gone || !now?.there || age === null || age > 3;
  document.body.classList.toggle("old", old);
  const banner = byId("banner");
  const nobody = !spoke ? "NOT CONNECTED" : gone ? `NO DATA FOR ${ago(silent)}` : "";
  const quiet = !now?.there ? "NO BOARD" : old ? `${now.device}: NO DATA${age === null ? "" : ` FOR ${ago(age)}`}` : "";
  const said = why || nobody || quiet;
  text(banner, said);
  banner.hidden = !said;
  const link = byId("link");
  link.dataset.state = !old && now.connected ? "live" : "lost";
  text(link, old ? "" : `${now.connected ? `${now.hz.toFixed(0)} Hz` : "line lost"}${now.late ? `, ${now.late}` : ""}${now.lost ? `, ${now.lost} samples lost` : ""}`);
  text(byId("clock"), new Date().toISOString().slice(11, 19) + " UTC");
  window.wallBeat = at; // the guard within the page waits for it
  if (gone && at - tried > (why ? REFUSED_MS : AGAIN_MS)) connect();
}

function draw() {
  cube.draw(document.body.classList.contains("old") ? null : pose?.q, pose?.omega);
}

// A display's own link: its token stands behind the #, is kept as a cookie and taken out of the address.
async function open() {
  if (location.pathname !== "/wall/open") return;
  const token = location.hash.slice(1);
  try {
    const answer = await fetch("/wall/open", { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify({ token }) });
    if (answer.ok) return location.replace(`/wall${location.search}`);
    why = (await answer.json()).error;
    if (answer.status === 403) return; // it will not be better: the link is unknown, revoked or past its end
  } catch {
    // The dashboard is not there yet.
  }
  setTimeout(open, AGAIN_MS);
}

open();
connect();
setInterval(look, 1000);
setInterval(draw, 100); // ten pictures a second; not by frames, which a display in the background has none of
look();
