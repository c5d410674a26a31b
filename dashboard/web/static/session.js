// The page of one session: plots, replay, report, export, notes, labels, deletion.
import { showAt, showMap, showSky } from "/static/map/session.js";
import { Derived } from "/static/derived.js";
import { Overlay } from "/static/overlay.js";
import { call, ended, send, toast } from "/static/rest.js";
import { Spectrum } from "/static/spectrum.js";

const session = document.querySelector("main").dataset.session;
const path = `sessions/${encodeURIComponent(session)}`;
const by = (id) => document.getElementById(id);

async function guarded(button, work) {
  button.disabled = true;
  try {
    await work();
  } catch (error) {
    toast(error.message);
  } finally {
    button.disabled = false;
  }
}

by("replay")?.addEventListener("click", (event) => replay(event.target, moment > 0 ? moment : 0));

async function replay(button, t) {
  await guarded(button, async () => {
    await call(`${path}/replay`, { speed: 1.0, t });
    location.assign("/");
  });
}

for (const button of document.querySelectorAll("[data-from]")) {
  button.addEventListener("click", () => replay(button, Number(button.dataset.from)));
}

// A link to a moment, /sessions/ID?t=12.5, offers to replay from there.
let moment = Number(new URLSearchParams(location.search).get("t"));
if (moment > 0 && by("replay")) by("replay").textContent = `Replay from ${moment} s`;

by("report")?.addEventListener("click", (event) => guarded(event.target, async () => {
  await ended(await call(`${path}/report`, {}), by("report-state"));
  location.reload();
}));

// The link at the end of a test, /sessions/ID?report: the report opens, and is made first where there is none.
async function openReport() {
  const { state, reported } = document.querySelector("main").dataset;
  const there = `/api/${path}/report.html`;
  if (reported === "1") return location.replace(there);
  if (state === "recording" || state === "open") return setTimeout(() => location.reload(), 1000); // just being closed
  if (!by("report")) return toast("There is no report yet; to make one takes the role operator");
  by("report").scrollIntoView({ block: "center" });
  await guarded(by("report"), async () => {
    await ended(await call(`${path}/report`, {}), by("report-state"));
    location.replace(there);
  });
}
if (new URLSearchParams(location.search).has("report")) openReport();

by("photo")?.addEventListener("submit", (event) => {
  event.preventDefault();
  const file = event.target.photo.files[0];
  guarded(event.target.querySelector("button"), async () => {
    const { upload, piece_bytes: piece } = await call("imports", {});
    const name = file.type === "image/png" ? "photo.png" : "photo.jpg"; // told by its content there
    for (let at = 0; at < file.size; at += piece) {
      by("photo-state").textContent = `Sending, ${Math.round((100 * at) / file.size)} %`;
      await send(`imports/${upload}/files/${name}?at=${at}`, file.slice(at, at + piece));
    }
    await call(`${path}/photo`, { upload });
    location.reload();
  }).finally(() => { by("photo-state").textContent = by("report") && document.querySelector("main").dataset.reported === "1" ? "A report made before does not show it: make it again." : ""; });
});

by("export")?.addEventListener("submit", (event) => {
  event.preventDefault();
  const form = event.target;
  guarded(form.querySelector("button"), async () => {
    const order = { format: form.format.value, start_s: Number(form.start_s.value || 0) };
    if (form.end_s.value !== "") order.end_s = Number(form.end_s.value);
    const job = await ended(await call(`${path}/export`, order), by("export-state"));
    location.assign(`/api/jobs/${job.number}/download`);
  });
});

