// The list of sessions: replay, and up to four of them over one another.
import "/static/imports.js";
import { call, toast } from "/static/rest.js";

document.addEventListener("click", async (event) => {
  const button = event.target instanceof Element ? event.target.closest("[data-replay]") : null;
  if (!button) return;
  button.disabled = true;
  try {
    await call(`sessions/${encodeURIComponent(button.dataset.replay)}/replay`, { speed: 1.0 });
    location.assign("/");
  } catch (error) {
    toast(error.message);
    button.disabled = false;
  }
});

const MOST = 4;
const compare = document.getElementById("compare");
const boxes = [...document.querySelectorAll("[data-compare]")];
const chosen = []; // in the order of ticking: the first one stays where it is

function showChosen() {
  compare.disabled = chosen.length < 2;
  compare.textContent = chosen.length ? `Compare ${chosen.length}` : "Compare";
  for (const box of boxes) box.disabled = chosen.length >= MOST && !box.checked;
}

for (const box of boxes) {
  if (box.checked) chosen.push(box.dataset.compare); // the browser kept it
  box.addEventListener("change", () => {
    if (box.checked) chosen.push(box.dataset.compare);
    else chosen.splice(chosen.indexOf(box.dataset.compare), 1);
    showChosen();
  });
}
showChosen();
compare.addEventListener("click", () => location.assign(`/compare?ids=${chosen.join(",")}`));

