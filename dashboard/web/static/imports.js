// Import of a log: send it, show how it is written and its first rows, let a person say what its
// columns are and when it was recorded, make the session.
import { call, ended, send } from "/static/rest.js";

const form = document.getElementById("import");
const state = document.getElementById("import-state");
const preview = document.getElementById("import-preview");
let upload = null; // number of what was sent

const element = (name, text = "", more = {}) => Object.assign(document.createElement(name), { textContent: text }, more);

const short = (value) => String(Number(value.toPrecision(4))).replace("-", "−");
const ENCODINGS = { "utf-8-sig": "UTF-8 with a byte order mark", "utf-8": "UTF-8" };

// Values of a column as a line, least and greatest beside it.
function sketch(values) {
  const known = values.filter((value) => value !== null);
  if (known.length < 2) return element("span", "");
  const low = Math.min(...known), high = Math.max(...known), size = high - low || 1;
  const picture = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  picture.setAttribute("viewBox", "0 0 100 30");
  picture.setAttribute("role", "img");
  picture.setAttribute("aria-label", `from ${short(low)} to ${short(high)}`);
  picture.classList.add("sketch");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  const points = values.map((value, k) => value === null ? "" : `${(100 * k) / (values.length - 1)},${28 - (26 * (value - low)) / size}`);
  line.setAttribute("points", points.filter(Boolean).join(" "));
  picture.append(line);
  const cell = element("div");
  cell.append(picture, element("span", low === high ? short(low) : `${short(low)} … ${short(high)}`, { className: "dim" }));
  return cell;
}

function choice(file, column, targets) {
  const select = element("select");
  select.append(element("option", "leave out", { value: "" }));
  const known = targets.includes(column.guess) || !column.guess ? targets : [column.guess, ...targets];
  for (const target of known) select.append(element("option", target, { value: target }));
  select.value = column.guess;
  select.setAttribute("aria-label", `What ${column.name} of ${file} is`);
  Object.assign(select.dataset, { file, column: column.name });
  return select;
}

function table(file, found, targets) {
  const part = element("section"), box = element("div", "", { className: "across" }), grid = element("table", "", { className: "plain" });
  const head = element("tr"), meant = element("tr"), drawn = element("tr"), body = element("tbody");
  for (const column of found.columns) {
    head.append(element("th", column.name));
    meant.append(element("td"));
    meant.lastChild.append(choice(file, column, targets));
    drawn.append(element("td"));
    drawn.lastChild.append(sketch(column.values));
  }
  body.append(meant, drawn, ...found.rows.map((row) => {
    const line = element("tr");
    line.append(...row.map((cell) => element("td", cell, { className: "n" })));
    return line;
  }));
  grid.append(element("thead"), body);
  grid.tHead.append(head);
  box.append(grid);
  const written = `${file}: ${ENCODINGS[found.encoding] ?? found.encoding}, columns by ${found.separator}, decimal ${found.decimal}, header in line ${found.header_line}${found.own ? ", an export of ours" : ""}`;
  part.append(element("h3", written), box);
  return part;
}

async function begin() {
  const { upload: number, piece_bytes: piece } = await call("imports", {});
  for (const file of form.files.files) {
    for (let at = 0; at < file.size; at += piece) {
      state.textContent = `Sending ${file.name}, ${Math.round((100 * at) / file.size)} %`;
      await send(`imports/${number}/files/${encodeURIComponent(file.name)}?at=${at}`, file.slice(at, at + piece));
    }
  }
  const { files, targets } = await call(`imports/${number}/look`);
  preview.replaceChildren(...Object.entries(files).map(([file, found]) => table(file, found, targets)));
  preview.hidden = false;
  upload = number;
  form.querySelector("button").textContent = "Import";
  state.textContent = "Say what each column is, then import. The first 200 rows are drawn.";
}

async function finish() {
  const columns = {};
  for (const select of preview.querySelectorAll("select")) {
    (columns[select.dataset.file] ??= {})[select.dataset.column] = select.value;
  }
  const order = { device: form.device.value, name: form.name.value, start: form.start.value, columns };
  const job = await ended(await call(`imports/${upload}/finish`, order), state);
  location.assign(`/sessions/${job.made}`);
}

function say(text, fault = false) {
  state.textContent = text;
  state.className = fault ? "fault" : "dim";
}

function anew() {
  upload = null;
  preview.hidden = true;
  form.querySelector("button").textContent = "Look";
}

form?.files.addEventListener("change", anew);
form?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const button = form.querySelector("button"), sent = upload !== null;
  button.disabled = true;
  say("");
  try {
    await (sent ? finish() : begin());
  } catch (error) {
    if (sent) anew(); // what was sent is gone
    say(error.message, true);
  }
  button.disabled = false;
});
