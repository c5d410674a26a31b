// Who has the command, in the head of every page; to ask for it, to give it. Asked also in the background: it says that the holder is still there.
import { call, toast } from "/static/rest.js";

const box = document.getElementById("command");
const EVERY_MS = 2000;
const listeners = [];
const fields = box?.querySelectorAll("[data-of]") ?? [];
let told = ""; // who was said to ask
export let command = { may: true, why: "" };

export const whenCommand = (listener) => { listeners.push(listener); listener(command); };

const part = (name) => [...fields].find((one) => one.dataset.of === name);
const short = (name) => (name.length > 22 ? `${name.slice(0, 21)}…` : name);

function line(now) {
  if (now.asks && now.yours) return `${short(now.asks)} asks: ${Math.ceil(now.left_s)} s`;
  if (now.you_ask) return `asked: ${Math.ceil(now.left_s)} s`;
  return now.yours ? "You command" : `${short(now.holder)} commands`;
}

function words(now) {
  if (now.asks && now.yours) return `${now.asks} asks for the command. Without an answer it passes in ${Math.ceil(now.left_s)} s.`;
  if (now.yours) return "You have the command: others watch, and ask you for it. An emergency stop is everybody's.";
  if (now.you_ask) return `You asked ${now.holder}. Without an answer the command is yours in ${Math.ceil(now.left_s)} s.`;
  const asks = now.asks ? ` ${now.asks} asks for it.` : "";
  return `${now.holder} has the command, so orders of others are refused.${asks} Without an answer within ${now.answer_s} s it passes to who asks. An emergency stop is everybody's.`;
}

function show(now) {
  command = now;
  for (const listener of listeners) listener(now);
  if (!box) return;
  box.hidden = !now.holder;
  box.dataset.state = now.asks && now.yours ? "asked" : now.yours ? "yours" : "others";
  part("line").textContent = now.holder ? line(now) : "";
  part("line").title = now.holder ? words(now) : "";
  part("words").textContent = now.holder ? words(now) : "";
  part("last").textContent = now.last;
  const operator = box.dataset.operator === "1";
  const wanted = {
    give: now.yours && now.asks, keep: now.yours && now.asks, release: now.yours && !now.asks,
    ask: operator && !now.yours && !now.asks, release_ask: now.you_ask, force: now.admin && !now.yours,
  };
  for (const button of box.querySelectorAll("[data-act]")) button.hidden = !wanted[button.dataset.act];
  if (now.yours && now.asks && told !== now.asks_id) {
    toast(`${now.asks} asks for the command: answer in the head of the page`, "notice");
    box.open = true;
  }
  told = now.yours ? now.asks_id : "";
}

async function look() {
  try {
    show(await call("command"));
  } catch {
    // Without an answer the orders themselves say what is wrong.
  }
  setTimeout(look, EVERY_MS);
}

for (const button of box?.querySelectorAll("[data-act]") ?? []) {
  button.addEventListener("click", async () => {
    const action = button.dataset.act === "release_ask" ? "release" : button.dataset.act;
    try {
      show(await call("command", { action, to: action === "give" ? command.asks_id : "" }));
      box.open = false;
    } catch (error) {
      toast(error.message);
    }
  });
}
look();
