// Sessions over one another on one axis of time; also the plots of a single session.
import { Group, Plot } from "/static/chart.js";
import { call } from "/static/rest.js";
import { Tracks } from "/static/tracks.js";

// A colour is an estimator's, the same one everywhere; sessions are told apart by dash and shade.
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3]];
const SHADES = [1, 0.75, 0.55, 0.45];
const MARKS = "#c564a0";
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
    this.legend = root.querySelector(".legend");
  }

  // Until all recordings have been read whole; what is there already is drawn meanwhile.
  async load(begin, end) {
    const mine = ++this.turn;
    for (;;) {
      const query = new URLSearchParams({ ids: this.ids.join(","), ...this.more() });
      const asked = this.group.asked;
      if (asked) query.set("cursors", asked);
      if (begin !== undefined) { query.set("begin", begin); query.set("end", end); }
      const answer = await call(`compare?${query}`).catch((error) => { this.hooks.state(error.message, true); return null; });
      if (!answer || mine !== this.turn) return;
      if (answer.lines) for (const line of answer.lines) line.asked = asked;
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
    const marks = answer.sessions.flatMap((s, k) => s.marks.map((m) => ({ ...m, color: MARKS })));
    const lines = answer.lines.map((line) => ({ ...line, id: `${line.session} ${line.key}` }));
    for (const { figure, kind, part, plot } of this.plots) {
      const mine = lines.filter((line) => line[kind][part]).map((line) => ({
        ...this.line(line, line[kind][part]), measured: line.measured?.[kind]?.[part], asked: line.asked,
      }));
      figure.hidden = !mine.length;
      if (kind === "error" && mine.length) figure.querySelector("small").textContent = `against ${[...new Set(mine.map((l) => l.against))].join(", ")}, °/s`;
      plot.set(mine, marks);
    }
    this.trackFigure.hidden = !answer.tracks.length;
    this.tracks.set(answer.tracks.map((track) => ({
      ...track, ...this.trackLook(track), hidden: this.hidden.has(`${track.session} ${track.key}`),
    })));
    this.showLegend(lines, answer.tracks);
    this.hooks.data(answer);
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
    }));
  }
}
