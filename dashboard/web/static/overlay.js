// Sessions over one another on one axis of time; also the plots of a single session.
import { Group, Plot } from "/static/chart.js";
import { SHADES as UNSURE } from "/static/figure.js";
import { call } from "/static/rest.js";
import { Tracks } from "/static/tracks.js";

// A colour is an estimator's, the same one everywhere; sessions are told apart by dash and shade.
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3]];
const SHADES = [1, 0.75, 0.55, 0.45];
const OWN = ["#8f7be8", "#1e9c9c", "#b08000", "#c564a0", "#7e9430", "#3296d8"]; // of a person's own curves
const REFERENCES = { tacho: "tachometer" };
const LETTERS = "ABCD";
const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// root holds figure[data-plot]; ids: sessions; more(): further parameters; hooks: state(text), data(answer), click(t).
export class Overlay {
  constructor(root, ids, more, hooks) {
    Object.assign(this, { root, ids, more, hooks, hidden: new Set(), turn: 0 });
    this.group = new Group((begin, end) => this.load(begin, end), hooks.click);
    this.plots = [...root.querySelectorAll("figure[data-plot]")].filter((f) => f.dataset.plot !== "tracks").map((figure) => ({
      figure, kind: figure.dataset.plot.split(" ")[0], part: figure.dataset.plot.split(" ")[1], plot: new Plot(figure, this.group),
    }));
    this.trackFigure = root.querySelector("figure[data-plot=tracks]");
    this.tracks = new Tracks(this.trackFigure);
    this.own = new Map(); // text -> {figure, plot} of a person's own curves
    this.legend = root.querySelector(".legend");
  }

  // Until all recordings have been read whole; what is there already is drawn meanwhile.
  async load(begin, end) {
    const mine = ++this.turn;
    this.hooks.asked?.(begin === undefined); // else only the window has changed
    for (;;) {
      const query = new URLSearchParams({ ids: this.ids.join(","), ...this.more() });
      const asked = this.group.asked;
      if (asked) query.set("cursors", asked);
      if (begin !== undefined) { query.set("begin", begin); query.set("end", end); }
      const answer = await call(`compare?${query}`).catch((error) => { this.hooks.state(error.message, true); return null; });
      if (!answer || mine !== this.turn) return;
      for (const line of [...(answer.lines ?? []), ...(answer.own ?? [])]) line.asked = asked;
      if (answer.lines) this.show(answer, begin === undefined);
      const share = Math.round(100 * answer.done);
      this.hooks.state(answer.state === "done" ? "" : answer.lines ? `First look; reading all of it, ${share} %` : `Reading the recording, ${share} %`);
      if (answer.state === "done") return;
      await wait(answer.lines ? 700 : 150);
    }
  }

  show(answer, all) {
    this.answer = answer;
    this.group.span = answer.span;
    if (all || !this.drawn) this.group.window = answer.span;
    this.drawn = true;
    this.group.origin = `s since ${new Date(answer.start_utc_s * 1000).toISOString().replace("T", " ").slice(0, 23)} UTC${this.ids.length > 1 ? ", start of A" : ""}`;
    const coarse = Math.max(...answer.sessions.map((s) => (s.whole ? 0 : s.bin_s)));
    this.group.of = coarse ? `means over ${Number(coarse.toPrecision(2))} s` : "every sample";
    this.group.provisional = answer.state !== "done";
    const marks = answer.sessions.flatMap((s) => s.marks);
    const lines = answer.lines.map((line) => ({ ...line, id: `${line.session} ${line.key}` }));
    for (const { figure, kind, part, plot } of this.plots) {
      const mine = lines.filter((line) => line[kind][part]).map((line) => ({
        ...this.line(line, line[kind][part]), measured: line.measured?.[kind]?.[part], asked: line.asked, unsure: line.unsure?.[part],
      }));
      figure.hidden = !mine.length;
      if (kind === "error" && mine.length) figure.querySelector("small").textContent = `against ${[...new Set(mine.map((l) => REFERENCES[l.against] ?? l.against))].join(", ")}, °/s`;
      plot.set(mine, marks, kind === "rate" && answer.sessions.length === 1 ? answer.sessions[0].shades[part] : []);
    }
    this.showOwn(answer.own, marks);
    this.trackFigure.hidden = !answer.tracks.length;
    this.tracks.set(answer.tracks.map((track) => ({
      ...track, ...this.trackLook(track), hidden: this.hidden.has(`${track.session} ${track.key}`),
    })));
    this.showLegend(lines, answer.tracks);
    this.hooks.data(answer);
  }

