// Tabs as screen readers and keyboards know them: one of them in the order of focus, arrows move and choose.
export function drawTabs(list, tabs, chosen, choose) {
  const key = JSON.stringify([tabs, chosen]);
  if (list.dataset.drawn === key) return;
  list.dataset.drawn = key;
  const held = list.contains(document.activeElement);
  list.replaceChildren(...tabs.map((tab) => {
    const button = document.createElement("button");
    const is = tab.key === chosen;
    Object.assign(button, { type: "button", textContent: tab.title, title: tab.hint ?? "", tabIndex: is ? 0 : -1 });
    button.setAttribute("role", "tab");
    button.setAttribute("aria-selected", String(is));
    button.setAttribute("aria-controls", "stage");
    button.dataset.key = tab.key;
    button.addEventListener("click", () => choose(tab.key));
    return button;
  }));
  const selected = list.querySelector("[aria-selected=true]");
  if (held) selected?.focus();
  if (selected && list.scrollWidth > list.clientWidth) {
    list.scrollLeft = selected.offsetLeft - list.offsetLeft - (list.clientWidth - selected.offsetWidth) / 2;
  }
}

const STEPS = { ArrowLeft: -1, ArrowRight: 1 };

export function moveByArrows(list) {
  list.addEventListener("keydown", (event) => {
    const tabs = [...list.children], at = tabs.indexOf(document.activeElement);
    if (at < 0) return;
    let to = null;
    if (event.key in STEPS) to = (at + STEPS[event.key] + tabs.length) % tabs.length;
    if (event.key === "Home") to = 0;
    if (event.key === "End") to = tabs.length - 1;
    if (to === null) return;
    event.preventDefault();
    tabs[to].focus();
    tabs[to].click();
  });
}
