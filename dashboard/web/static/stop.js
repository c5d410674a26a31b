// The emergency stop, on every page while a procedure drives a table. One click and nothing asked.
import { call, toast } from "/static/rest.js";

const button = document.getElementById("stop");
const EVERY_MS = 1500;
const DEG = 180 / Math.PI;
let driven = [];

function show(found) {
  driven = found;
  button.hidden = !found.length;
  if (!found.length) return;
  const turns = found.map((one) => `${one.table}, ${(one.rate_radps * DEG).toFixed(0)} °/s`).join("; ");
  if (!button.disabled) button.title = `Stops at once: ${turns}`;
}

async function look() {
  if (!document.hidden) {
    try {
      show(await call("tables"));
    } catch {
      // What was driven may still turn: the button stays.
    }
  }
  setTimeout(look, EVERY_MS);
}

button.addEventListener("click", () => {
  for (const one of driven) {
    call(`devices/${encodeURIComponent(one.device)}/stop`, {})
      .then((said) => toast(`${one.table}: ${said.message}`, "notice"), (error) => toast(error.message));
  }
});
document.addEventListener("visibilitychange", () => document.hidden || call("tables").then(show, () => {}));
look();
