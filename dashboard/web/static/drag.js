// Choosing a stretch of a chart with mouse or finger: uPlot's own selection knows the mouse only.
const DRAGGED = 8; // px that make a drag of a click

// done(a, b) after a drag, s; click(t) after a press at one place.
export function selectable(u, done, click = () => {}) {
  const over = u.over;
  let from = null;
  const at = (event) => Math.min(over.clientWidth, Math.max(0, event.clientX - over.getBoundingClientRect().left));
  const show = (left, width) => u.setSelect({ left, width, top: 0, height: width ? over.clientHeight : 0 }, false);
  over.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    from = at(event);
    over.setPointerCapture(event.pointerId);
  });
  over.addEventListener("pointermove", (event) => {
    const x = at(event);
    if (event.pointerType !== "mouse") u.setCursor({ left: x, top: 0 });
    if (from !== null) show(Math.min(from, x), Math.abs(x - from));
  });
  const end = (event) => {
    if (from === null) return;
    const [a, b] = [from, at(event)].sort((p, q) => p - q).map((x) => u.posToVal(x, "x"));
    const far = Math.abs(at(event) - from) > DRAGGED;
    from = null;
    show(0, 0);
    if (event.type === "pointercancel") return; // the browser scrolls the page
    if (far) done(a, b);
    else click(b);
  };
  over.addEventListener("pointerup", end);
  over.addEventListener("pointercancel", end);
}

// Where a key takes a window [a, b] of a chart that has the focus; `all` for the key 0.
export function keyed(key, [a, b], all) {
  const w = b - a;
  return { ArrowLeft: [a - w / 4, b - w / 4], ArrowRight: [a + w / 4, b + w / 4], "+": [a + w / 4, b - w / 4], "-": [a - w / 2, b + w / 2], 0: all }[key];
}
