// What every chart gets, live and of a session: what happened as ranges with names, one outlier that does not flatten
// the rest, and the figure as SVG or PNG for a paper. `figure` describes a chart:
// {title, unit, origin, ranges: [[t0, t1, text, kind]], lines: () => [{label, color, dash, width, x, low, high, half, unsure, faint}]};
// `shades` are ranges that the chart itself draws already; `unsure` is what an estimator says where it does not vouch,
// `faint` are the stretches of that, [[from, until]]: the line is dotted there.
const FAR = 4; // widths of the bulk that a point is away from it before it counts as an outlier
const FEW = 4; // of them at one side; more are a signal
const FRESH = 0.04; // newest share of the window, in which a jump may be the beginning of something
export const SHADES = { blind: "#d55e00", ambiguous: "#c9b400" }; // what a filter does not vouch for: no lines, few names
const TINT = { ...SHADES, mark: "#c564a0", coarse: "#7f93a6", step: "#3296d8", late: "#b08000", alarm: "#d6404e" };
const FACE = "system-ui, 'DejaVu Sans', sans-serif";

const number = (v) => (v === 0 ? "0" : Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3 ? v.toExponential(2) : String(Number(v.toPrecision(4))));

// Least and greatest to be shown of the lines within [a, b], and the points that lie far outside.
// `done`: nothing more comes, so the newest points are no beginning of something.
export function robust(lines, a, b, done = false) {
  const points = [];
  for (const line of lines) {
    for (let k = 0; k < line.x.length; k++) {
      const x = line.x[k];
      if (x < a || x > b) continue;
      for (const y of line.low === line.high ? [line.low[k]] : [line.low[k], line.high[k]]) {
        if (y !== null && y !== undefined && Number.isFinite(y)) points.push([y, x, line]);
      }
    }
  }
  if (points.length < 50) return null;
  points.sort((p, q) => p[0] - q[0]);
  const at = (share) => points[Math.round(share * (points.length - 1))][0];
  const low = at(0.02), high = at(0.98), width = high - low;
  // rounding alone is no width: uPlot has no ticks so small
  if (!(width > 1e-9 * Math.max(Math.abs(low), Math.abs(high), 1e-3))) return null;
  const settled = ([, x]) => done || x < b - FRESH * (b - a);
  const above = points.filter(([y]) => y > high + FAR * width), below = points.filter(([y]) => y < low - FAR * width);
  const odd = [above, below].flatMap((some) => (places(some) <= FEW && some.every(settled) ? some : []));
  if (!odd.length) return null;
  const kept = points.filter((p) => !odd.includes(p));
  return { min: kept[0][0], max: kept.at(-1)[0], odd: odd.map(([y, x, line]) => ({ x, y, line })) };
}

// How many separate moments some points are.
const places = (points) => new Set(points.map(([, x]) => x)).size;

// Give a chart of uPlot the range, the drawing and the tools. describe() gives the figure as it is now.
export function dress(u, describe) {
  const scale = u.scales.y, usual = scale.range;
  scale.range = (self, min, max, key) => {
    const { min: a, max: b } = self.scales.x;
    const figure = describe();
    u.odd = a < b ? robust(figure.lines(), a, b, figure.done) : null;
    if (!u.odd) return usual(self, min, max, key);
    const margin = 0.12 * (u.odd.max - u.odd.min);
    return [u.odd.min - margin, u.odd.max + margin];
  };
  for (const axis of u.axes) axis.values = spelt(axis.values);
  (u.hooks.drawAxes ??= []).push(() => drawRanges(u, describe()));
  (u.hooks.draw ??= []).push(() => { const figure = describe(); drawFaint(u, figure); drawOdd(u); drawOrigin(u, figure); });
  u.redraw(true);
}

// Ticks as numbers are spelt elsewhere: thousands apart by a thin blank, a minus that is one.
const spelt = (values) => (...asked) => values(...asked).map((v) => (typeof v === "string" ? v.replaceAll(",", "\u202f").replace("-", "−") : v));

const ink = (u) => getComputedStyle(u.root).color;

