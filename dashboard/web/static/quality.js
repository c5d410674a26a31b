// How often this browser is brought up to date, kept for it, and what it really gets of that.
import { call } from "/static/rest.js";
import { choose } from "/static/view.js";

const KEY = "gyrofree-quality";
const EVERY_MS = 3000;
const box = document.getElementById("quality"), said = document.getElementById("flow"), menu = document.getElementById("view");
const kept = (() => { try { return localStorage.getItem(KEY); } catch { return null; } })();

box.value = kept === "economy" ? "economy" : "full";
choose({ quality: box.value });
box.addEventListener("change", () => {
  try { localStorage.setItem(KEY, box.value); } catch { /* private mode: until the page is left */ }
  choose({ quality: box.value });
});

async function look() {
  if (menu.open) {
    try {
      const scenes = await call("me/flow");
      const hz = scenes.map((one) => one.updates_hz), rate = scenes.reduce((sum, one) => sum + one.bytes_per_s, 0);
      said.textContent = scenes.length
        ? `This sign-in gets ${hz.map((value) => value.toFixed(0)).join(" and ")} updates a second, ${(rate / 1000).toFixed(0)} kB/s.`
        : "";
    } catch {
      said.textContent = "";
    }
  }
  setTimeout(look, EVERY_MS);
}
menu.addEventListener("toggle", look, { once: true });
