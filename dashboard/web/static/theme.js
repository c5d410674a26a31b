// Dark or light: the system's choice until the person makes one. Runs before the page is drawn.
(() => {
  "use strict";
  const root = document.documentElement;
  const stored = localStorage.getItem("gyrofree-theme");
  if (stored === "dark" || stored === "light") root.dataset.theme = stored;
  document.addEventListener("click", (event) => {
    const target = event.target instanceof Element ? event.target : null;
    if (target?.closest("[data-theme-toggle]")) {
      const dark = matchMedia("(prefers-color-scheme: dark)").matches;
      const now = root.dataset.theme ?? (dark ? "dark" : "light");
      root.dataset.theme = now === "dark" ? "light" : "dark";
      localStorage.setItem("gyrofree-theme", root.dataset.theme);
      document.dispatchEvent(new Event("gyrofree-theme"));
    }
    for (const menu of document.querySelectorAll("details.menu[open]")) {
      if (!menu.contains(target)) menu.open = false;
    }
  });
  // A click into the scene's frame does not reach this document, but takes its focus.
  addEventListener("blur", () => document.querySelectorAll("details.menu[open]").forEach((menu) => (menu.open = false)));
})();
