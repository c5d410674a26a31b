// The list of sessions: replay, and up to four of them over one another.
import { call, ended, send, toast } from "/static/rest.js";

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

document.getElementById("import")?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const form = event.target, button = form.querySelector("button"), state = document.getElementById("import-state");
  button.disabled = true;
  try {
    const { upload, piece_bytes: piece } = await call("imports", {});
    for (const file of form.files.files) {
      for (let at = 0; at < file.size; at += piece) {
        state.textContent = `Sending ${file.name}, ${Math.round((100 * at) / file.size)} %`;
        await send(`imports/${upload}/files/${encodeURIComponent(file.name)}?at=${at}`, file.slice(at, at + piece));
      }
    }
    const job = await ended(await call(`imports/${upload}/finish`, { device: form.device.value, name: form.name.value }), state);
    location.assign(`/sessions/${job.made}`);
  } catch (error) {
    state.textContent = "";
    toast(error.message);
    button.disabled = false;
  }
});