function pen(u, work) {
  const c = u.ctx, { left, top, width, height } = u.bbox, px = devicePixelRatio;
  c.save();
  c.beginPath();
  c.rect(left, top, width, height);
  c.clip();
  c.font = `${11 * px}px ${FACE}`;
  work(c, { left, top, right: left + width, bottom: top + height }, px);
  c.restore();
}

function drawRanges(u, { ranges }) {
  pen(u, (c, box, px) => {
    const ends = [], shaded = {}; // of the names on each line of text; how far each word has been said
    for (const [t0, t1, text, kind] of ranges) {
      const a = u.valToPos(t0, "x", true), b = u.valToPos(t1, "x", true);
      if (b < box.left || a > box.right) continue;
      c.fillStyle = c.strokeStyle = TINT[kind] ?? TINT.mark;
      c.lineWidth = px;
      if (b - a > px) {
        c.globalAlpha = 0.13;
        c.fillRect(a, box.top, b - a, box.bottom - box.top);
        c.globalAlpha = 1;
      }
      if (kind in SHADES) {
        const from = Math.max(a, box.left) + 3 * px, wide = c.measureText(text).width;
        if (from + wide > b || from < (shaded[kind] ?? -Infinity)) continue;
        shaded[kind] = from + 6 * wide;
        c.textBaseline = "bottom";
        c.textAlign = "left";
        c.fillText(text, from, box.bottom - 2 * px);
        continue;
      }
      c.setLineDash([3 * px, 3 * px]);
      for (const x of t1 > t0 ? [a, b] : [a]) {
        c.beginPath(); c.moveTo(x, box.top); c.lineTo(x, box.bottom); c.stroke();
      }
      const words = text.length > 32 ? `${text.slice(0, 31)}…` : text, wide = c.measureText(words).width;
      const x = Math.max(box.left, Math.min(a, box.right - wide - 6 * px)) + 3 * px;
      let line = ends.findIndex((end) => end < x);
      if (line < 0) line = ends.length;
      if (line > 2) continue; // no room for one more name; the line stands
      ends[line] = x + wide + 4 * px;
      c.textBaseline = "top";
      c.textAlign = "left";
      c.fillText(words, x, box.top + (2 + 13 * line) * px);
    }
  });
}

const within = (stretches, x) => stretches.some(([from, until]) => x >= from && x <= until);

// The gaps of a series of uPlot, px: those that it found, and stretches of time; it wants them in order, none over another.
export function gapsOf(u, found, stretches) {
  const more = stretches.map(([from, until]) => [u.valToPos(from, "x", true), u.valToPos(until, "x", true)]);
  const merged = [];
  for (const [a, b] of [...found, ...more].sort((one, other) => one[0] - other[0])) {
    if (merged.length && a <= merged.at(-1)[1]) merged.at(-1)[1] = Math.max(b, merged.at(-1)[1]);
    else merged.push([a, b]);
  }
  return merged;
}

// What an estimator does not vouch for is dotted; the chart's own line has a gap there.
function drawFaint(u, figure) {
  const { min, max } = u.scales.x;
  for (const line of figure.lines()) {
    const faint = (line.faint ?? []).filter(([from, until]) => from <= max && until >= min);
    if (!faint.length) continue;
    pen(u, (c, _, px) => {
      Object.assign(c, { strokeStyle: line.color, lineWidth: (line.width ?? 1.4) * px, lineCap: "round" });
      c.setLineDash([0.5 * px, 3.5 * px]);
      c.beginPath();
      let down = false;
      line.x.forEach((t, k) => {
        const low = line.low[k], high = line.high[k];
        if (!within(faint, t) || !Number.isFinite(low)) { down = false; return; }
        for (const y of high === low ? [low] : [low, high]) {
          const at = [u.valToPos(t, "x", true), u.valToPos(y, figure.high ?? "y", true)];
          if (down) c.lineTo(...at); else c.moveTo(...at);
          down = true;
        }
      });
      c.stroke();
    });
  }
}

