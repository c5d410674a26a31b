// A map: tiles from a file or a plain grid, ways and fixes over it, what is known of each in words, scale, follow.
import { Camera, mercator } from "/static/map/camera.js";
import { paint, QUALITIES, scaleBar } from "/static/map/draw.js";
import { call } from "/static/rest.js";
import { hasWebgl, Tiles } from "/static/map/tiles.js";

const root = document.documentElement, system = matchMedia("(prefers-color-scheme: dark)");
const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
const FEW = 2; // points that are no way yet

export function element(name, fields = {}, ...inside) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(fields)) {
    if (key in made && key !== "role") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...inside);
  return made;
}

export const metre = (m) => (m < 0.1 ? `${(100 * m).toFixed(1)} cm` : m < 10 ? `${m.toFixed(2)} m` : m < 1000 ? `${m.toFixed(0)} m` : `${(m / 1000).toFixed(1)} km`);

// Latitudes and longitudes become points of Web Mercator.
export function points(latitudes, longitudes) {
  const both = latitudes.map((latitude, k) => mercator(latitude, longitudes[k]));
  return { x: both.map(([x]) => x), y: both.map(([, y]) => y) };
}

export const EMPTY = { ways: [], fixes: { x: [], y: [], quality: [], accuracy: [] }, rejected: { x: [], y: [] }, origin: null };

export class MapView {
  // hooks: follow(on) when the person switches it; without that hook there is nothing to follow.
  constructor(host, label, hooks = {}) {
    Object.assign(this, { host, hooks, model: EMPTY, following: false, fitted: false, tiles: null, plain: true, due: false });
    this.ground = element("div", { className: "map-tiles" });
    this.ground.setAttribute("aria-hidden", "true");
    this.canvas = element("canvas", { className: "map-canvas" });
    this.canvas.setAttribute("aria-hidden", "true");
    this.board = element("div", { className: "map-board", tabIndex: 0, role: "application" }, this.ground, this.canvas);
    this.board.setAttribute("aria-label", `${label}: arrows move it, plus and minus zoom`);
    this.list = element("ul");
    this.legend = element("details", { className: "map-legend", open: innerWidth > 1100 }, element("summary", { textContent: "What is drawn" }), this.list);
    this.follow = element("button", { type: "button", textContent: "Follow", title: "Keep the leading filter in the middle (key F)", hidden: !hooks.follow });
    const button = (text, title, act) => element("button", { type: "button", textContent: text, title, onclick: act, ariaLabel: title });
    this.tools = element("div", { className: "map-tools" },
      button("+", "Zoom in", () => this.camera.zoomBy(1)), button("−", "Zoom out", () => this.camera.zoomBy(-1)),
      button("All", "Show all of the way", () => { this.hooks.follow?.(false); this.fit(); }), this.follow);
    this.bar = element("i"); this.length = element("span");
    this.note = element("p", { className: "map-note", role: "status" });
    this.credit = element("p", { className: "map-credit" });
    host.append(this.board, this.legend, this.tools, element("div", { className: "map-foot" },
      this.note, element("p", { className: "map-scale" }, this.bar, this.length, element("span", { textContent: "north up" })), this.credit));
    this.camera = new Camera(this.board, (byPerson) => this.moved(byPerson));
    this.follow.addEventListener("click", () => this.hooks.follow(!this.following));
    new ResizeObserver(() => this.resize()).observe(host);
    document.addEventListener("gyrofree-theme", () => this.theme());
    system.addEventListener("change", () => this.theme());
    this.resize();
    this.load().catch((error) => this.say(error.message));
  }

  async load() {
    const info = await call("map");
    if (info.state !== "ready") return this.say(info.text[0].toUpperCase() + info.text.slice(1) + ".");
    if (!hasWebgl()) return this.say("This browser has no WebGL, so the map's tiles cannot be drawn; ways stand on a plain grid.");
    this.info = info;
    const tiles = await Tiles.on(this.ground, info, isDark(), (text) => this.say(text));
    Object.assign(this, { tiles, plain: false });
    this.credit.textContent = info.attribution;
    this.host.dataset.tiles = info.kind;
    this.resize();
  }

  say(text) { this.note.textContent = text; }

  resize() {
    const { clientWidth, clientHeight } = this.host;
    if (!clientWidth || !clientHeight) return;
    this.tiles?.resize();
    this.camera.resize(clientWidth, clientHeight);
    if (!this.fitted) this.first();
  }

  theme() {
    this.tiles?.theme(isDark());
    this.draw();
  }

  moved(byPerson) {
    if (byPerson && this.following) this.hooks.follow?.(false);
    this.tiles?.look(this.camera);
    this.draw();
  }

  set(model) {
    this.model = model;
    this.showLegend();
    if (!this.fitted) this.first();
    const lead = this.following && model.ways.find((way) => way.now);
    if (lead) this.camera.moveTo(lead.now.x, lead.now.y);
    else this.draw();
  }

  setFollow(on) {
    if (this.following === on) return;
    this.following = on;
    this.follow.setAttribute("aria-pressed", String(on));
    this.set(this.model);
  }

  places() {
    const { ways, fixes } = this.model;
    return [...ways.map((way) => [way.x, way.y]), ...ways.filter((way) => way.now).map(({ now }) => [[now.x], [now.y]]), [fixes.x, fixes.y]];
  }

  // The first look: all of it; the bounds of the file while there is nothing.
  first() {
    const box = this.host.clientWidth > 1 && this.box();
    if (box) {
      this.fitted = true;
      this.camera.fit(box);
    } else if (this.info) {
      const [west, south, east, north] = this.info.bounds;
      this.camera.fit([...mercator(Math.min(north, 85), west), ...mercator(Math.max(south, -85), east)]);
    }
  }

  fit() {
    const box = this.box();
    if (box) this.camera.fit(box);
  }

  box() {
    let [west, north, east, south] = [Infinity, Infinity, -Infinity, -Infinity], count = 0;
    for (const [xs, ys] of this.places()) {
      for (let k = 0; k < xs.length; k++, count++) {
        west = Math.min(west, xs[k]); east = Math.max(east, xs[k]); north = Math.min(north, ys[k]); south = Math.max(south, ys[k]);
      }
    }
    return count >= FEW ? [west, north, east, south] : null;
  }

  draw() {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      paint(this.canvas, this.camera, this.model, { plain: this.plain, dark: isDark() });
      const { px, text } = scaleBar(this.camera);
      this.bar.style.width = `${px.toFixed(1)}px`;
      this.length.textContent = text;
    });
  }

  showLegend() {
    const items = this.model.said ?? [];
    const qualities = [...new Set(this.model.fixes.quality)].filter((one) => one in QUALITIES);
    const key = JSON.stringify([items, qualities, this.model.title]);
    if (this.list.dataset.drawn === key) return;
    this.list.dataset.drawn = key;
    this.legend.firstChild.textContent = this.model.title ?? "What is drawn";
    this.list.replaceChildren(...items.map(({ colour, title, text, dots }) => {
      const sample = element("i", { className: dots ? "dots" : "", hidden: !colour });
      sample.style.color = colour;
      return element("li", {}, sample, element("b", { textContent: title }), element("span", { textContent: text }));
    }), ...(qualities.length ? [element("li", { className: "qualities" }, ...qualities.map((one) => {
      const sample = element("i", { className: "dots" });
      sample.style.color = QUALITIES[one];
      return element("span", {}, sample, one);
    }))] : []));
  }
}
