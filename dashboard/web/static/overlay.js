// Sessions over one another on one axis of time; also the plots of a single session.
import { Group, Plot } from "/static/chart.js";
import { call } from "/static/rest.js";
import { Tracks } from "/static/tracks.js";

const COLORS = ["#3296d8", "#d55e00", "#009e73", "#c564a0"]; // told apart by all eyes; dashes tell them apart, too
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3]];
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
      if (begin !== undefined) { query.set("begin", begin); query.set("end", end); }
      const answer = await call(`compare?${query}`).catch((error) => { this.hooks.state(error.message, true); return null; });
      if (!answer || mine !== this.turn) return;
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
    const marks = answer.sessions.flatMap((s, k) => s.marks.map((m) => ({ ...m, color: this.color(k) })));
    const lines = answer.lines.map((line) => ({ ...line, id: `${line.session} ${line.key}` }));
    for (const { figure, kind, part, plot } of this.plots) {
      const mine = lines.filter((line) => line[kind][part]).map((line) => this.line(line, line[kind][part]));
      figure.hidden = !mine.length;
      if (kind === "error" && mine.length) figure.querySelector("small").textContent = `against ${[...new Set(mine.map((l) => l.against))].join(", ")}, deg/s`;
      plot.set(mine, marks);
    }
    this.trackFigure.hidden = !answer.tracks.length;
    this.tracks.set(answer.tracks.map((track) => ({
      ...track, ...this.trackLook(track), hidden: this.hidden.has(`${track.session} ${track.key}`),
    })));
    this.showLegend(lines, answer.tracks);
    this.hooks.data(answer);
  }

  color(session) {
    return COLORS[session];
  }

  line(line, part) {
    const tacho = line.kind === "tacho" || line.kind === "truth";
    const alone = this.ids.length === 1; // then colours tell lines apart, not sessions
    const rates = this.answer.lines.filter((l) => l.session === line.session && l.kind === line.kind);
    const place = rates.findIndex((l) => l.key === line.key);
    return {
      ...part, high: part.high ?? part.low, t0: line.t0, dt: line.dt, against: line.against,
      color: tacho && alone ? "#888888" : alone ? COLORS[place % 4] : COLORS[line.session],
      dash: alone ? DASHES[place % 4] : DASHES[line.session], width: tacho ? 1 : 1.5,
      alpha: tacho ? 0.65 : 1 / (1 + 0.5 * (alone ? 0 : place)), hidden: this.hidden.has(line.id),
      short: alone ? line.title : `${LETTERS[line.session]} ${line.title}`,
    };
  }

  // Of one session alone colours tell its tracks apart, else the sessions.
  trackLook(track) {
    const place = this.ids.length === 1 ? this.answer.tracks.findIndex((t) => t.key === track.key) : track.session;
    return { color: COLORS[place % 4], dash: DASHES[place % 4], dots: track.title === "gnss" };
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
