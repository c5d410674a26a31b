// Ways, fixes and places on a canvas over the tiles, or over a plain grid. Everything comes in Web Mercator.
import { metresAt } from "/static/map/camera.js";

const LENGTHS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1e3, 2e3, 5e3, 1e4, 2e4, 5e4, 1e5, 2e5, 5e5, 1e6];
const CELL = 70, BAR = 130; // px: least of a cell of the grid, most of the scale bar
const CIRCLES = 40; // newest fixes that have their accuracy drawn
export const QUALITIES = {
  "RTK fixed": "#009e73", "RTK float": "#56b4e9", differential: "#e69f00", autonomous: "#8c8c8c", "dead reckoning": "#cc79a7", none: "#8c8c8c",
};
const REJECTED = "#d55e00";

export function scaleBar(camera) {
  const pixel = metresAt(camera.y).east / camera.scale; // m
  const length = LENGTHS.filter((one) => one / pixel <= BAR).at(-1) ?? LENGTHS[0];
  return { px: length / pixel, text: length >= 1000 ? `${length / 1000} km` : length < 1 ? `${Math.round(length * 100)} cm` : `${length} m` };
}

// model: {ways: [{colour, x, y, now}], fixes: {x, y, quality, accuracy}, rejected: {x, y}, origin}
export function paint(canvas, camera, model, { plain, dark }) {
  const ratio = devicePixelRatio, { width, height, scale } = camera;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  }
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, width, height);
  const X = (x) => (x - camera.x) * scale + width / 2, Y = (y) => (y - camera.y) * scale + height / 2;
  const metres = metresAt(camera.y), look = { ink: dark ? "#f2f2f2" : "#1a1a1a", ground: dark ? "#121416" : "#ffffff" };
  const place = { X, Y, east: scale / metres.east, north: scale / metres.north, ...look };
  c.lineJoin = c.lineCap = "round";
  if (plain) grid(c, camera, model.origin, place);
  fixes(c, model.fixes, place);
  for (const way of model.ways.toReversed()) line(c, way, place, way.dots);
  newest(c, model.fixes, place);
  crosses(c, model.rejected, place);
  const there = model.ways.filter((way) => way.now);
  for (const way of there.slice(1).toReversed()) body(c, way, place, false);
  if (there.length) body(c, there[0], place, there[0] === model.ways[0]);
}

function grid(c, camera, origin, { X, Y, east, north, ink }) {
  const { width, height } = camera, cell = LENGTHS.find((one) => one * east >= CELL) ?? LENGTHS.at(-1);
  const x0 = X(origin?.x ?? camera.x), y0 = Y(origin?.y ?? camera.y), dx = cell * east, dy = cell * north;
  c.strokeStyle = ink;
  c.lineWidth = 1;
  for (const [from, step, most, across] of [[x0, dx, width, true], [y0, dy, height, false]]) {
    for (let k = Math.ceil(-from / step); from + k * step <= most; k++) {
      const at = Math.round(from + k * step) + 0.5;
      c.globalAlpha = k % 5 ? 0.08 : 0.2;
      c.beginPath();
      if (across) { c.moveTo(at, 0); c.lineTo(at, height); } else { c.moveTo(0, at); c.lineTo(width, at); }
      c.stroke();
    }
  }
  c.globalAlpha = 1;
}

function line(c, way, { X, Y, ground }, dots) {
  c.fillStyle = way.colour;
  if (dots) {
    for (let k = 0; k < way.x.length; k++) c.fillRect(X(way.x[k]) - 1.5, Y(way.y[k]) - 1.5, 3, 3);
    return;
  }
  c.beginPath();
  for (let k = 0; k < way.x.length; k++) c.lineTo(X(way.x[k]), Y(way.y[k]));
  if (way.now && !way.whole) c.lineTo(X(way.now.x), Y(way.now.y));
  c.strokeStyle = ground;
  c.globalAlpha = 0.6;
  c.lineWidth = 4.5;
  c.stroke();
  c.strokeStyle = way.colour;
  c.globalAlpha = 1;
  c.lineWidth = 2.2;
  c.stroke();
}

function accuracy(c, fixes, k, { X, Y, east, north }, alpha) {
  if (!fixes.accuracy[k]) return;
  c.globalAlpha = alpha;
  c.lineWidth = 1;
  c.beginPath();
  c.ellipse(X(fixes.x[k]), Y(fixes.y[k]), fixes.accuracy[k][1] * east, fixes.accuracy[k][0] * north, 0, 0, 2 * Math.PI);
  c.stroke();
}

function fixes(c, told, place) {
  const last = told.at ?? told.x.length - 1; // or the one of a chosen moment
  for (let k = 0; k < told.x.length; k++) {
    const near = k <= last && k > last - CIRCLES;
    c.strokeStyle = c.fillStyle = QUALITIES[told.quality[k]] ?? QUALITIES.none;
    if (near && k < last) accuracy(c, told, k, place, 0.25);
    c.globalAlpha = near ? 0.9 : 0.45;
    c.fillRect(place.X(told.x[k]) - 1.5, place.Y(told.y[k]) - 1.5, 3, 3);
  }
  c.globalAlpha = 1;
}

function newest(c, told, place) {
  const k = told.at ?? told.x.length - 1;
  if (!(k >= 0)) return;
  c.strokeStyle = c.fillStyle = QUALITIES[told.quality[k]] ?? QUALITIES.none;
  accuracy(c, told, k, place, 0.9);
  c.globalAlpha = 1;
  c.beginPath();
  c.arc(place.X(told.x[k]), place.Y(told.y[k]), 4.5, 0, 2 * Math.PI);
  c.fill();
  c.strokeStyle = place.ink;
  c.lineWidth = 1.2;
  c.stroke();
}

function crosses(c, { x, y }, { X, Y }) {
  c.strokeStyle = REJECTED;
  c.lineWidth = 2;
  for (let k = 0; k < x.length; k++) {
    const px = X(x[k]), py = Y(y[k]);
    c.beginPath();
    c.moveTo(px - 4, py - 4); c.lineTo(px + 4, py + 4); c.moveTo(px + 4, py - 4); c.lineTo(px - 4, py + 4);
    c.stroke();
  }
}

// Where a filter is: the leading one with its ellipse and the arrow of its heading.
function body(c, { colour, now }, { X, Y, east, ink, ground }, leads) {
  const px = X(now.x), py = Y(now.y);
  c.globalAlpha = now.stale ? 0.4 : 1;
  if (leads && now.ellipse) {
    const [longer, shorter, bearing] = now.ellipse, alpha = c.globalAlpha;
    c.beginPath();
    c.ellipse(px, py, longer * east, shorter * east, bearing - Math.PI / 2, 0, 2 * Math.PI);
    c.fillStyle = c.strokeStyle = colour;
    c.globalAlpha = 0.18 * alpha;
    c.fill();
    c.globalAlpha = alpha;
    c.lineWidth = 1.4;
    c.stroke();
  }
  c.fillStyle = colour;
  c.strokeStyle = leads ? ink : ground;
  c.lineWidth = 1.5;
  c.beginPath();
  if (leads && now.heading !== null) {
    c.save();
    c.translate(px, py);
    c.rotate(now.heading);
    for (const [x, y] of [[0, -15], [9, 10], [0, 5], [-9, 10]]) c.lineTo(x, y);
    c.restore();
    c.closePath();
  } else c.arc(px, py, leads ? 6 : 4.5, 0, 2 * Math.PI);
  c.fill();
  c.stroke();
  c.globalAlpha = 1;
}