// The same samples through other estimators: a new session, shown over this one.
by("rerun")?.addEventListener("submit", (event) => {
  event.preventDefault();
  const form = event.target;
  guarded(form.querySelector("button"), async () => {
    const known = await names();
    const wanted = form.estimators.value.split(/[\s,]+/).filter(Boolean);
    const strange = wanted.filter((name) => !known.rate.includes(name) && !known.navigators.includes(name));
    if (strange.length) throw new Error(`no estimator ${strange.join(", ")}: want ${[...known.rate, ...known.navigators].join(", ")}`);
    const settings = Object.fromEntries(form.settings.value.split(";").map((s) => s.trim()).filter(Boolean).map((text) => {
      const [key, ...value] = text.split("=");
      if (!value.length) throw new Error(`setting ${text}: want KEY=VALUE, like layout.half_side_m=0.0493`);
      return [key.trim(), value.join("=").trim()];
    }));
    const order = {
      estimators: wanted.filter((name) => known.rate.includes(name)), settings, name: form.name.value,
      navigators: wanted.filter((name) => known.navigators.includes(name)),
    };
    const job = await ended(await call(`${path}/rerun`, order), by("rerun-state"));
    location.assign(`/sessions/${job.made}`); // old and new estimates stand in it side by side
  });
});

let known = null;
async function names() {
  known ??= await call("estimators");
  by("estimator-names").replaceChildren(...[...known.rate, ...known.navigators].map((name) => new Option(name)));
  by("rerun-names").textContent = `Rate: ${known.rate.join(", ")}. Navigation: ${known.navigators.join(", ")}.`;
  return known;
}
by("rerun")?.addEventListener("focusin", () => names().catch((error) => toast(error.message)), { once: true });

by("note")?.addEventListener("submit", (event) => {
  event.preventDefault();
  const form = event.target;
  guarded(form.querySelector("button"), async () => {
    const order = { text: form.text.value };
    if (form.at_s.value !== "") order.at_s = Number(form.at_s.value);
    await call(`${path}/notes`, order);
    location.reload();
  });
});

by("labels")?.addEventListener("submit", (event) => {
  event.preventDefault();
  const form = event.target;
  guarded(form.querySelector("button"), async () => {
    const tags = form.tags.value.split(/[\s,]+/).filter(Boolean);
    await call(`${path}/labels`, { title: form.title.value, tags, outcome: form.outcome.value });
    location.reload();
  });
});

by("delete")?.addEventListener("click", (event) => guarded(event.target, async () => {
  if (!confirm(`Delete session ${session} for good?`)) return;
  await call(`${path}/delete`, {});
  location.assign("/sessions");
}));

// What is recorded over time; a click sets the moment that a remark, or a replay, is about.
if (by("plots")) {
  const asked = new URLSearchParams(location.search).get("derived") ?? document.querySelector("main").dataset.derived;
  let lines = asked.split(";").map((line) => line.trim()).filter(Boolean);
  const overlay = new Overlay(by("plots"), [session], () => ({ everything: "true", ...(lines.length && { derived: lines.join(";") }) }), {
    state: (text, fault = false) => {
      by("plot-state").textContent = text;
      by("plot-state").className = fault ? "fault" : "dim";
    },
    data: (answer) => {
      document.body.dataset.plotted = answer.state;
      editor.show(answer.own);
      if (answer.state === "done") spectrum.changed();
    },
    click: (t) => {
      if (t < 0) return;
      moment = Math.round(t * 100) / 100;
      if (by("note")) by("note").at_s.value = moment;
      if (by("replay")) by("replay").textContent = `Replay from ${moment} s`;
      address({ t: moment });
      showSky(path, moment);
      showAt(moment);
    },
  });
  const editor = new Derived(by("own-curves"), {
    named: () => call(`${path}/channels`),
    changed: (now) => {
      lines = now;
      address({ derived: lines.join(";") });
      call("me/view", { view: new URLSearchParams({ derived: lines.join(";") }).toString(), page: "session" }).catch(() => {});
      overlay.load(...overlay.group.window);
    },
  });
  const spectrum = new Spectrum(by("spectrum"), path, { own: () => lines, stretch: () => overlay.group.stretch() });
  if (lines.length) by("own-curves").open = true;
  overlay.load();
  showMap(path, moment > 0 ? moment : undefined);
  showSky(path, moment || 0);
}

// The link to what is seen.
function address(fields) {
  const query = new URLSearchParams(location.search);
  for (const [key, value] of Object.entries(fields)) value === "" ? query.delete(key) : query.set(key, value);
  history.replaceState(null, "", `?${query}`);
}