function drawOdd(u) {
  if (!u.odd) return;
  pen(u, (c, box, px) => {
    const seen = new Set();
    for (const { x: t, y, line } of u.odd.odd) {
      const up = y > u.odd.max, key = `${up} ${line.label} ${Math.round(u.valToPos(t, "x"))}`;
      if (seen.has(key)) continue;
      seen.add(key);
      const x = u.valToPos(t, "x", true), tip = up ? box.top + px : box.bottom - px, foot = tip + (up ? 7 : -7) * px;
      c.fillStyle = line.color;
      c.beginPath(); c.moveTo(x, tip); c.lineTo(x - 4 * px, foot); c.lineTo(x + 4 * px, foot); c.fill();
      const words = number(y), right = x + 8 * px + c.measureText(words).width < box.right;
      c.textAlign = right ? "left" : "right";
      c.textBaseline = up ? "top" : "bottom";
      c.fillText(words, x + (right ? 6 : -6) * px, tip);
    }
  });
}

// Below the numbers of the time axis: what they count, and from when.
function drawOrigin(u, { origin }) {
  if (!origin) return;
  const c = u.ctx, { left, width } = u.bbox, px = devicePixelRatio;
  c.save();
  c.fillStyle = ink(u);
  c.globalAlpha = 0.75;
  c.font = `${11 * px}px ${FACE}`;
  c.textAlign = "right";
  c.textBaseline = "bottom";
  c.fillText(origin, left + width, c.canvas.height - 2 * px, width);
  c.restore();
}

// ---- the figure for a paper: white, black axes, units, legend

const W = 720, H = 360, L = 70, R = 14, T = 34, B = 48;
const text = (x, y, words, more = "") => `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" ${more}>${escape(words)}</text>`;
const escape = (words) => String(words).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

function steps(low, high, most) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= raw);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, k) => (Math.ceil(low / step) + k) * step)
    .map((v) => [v, v.toFixed(digits).replace("-", "−")]);
}

function trace(line, a, b, X, Y, keep = () => true) {
  let down = false, path = "";
  for (let k = 0; k < line.x.length; k++) {
    const x = line.x[k], low = line.low[k], high = line.high[k];
    if (!keep(x)) { down = false; continue; }
    if (x < a || x > b || low === null || low === undefined || !Number.isFinite(low)) { down = down && (x < a || x > b); continue; }
    path += `${down ? "L" : "M"}${X(x).toFixed(2)} ${Y(low).toFixed(2)}`;
    if (high !== low) path += `L${X(x).toFixed(2)} ${Y(high).toFixed(2)}`;
    down = true;
  }
  return path;
}

// The place of a value on an axis from `from` to `to`, px, and its ticks; over decades where the chart's scale is.
function placed(scale, from, to, most) {
  const { min, max, distr } = scale;
  if (distr !== 3) return [(v) => from + ((v - min) / (max - min)) * (to - from), steps(min, max, most)];
  const [a, b] = [Math.log10(min), Math.log10(max)], decades = [];
  for (let k = Math.ceil(a - 1e-9); k <= b + 1e-9; k++) decades.push([10 ** k, k >= -3 && k <= 4 ? String(Number((10 ** k).toPrecision(1))) : `1e${k}`.replace("-", "−")]);
  return [(v) => from + ((Math.log10(v) - a) / (b - a)) * (to - from), decades];
}

