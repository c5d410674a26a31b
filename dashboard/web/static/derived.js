// Curves of a person's own: an expression is typed with completion of the names there are, drawn, and taken away.
const MOST = 6;
const SHOWN = 8; // names offered at a time
const WORD = /[A-Za-z_][A-Za-z0-9_]*$/;

export class Derived {
  // named(): {channels: [{name, unit, who}], functions: the same}; changed(lines) when the person has changed the list.
  constructor(root, { named, changed }) {
    Object.assign(this, { named, changed, lines: [], names: [], drawn: "", at: -1 });
    this.form = root.querySelector("form");
    this.input = this.form.expression;
    this.offer = root.querySelector("[role=listbox]");
    this.fault = root.querySelector(".fault");
    this.list = root.querySelector(".derived-list");
    this.form.addEventListener("submit", (event) => { event.preventDefault(); this.add(); });
    this.input.addEventListener("focus", () => this.learn());
    this.input.addEventListener("input", () => this.complete());
    this.input.addEventListener("keydown", (event) => this.key(event));
    this.input.addEventListener("blur", () => this.close());
    root.addEventListener("toggle", () => root.open && this.input.focus());
  }

  async learn() {
    try {
      const { channels, functions } = await this.named();
      this.names = [...channels, ...functions.map((one) => ({ ...one, call: true }))];
      this.complete();
    } catch { /* without names it can be typed all the same */ }
  }

  // What stands before the caret, as far as it is part of a name.
  word() {
    return this.input.value.slice(0, this.input.selectionStart).match(WORD)?.[0] ?? "";
  }

  complete() {
    const word = this.word().toLowerCase();
    const fits = word && this.names.filter(({ name, who }) => name !== word && (name.toLowerCase().includes(word) || who.toLowerCase().split(" ").includes(word)));
    if (!fits?.length || document.activeElement !== this.input) return this.close();
    const first = ({ name }) => !name.toLowerCase().startsWith(word);
    this.fits = fits.sort((a, b) => first(a) - first(b) || a.name.length - b.name.length).slice(0, SHOWN);
    this.at = -1;
    this.offer.replaceChildren(...this.fits.map((one, k) => {
      const item = document.createElement("li"), name = document.createElement("b"), what = document.createElement("small");
      Object.assign(item, { id: `derive-name-${k}` });
      item.setAttribute("role", "option");
      item.setAttribute("aria-selected", "false");
      name.textContent = one.call ? `${one.name}(` : one.name;
      what.textContent = [one.unit, one.who].filter(Boolean).join(" · ");
      item.append(name, " ", what);
      item.addEventListener("pointerdown", (event) => { event.preventDefault(); this.take(k); });
      return item;
    }));
    this.offer.hidden = false;
    this.input.setAttribute("aria-expanded", "true");
  }

  close() {
    this.offer.hidden = true;
    this.input.setAttribute("aria-expanded", "false");
    this.input.removeAttribute("aria-activedescendant");
  }

  take(k) {
    const caret = this.input.selectionStart, begin = caret - this.word().length, one = this.fits[k];
    const text = one.call ? `${one.name}(` : one.name;
    this.input.setRangeText(text, begin, caret, "end");
    this.close();
  }

  key(event) {
    if (this.offer.hidden) return;
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) {
      event.preventDefault();
      const items = [...this.offer.children];
      items[this.at]?.setAttribute("aria-selected", "false");
      this.at = (this.at + step + items.length) % items.length;
      if (this.at < 0) this.at = items.length - 1;
      items[this.at].setAttribute("aria-selected", "true");
      this.input.setAttribute("aria-activedescendant", items[this.at].id);
    } else if (event.key === "Tab" || (event.key === "Enter" && this.at >= 0)) {
      event.preventDefault();
      this.take(Math.max(this.at, 0));
    } else if (event.key === "Escape") {
      event.preventDefault();
      event.stopPropagation(); // the sheet stays open
      this.close();
    }
  }

  add() {
    const text = this.input.value.trim(), unit = this.form.unit.value.trim();
    if (!text) return this.input.focus();
    const line = unit ? `${text} [${unit}]` : text;
    if (this.lines.includes(line)) return this.say("This curve is drawn already.");
    if (this.lines.length >= MOST) return this.say(`${MOST} curves of one's own are drawn at most: take one away first.`);
    if (/[;[\]]/.test(text)) return this.say("; [ and ] cannot stand in an expression.");
    this.say("");
    this.asked = line; // stays in the input until it is known to be right
    this.changed([...this.lines, line]);
  }

  remove(line) {
    this.changed(this.lines.filter((one) => one !== line));
  }

  say(words) {
    this.fault.textContent = words;
    this.fault.hidden = !words;
  }

  // results: [{text, unit, fault}] of what is drawn now.
  show(results) {
    this.lines = results.map((one) => one.text);
    const mine = results.find((one) => one.text === this.asked);
    if (mine?.fault) {
      this.say(mine.fault);
      this.asked = null;
      return this.remove(mine.text); // the input still has it, to be mended
    }
    if (mine) {
      this.asked = null;
      this.form.reset();
      this.close();
    }
    const key = JSON.stringify(results);
    if (key === this.drawn) return;
    this.drawn = key;
    this.list.replaceChildren(...results.map((one) => this.item(one)));
  }

  item({ text, unit, fault }) {
    const item = document.createElement("li"), code = document.createElement("code"), small = document.createElement("small"), button = document.createElement("button");
    code.textContent = text;
    small.textContent = fault || unit || "no unit";
    small.className = fault ? "fault" : "";
    Object.assign(button, { type: "button", textContent: "×", title: `Take ${text} away` });
    button.setAttribute("aria-label", `Take ${text} away`);
    button.addEventListener("click", () => this.remove(text));
    item.append(code, " ", small, button);
    return item;
  }
}
