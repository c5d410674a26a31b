// The board as a cube on a plain canvas, which lasts for days where a graphics context may be lost. Body b: x, y, z; n: north, east, down.
const VIEW = { azimuth: (35 * Math.PI) / 180, elevation: (24 * Math.PI) / 180 };
const FACES = [["x", 0, 1, "#56b4e9"], ["x", 0, -1, "#56b4e9"], ["y", 1, 1, "#009e73"], ["y", 1, -1, "#009e73"], ["z", 2, 1, "#e69f00"], ["z", 2, -1, "#e69f00"]];
const SHORTEST = 0.08, PER_RADPS = 0.2, LONGEST = 0.75; // of the arrow, in half sides

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function turn([w, x, y, z], [a, b, c]) {
  const tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

const ca = Math.cos(VIEW.azimuth), sa = Math.sin(VIEW.azimuth), ce = Math.cos(VIEW.elevation), se = Math.sin(VIEW.elevation);
const RIGHT = [-sa, ca, 0], TOWARDS = [-ca * ce, -sa * ce, -se], UP = [ca * se, sa * se, -ce];

export class Cube {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  // q: body to n, w x y z, or null; omega: of the body, rad/s, with null for what is not known.
  draw(q, omega) {
    const { canvas, context: c } = this;
    const ratio = Math.min(devicePixelRatio, 2), width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    c.clearRect(0, 0, width, height);
    const scale = Math.min(width, height) * 0.22;
    const at = (v) => [width / 2 + scale * dot(v, RIGHT), height / 2 - scale * dot(v, UP)];
    if (!q) {
      c.fillStyle = "#aab3ba";
      c.font = `600 ${scale * 0.3}px system-ui, sans-serif`;
      c.textAlign = "center";
      c.fillText("attitude not known", width / 2, height / 2);
      return;
    }
    for (const [name, axis, sign, colour] of FACES) this.face(q, name, axis, sign, colour, at, scale);
    if (omega?.every((value) => value !== null)) this.arrow(turn(q, omega), at, scale);
  }

  face(q, name, axis, sign, colour, at, scale) {
    const unit = [0, 0, 0];
    unit[axis] = sign;
    const normal = turn(q, unit), facing = dot(normal, TOWARDS);
    if (facing <= 0) return;
    const { context: c } = this, one = (axis + 1) % 3, two = (axis + 2) % 3;
    c.beginPath();
    for (const [a, b] of [[1, 1], [1, -1], [-1, -1], [-1, 1]]) {
      const corner = [0, 0, 0];
      [corner[axis], corner[one], corner[two]] = [sign, a, b];
      c.lineTo(...at(turn(q, corner)));
    }
    c.closePath();
    c.globalAlpha = 0.6 + 0.4 * facing;
    c.fillStyle = sign > 0 ? colour : "#3a4147";
    c.fill();
    c.globalAlpha = 1;
    c.lineWidth = Math.max(2, scale * 0.015);
    c.strokeStyle = "#f2f4f5";
    c.stroke();
    if (facing < 0.2) return;
    const [x, y] = at(normal);
    c.fillStyle = "#f2f4f5";
    c.font = `700 ${scale * 0.34}px system-ui, sans-serif`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.fillText(`${sign < 0 ? "−" : ""}${name}`, x, y);
  }

  arrow(omega, at, scale) {
    const size = Math.hypot(...omega);
    if (size < 0.05) return;
    const length = Math.min(SHORTEST + PER_RADPS * size, LONGEST), u = omega.map((v) => v / size);
    const [x0, y0] = at(u.map((v) => v * 1.1)), [x1, y1] = at(u.map((v) => v * (1.1 + length)));
    const { context: c } = this, angle = Math.atan2(y1 - y0, x1 - x0), head = scale * 0.16;
    c.strokeStyle = c.fillStyle = "#ff6b57";
    c.lineWidth = Math.max(4, scale * 0.045);
    c.beginPath();
    c.moveTo(x0, y0);
    c.lineTo(x1, y1);
    c.stroke();
    c.beginPath();
    c.moveTo(x1 + head * Math.cos(angle), y1 + head * Math.sin(angle));
    for (const side of [2.4, -2.4]) c.lineTo(x1 + head * Math.cos(angle + side), y1 + head * Math.sin(angle + side));
    c.fill();
  }
}