export function svg(u, figure) {
  const across = u.scales.x, upright = u.scales[figure.high ?? "y"], { min: a, max: b } = across, { max: high } = upright;
  const [X, along] = placed(across, L, W - R, 8), [Y, up] = placed(upright, H - B, T, 6);
  const out = [
    `<svg xmlns="http://www.w3.org/2000/svg" width="${W}" height="${H}" viewBox="0 0 ${W} ${H}" font-family="DejaVu Sans, Helvetica, Arial, sans-serif" font-size="11">`,
    `<title>${escape(figure.title)}</title><rect width="${W}" height="${H}" fill="#fff"/>`,
    `<clipPath id="box"><rect x="${L}" y="${T}" width="${W - L - R}" height="${H - T - B}"/></clipPath>`,
  ];
  for (const [v, words] of up) out.push(`<path d="M${L} ${Y(v).toFixed(2)}H${W - R}" stroke="#ddd" stroke-width="0.6"/>`, text(L - 6, Y(v) + 4, words, 'text-anchor="end"'));
  for (const [v, words] of along) out.push(`<path d="M${X(v).toFixed(2)} ${T}V${H - B}" stroke="#ddd" stroke-width="0.6"/>`, text(X(v), H - B + 15, words, 'text-anchor="middle"'));
  out.push('<g clip-path="url(#box)">');
  for (const [t0, t1, words, kind] of [...(figure.shades ?? []), ...figure.ranges]) {
    if (t1 < a || t0 > b) continue;
    const colour = TINT[kind] ?? TINT.mark, room = X(Math.min(t1, b)) - X(Math.max(t0, a)), shade = kind in SHADES;
    out.push(`<rect x="${X(t0).toFixed(2)}" y="${T}" width="${Math.max(0.8, X(t1) - X(t0)).toFixed(2)}" height="${H - T - B}" fill="${colour}" fill-opacity="${t1 > t0 ? 0.12 : 1}"/>`);
    if (!shade || room > 6 * words.length) out.push(text(Math.max(L, X(t0)) + 3, shade ? H - B - 4 : T + 11, words, `fill="${colour}" font-size="9"`));
  }
  const lines = figure.lines();
  for (const line of lines) {
    if (line.half) {
      const ahead = [], back = [];
      for (let k = 0; k < line.x.length; k++) {
        if (line.x[k] < a || line.x[k] > b) continue;
        ahead.push(`${X(line.x[k]).toFixed(2)} ${Y(line.half[0][k]).toFixed(2)}`);
        back.unshift(`${X(line.x[k]).toFixed(2)} ${Y(line.half[1][k]).toFixed(2)}`);
      }
      if (ahead.length) out.push(`<path d="M${[...ahead, ...back].join("L")}Z" fill="${line.color}" fill-opacity="0.18"/>`);
    }
    const faint = line.faint ?? [], dotted = faint.length ? trace(line, a, b, X, Y, (x) => within(faint, x)) : "";
    if (dotted) out.push(`<path d="${dotted}" fill="none" stroke="${line.color}" stroke-width="${line.width ?? 1.3}" stroke-linecap="round" stroke-dasharray="0.5 3"/>`);
    out.push(`<path d="${trace(line, a, b, X, Y, (x) => !within(faint, x))}" fill="none" stroke="${line.color}" stroke-width="${line.width ?? 1.3}" stroke-linejoin="round"${line.dash?.length ? ` stroke-dasharray="${line.dash.join(" ")}"` : ""}/>`);
  }
  for (const { x, y, line } of u.odd?.odd ?? []) {
    const up = y > high;
    out.push(text(X(x), up ? T + 12 : H - B - 4, `${up ? "▲" : "▼"} ${number(y)}`, `fill="${line.color}"`));
  }
  out.push(`</g><path d="M${L} ${T}V${H - B}H${W - R}" fill="none" stroke="#000"/>`);
  let x = W - R;
  for (const line of lines.filter((one) => one.label).reverse()) {
    const label = line.unsure ? `${line.label} (${line.unsure} in parts)` : line.label;
    x -= 6.4 * label.length + 30;
    out.push(`<path d="M${x} ${T - 10}h18" stroke="${line.color}" stroke-width="2"${line.dash?.length ? ` stroke-dasharray="${line.dash.join(" ")}"` : ""}/>`, text(x + 22, T - 6, label));
  }
  out.push(text(L, T - 6, figure.title, 'font-weight="bold" font-size="12"'));
  out.push(text((L + W - R) / 2, H - 12, figure.across || `time, ${figure.origin || "s"}`, 'text-anchor="middle"'));
  out.push(`<text transform="translate(16 ${(T + H - B) / 2}) rotate(-90)" text-anchor="middle">${escape(figure.unit)}</text></svg>`);
  return out.join("");
}

function save(name, url) {
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
}

const file = (figure) => figure.title.toLowerCase().normalize("NFKD").replace(/[^a-zα-ω0-9]+/g, "-").replace(/^-|-$/g, "") || "figure";

export const saveSvg = (u, figure) => save(`${file(figure)}.svg`, `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg(u, figure))}`);

export async function savePng(u, figure) {
  const picture = new Image(), canvas = document.createElement("canvas"), fine = 3; // 300 dots an inch at 7.2 inches
  picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg(u, figure))}`;
  await picture.decode();
  Object.assign(canvas, { width: W * fine, height: H * fine });
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  save(`${file(figure)}.png`, canvas.toDataURL("image/png"));
}
