// The page of places: who is there. Asked every second.
import { call } from "/static/rest.js";

const byId = (id) => document.getElementById(id);
const EVERY_MS = 1000;
const KINDS = { running: "running", hung: "frozen", frozen: "frozen", gone: "gone", ended: "ended", "out of reach": "reach" };

function node(name, text = "", className = "") {
  const made = document.createElement(name);
  made.textContent = text;
  made.className = className;
  return made;
}

const when = (s) => (s ? new Date(s * 1000).toISOString().slice(0, 16).replace("T", " ") : "not said");
const state = (word, more = "") => node("span", word + more, `alive ${KINDS[word] ?? "unsure"}`);

function table(heads, rows, empty) {
  if (!rows.length) return node("p", empty, "dim");
  const made = node("table"), head = made.createTHead().insertRow(), body = made.createTBody();
  for (const text of heads) {
    const cell = node("th", text);
    cell.scope = "col";
    head.append(cell);
  }
  for (const cells of rows) {
    const line = body.insertRow();
    cells.forEach((parts, k) => {
      const cell = line.insertCell();
      cell.dataset.label = heads[k];
      cell.append(...[parts].flat().filter((part) => part !== ""));
    });
  }
  return made;
}

// Drawn anew only where something has changed.
function put(place, drawn, key) {
  const text = JSON.stringify(key);
  if (place.dataset.drawn === text) return;
  place.dataset.drawn = text;
  place.replaceChildren(...[drawn()].flat());
}

function service(one) {
  const more = one.state_said.slice(one.state.length);
  const boards = [one.devices.join(", ")];
  if (one.waits.length) boards.push(node("span", `waits: another gateway has ${one.waits.join(", ")}`, "dim"));
  return [node("strong", one.role), state(one.state, more), when(one.since_s), boards, one.state === "running" || one.clock_bound_s === null ? one.clock : node("span", `was ${one.clock}`, "dim"), one.certificate_ends_s ? when(one.certificate_ends_s).slice(0, 10) : ""];
}

function section(place) {
  const made = node("section"), title = node("h2", place.name);
  if (place.own) title.append(node("span", "this place", "tag"));
  const off = place.services.filter((one) => one.state === place.state).length;
  const part = ["frozen", "gone"].includes(place.state) && off < place.services.length; // a place is more than one of its services
  title.append(part ? node("span", `${off} of ${place.services.length} services ${place.state}`, `alive ${KINDS[place.state]}`) : state(place.state), node("span", place.people_said, "dim"));
  const heads = ["Service", "State", "Since (UTC)", "Boards", "Clock against the site's", "Certificate until"];
  made.append(title, table(heads, place.services.map(service), "No service is there."));
  return made;
}

function board(one) {
  const gateway = [node("span", one.gateway || "none is known", one.gateway ? "" : "dim")];
  if (one.twins) gateway.push(node("span", `several want it: ${one.twins}`, "fault"));
  const age = node("span", one.late?.said ?? "nothing is heard", one.late?.known ? "" : "dim");
  const more = one.late ? [node("span", one.late.details, "dim")] : [];
  const picture = node("div");
  picture.append(age, ...more);
  return [node("strong", one.name), gateway, picture];
}

function show(now) {
  const trouble = byId("trouble");
  trouble.hidden = now.sees;
  trouble.textContent = now.sees ? "" : "Who is there is not known now: this dashboard just began, or its router does not answer.";
  const steady = now.places.map((place) => ({ ...place, services: place.services.map((one) => ({ ...one, silent_s: 0, turn_ago_s: 0, turn_most_s: 0, loop: "", doing: "", clock_ahead_s: 0, clock_bound_s: 0 })) }));
  put(byId("places"), () => now.places.map(section), steady);
  put(byId("boards"), () => table(["Board", "Gateway at", "Picture"], now.boards.map(board), "No board is heard."), now.boards);
}

async function poll() {
  if (!document.hidden) {
    try {
      show(await call("places"));
    } catch (error) {
      byId("trouble").hidden = false;
      byId("trouble").textContent = error.message;
    }
  }
  setTimeout(poll, EVERY_MS);
}

poll();
