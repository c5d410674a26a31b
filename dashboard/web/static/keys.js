// Keys, wherever the focus is: on the page around the scene or inside its frame, which has the same origin. There the
// letters would move the camera; they are commands here, and the arrows still turn it.
const TEXTS = /^(text|search|number|password|email|url)$/;
const CAMERA = new Set(["w", "a", "s", "q", "e"]);

const writes = (element) =>
  element?.isContentEditable || element?.tagName === "TEXTAREA" || element?.tagName === "SELECT" ||
  (element?.tagName === "INPUT" && TEXTS.test(element.type));

export function listen(commands, frame) {
  const hear = (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || writes(event.target)) return;
    const key = event.key.toLowerCase();
    const inside = event.view !== window;
    if (!(key in commands) && !(inside && CAMERA.has(key))) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat && event.type === "keydown") commands[key]?.();
  };
  addEventListener("keydown", hear, true);
  const inFrame = () => frame.contentWindow?.addEventListener("keydown", hear, true);
  frame.addEventListener("load", inFrame);
  inFrame();
}
