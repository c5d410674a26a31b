// Dark or light: the system's choice until the person makes one; one switch for all pages and the scene. Runs before
// the page is drawn.
(() => {
  "use strict";
  const root = document.documentElement;
  const KEY = "gyrofree-theme";
  const take = (theme) => {
    if (theme === "dark" || theme === "light") root.dataset.theme = theme;
  };
  const changed = () => document.dispatchEvent(new Event("gyrofree-theme"));
  const system = matchMedia("(prefers-color-scheme: dark)");
  take(localStorage.getItem(KEY));
  document.addEventListener("click", (event) => {
    const target = event.target instanceof Element ? event.target : null;
    if (target?.closest("[data-theme-toggle]")) {
      const now = root.dataset.theme ?? (system.matches ? "dark" : "light");
      take(now === "dark" ? "light" : "dark");
      localStorage.setItem(KEY, root.dataset.theme);
      changed();
    }
    for (const menu of document.querySelectorAll("details.menu[open]")) {
      if (!menu.contains(target)) menu.open = false;
    }
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    for (const menu of document.querySelectorAll("details.menu[open]")) {
      menu.open = false;
      menu.querySelector("summary").focus();
    }
  });
  addEventListener("storage", (event) => {
    if (event.key !== KEY) return;
    take(event.newValue);
    changed();
  });
  system.addEventListener("change", () => root.dataset.theme ?? changed());
  // A click into the scene's frame does not reach this document, but takes its focus.
  addEventListener("blur", () => document.querySelectorAll("details.menu[open]").forEach((menu) => (menu.open = false)));
})();
