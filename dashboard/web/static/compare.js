// The page of sessions over one another.
import { Overlay } from "/static/overlay.js";

const page = document.querySelector("main");
const ids = page.dataset.ids.split(",");
const form = document.getElementById("aligning");
const state = document.getElementById("state");
const given = new Map(); // session -> offset by hand
const n = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits).replace("-", "−"));
const deg = (value) => (value === undefined ? "–" : ((value * 180) / Math.PI).toPrecision(3));

const more = () => {
  const query = { align: form.align.value };
  if (form.everything.checked) query.everything = "true";
  if (given.size) query.offsets = [...given].map(([id, s]) => `${id}:${s}`).join(",");
  return query;
};

const overlay = new Overlay(page, ids, more, { state: say, data: showTables, asked: (anew) => { if (anew) settled(false, "Provisional: being computed anew."); }, click: () => {} });

function say(text, fault = false) {
  state.textContent = text;
  state.className = fault ? "fault" : "dim";
  if (fault) settled(false, "Not computed; what is dimmed is of before.");
}

const AGAINST = { tacho: "tachometer" };
// How much of it counts: what an estimator does not vouch for is not measured.
const valid = (shares) => {
  const least = Math.min(...Object.values(shares));
  return least > 0.9995 ? "" : `, of the ${Math.floor(100 * least)} % that are valid`;
};
const HOW = { reference: "the others are moved", clock: "one board's clock", tacho: "tachometer", rate: "rate of turn", start: "by their starts", given: "by hand" };

function showTables(answer) {
  answer.sessions.forEach((session, k) => {
    const row = document.querySelector(`tr[data-session="${session.id}"]`);
    const input = row.querySelector("input");
    if (input && document.activeElement !== input) input.value = session.offset_s.toFixed(4);
    const set = (name, text) => { row.querySelector(`[data-cell=${name}]`).textContent = text; };
    set("by", HOW[session.by]);
    const rival = session.quality === "ambiguous" ? `, ${n(session.rival_s, 2)} s fits as well` : "";
    if (k === 0) set("quality", "–");
    else set("quality", `${session.quality}${session.correlation === null ? "" : `, correlation ${n(session.correlation, 4)}`}${rival}`);
    const errors = answer.errors[k][session.line];
    set("error", errors ? `${["x", "y", "z"].map((c) => deg(errors.rms_radps[c])).join(" / ")} (${AGAINST[errors.against] ?? errors.against}${valid(errors.valid_share)})` : "–");
  });
  const called = (key) => answer.titles[key];
  rows("differences", answer.differences.map((d) => [
    `${d.session}: ${called(d.line)}`, called(d.against), deg(d.rms_radps.x), deg(d.rms_radps.y), deg(d.rms_radps.z), `${d.seconds.toFixed(1)} s`,
  ]));
  rows("track-differences", answer.track_differences.map((d) => [
    `${d.session}: ${called(d.track)}`, called(d.against), ...d.rms_ned_m.map((v) => (v === null ? "–" : v.toPrecision(3))), `${d.seconds.toFixed(1)} s`,
  ]));
  // part of a recording: its figures will change
  settled(answer.state !== "reading", `Provisional: ${Math.floor(100 * answer.done)} % of the recordings is read, these figures will change.`);
  document.body.dataset.plotted = answer.state;
}

// Figures that will change are dimmed, and it is said why.
function settled(is, why) {
  for (const table of document.querySelectorAll("main table:not(.gf-between table)")) {
    table.classList.toggle("provisional", !is);
    table.setAttribute("aria-busy", String(!is));
  }
  const words = document.getElementById("provisional");
  words.hidden = is;
  words.textContent = is ? "" : why;
}

function rows(id, lines) {
  const table = document.getElementById(id), heads = [...table.querySelectorAll("th")].map((head) => head.textContent);
  table.hidden = !lines.length;
  table.querySelector("tbody").replaceChildren(...lines.map((cells) => {
    const row = document.createElement("tr");
    row.append(...cells.map((text, k) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      cell.className = k > 1 ? "n" : k ? "" : "id";
      if (k) cell.dataset.label = heads[k] ?? "";
      return cell;
    }));
    return row;
  }));
}

form.addEventListener("change", () => {
  given.clear();
  overlay.load();
});
document.getElementById("sessions").addEventListener("change", (event) => {
  const value = Number(event.target.value);
  if (event.target.value === "" || !Number.isFinite(value)) given.delete(event.target.dataset.offset);
  else given.set(event.target.dataset.offset, value);
  overlay.load();
});
document.getElementById("whole").addEventListener("click", () => overlay.group.look(...overlay.group.span));
overlay.load();
