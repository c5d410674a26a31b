// Replay buttons of the list of sessions.
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