  // A figure for each expression that can be drawn, in front of the others.
  showOwn(curves, marks) {
    const drawn = new Set(curves.filter((one) => one.lines.length).map((one) => one.text));
    for (const [text, { figure, plot }] of this.own) {
      if (drawn.has(text)) continue;
      this.group.remove(plot);
      figure.remove();
      this.own.delete(text);
    }
    curves.forEach((curve, k) => {
      if (!curve.lines.length) return;
      if (!this.own.has(curve.text)) this.own.set(curve.text, this.ownFigure(curve.text, curve.unit));
      const { plot } = this.own.get(curve.text);
      plot.set(curve.lines.map((line) => ({
        ...line, high: line.high ?? line.low, asked: curve.asked, color: OWN[k % OWN.length], width: 1.5, alpha: SHADES[line.session],
        dash: this.ids.length > 1 ? DASHES[line.session] : [], short: this.ids.length > 1 ? `${LETTERS[line.session]} ${curve.text}` : curve.text,
      })), marks);
    });
  }

  ownFigure(text, unit) {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"), chart = document.createElement("div");
    const name = document.createElement("span"), small = document.createElement("small");
    name.textContent = text;
    small.textContent = unit;
    caption.append(name, small, document.createElement("output"));
    Object.assign(chart, { className: "chart", tabIndex: 0 });
    chart.setAttribute("role", "img");
    chart.setAttribute("aria-label", `${text} over time`);
    figure.append(caption, chart);
    figure.dataset.own = text;
    this.root.querySelector(".plots").prepend(figure);
    return { figure, plot: new Plot(figure, this.group) };
  }

  line(line, part) {
    const alone = this.ids.length === 1;
    return {
      ...part, high: part.high ?? part.low, t0: line.t0, dt: line.dt, against: line.against, color: line.colour,
      dash: alone ? (line.reference ? [6, 4] : []) : DASHES[line.session], width: line.reference ? 1 : 1.5,
      alpha: (line.reference ? 0.8 : 1) * SHADES[line.session], hidden: this.hidden.has(line.id),
      short: alone ? line.title : `${LETTERS[line.session]} ${line.title}`,
    };
  }

  trackLook(track) {
    return { color: track.colour, dash: DASHES[track.session], dots: track.dots, alpha: SHADES[track.session] };
  }

  showLegend(lines, tracks) {
    const entries = [...lines, ...tracks.map((track) => ({ ...track, id: `${track.session} ${track.key}` }))];
    this.legend.replaceChildren(...entries.map((entry) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "small";
      button.setAttribute("aria-pressed", String(!this.hidden.has(entry.id)));
      const sample = document.createElement("i");
      const look = entry.kind ? this.line(entry, { low: [] }) : this.trackLook(entry);
      const stroke = look.dots ? "dotted" : look.dash?.length ? "dashed" : "solid";
      sample.style.borderTop = `${look.width < 1.5 ? 2 : 3}px ${stroke} ${look.color}`;
      sample.style.opacity = look.alpha ?? 1;
      const name = entry.device ?? entry.key.split("/")[0];
      button.append(sample, `${this.ids.length > 1 ? `${LETTERS[entry.session]} ` : ""}${name} ${entry.title}`);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(entry.id)) this.hidden.add(entry.id);
        this.show(this.answer, false);
      });
      return button;
    }), ...this.shades());
  }

  // What the tinted times mean, with a link to the word.
  shades() {
    const said = this.ids.length > 1 ? [] : Object.values(this.answer.sessions[0].shades).flat();
    return [...new Set(said.map(([, , word]) => word))].map((word) => {
      const link = document.createElement("a"), sample = document.createElement("i");
      Object.assign(link, { className: "shade", href: `/words#${word}`, title: "What the leading filter says of itself" });
      sample.style.background = UNSURE[word];
      link.append(sample, word);
      return link;
    });
  }
}
