// Where one looks: the middle in Web Mercator (0 to 1, y down) and a zoom, moved by pointer, wheel, fingers and keys.
const TILE = 512; // px of the whole world at zoom 0
const LEAST = 1, MOST = 24;
const STEP = 90; // px that an arrow key moves
const A = 6378137, E2 = 0.00669437999014; // WGS-84
const RAD = Math.PI / 180;

export const mercator = (latitude, longitude) => [(longitude + 180) / 360, 0.5 - Math.asinh(Math.tan(latitude * RAD)) / (2 * Math.PI)];
const latitudeAt = (y) => Math.atan(Math.sinh(Math.PI * (1 - 2 * y))); // rad
const bounded = (value, low, high) => Math.min(high, Math.max(low, value));

// Metres of one unit of Web Mercator, east and north, at a place.
export function metresAt(y) {
  const latitude = latitudeAt(y), bend = 1 - E2 * Math.sin(latitude) ** 2, turn = 2 * Math.PI * Math.cos(latitude);
  return { east: (turn * A) / Math.sqrt(bend), north: (turn * A * (1 - E2)) / bend ** 1.5 };
}

export class Camera {
  // root takes pointer and keys; changed(byPerson) is called after every move.
  constructor(root, changed) {
    Object.assign(this, { root, changed, x: 0.5, y: 0.5, zoom: 2, width: 1, height: 1, fingers: new Map() });
    root.addEventListener("pointerdown", (event) => this.down(event));
    root.addEventListener("pointermove", (event) => this.drag(event));
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) root.addEventListener(kind, (event) => this.fingers.delete(event.pointerId));
    root.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    root.addEventListener("dblclick", (event) => this.zoomBy(1, ...this.at(event)));
    root.addEventListener("keydown", (event) => this.key(event));
  }

  get scale() { return TILE * 2 ** this.zoom; } // px of one unit

  get center() { return { lng: this.x * 360 - 180, lat: latitudeAt(this.y) / RAD }; }

  at(event) {
    const box = this.root.getBoundingClientRect();
    return [event.clientX - box.left - this.width / 2, event.clientY - box.top - this.height / 2];
  }

  resize(width, height) {
    Object.assign(this, { width: Math.max(1, width), height: Math.max(1, height) });
    this.changed(false);
  }

  moveTo(x, y, zoom = this.zoom, byPerson = false) {
    this.x = x;
    this.y = bounded(y, 0, 1);
    this.zoom = bounded(zoom, LEAST, MOST);
    this.changed(byPerson);
  }

  pan(dx, dy) { this.moveTo(this.x + dx / this.scale, this.y + dy / this.scale, this.zoom, true); }

  // About a point, px from the middle.
  zoomBy(steps, px = 0, py = 0) {
    const before = this.scale, zoom = bounded(this.zoom + steps, LEAST, MOST), after = TILE * 2 ** zoom;
    const share = 1 / before - 1 / after;
    this.moveTo(this.x + px * share, this.y + py * share, zoom, px !== 0 || py !== 0);
  }

  // All of a box of Web Mercator, [west, north, east, south], with room around it for legend and scale.
  fit([west, north, east, south]) {
    const wide = Math.max((east - west) / (0.8 * this.width), (south - north) / (0.72 * this.height), 1e-12);
    this.moveTo((west + east) / 2, (north + south) / 2, Math.min(Math.log2(1 / (wide * TILE)), 20));
  }

  down(event) {
    if (event.button !== 0 || event.target.closest("button, a, details")) return;
    this.root.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, this.at(event));
  }

  drag(event) {
    const was = this.fingers.get(event.pointerId);
    if (!was) return;
    const now = this.at(event), other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
    this.fingers.set(event.pointerId, now);
    if (!other) return this.pan(was[0] - now[0], was[1] - now[1]);
    const apart = (p) => Math.max(Math.hypot(p[0] - other[0], p[1] - other[1]), 1);
    this.zoomBy(Math.log2(apart(now) / apart(was)), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 18 : 1;
    this.zoomBy(bounded((-event.deltaY * lines) / 320, -2, 2), ...this.at(event));
  }

  key(event) {
    const moves = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] };
    if (event.target !== this.root || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in moves) this.pan(...moves[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoomBy(1);
    else if (event.key === "-") this.zoomBy(-1);
    else return;
    event.preventDefault();
  }
}
