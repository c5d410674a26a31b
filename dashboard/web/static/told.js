// Alarms as notices of the browser and, where it is switched on, as a sound. Nothing is asked before a click.
const NOTIFY = "gyrofree-notify", SOUND = "gyrofree-sound", TOLD = "gyrofree-told";
const EACH_MS = 60000; // between two notices of one alarm
const KEPT = 200; // alarms that were told of

const kept = (key) => { try { return localStorage.getItem(key); } catch { return null; } };
const keep = (key, value) => { try { localStorage.setItem(key, value); } catch { /* private mode: until the page is left */ } };

export const possible = "Notification" in window && window.isSecureContext;
export const notifies = () => possible && Notification.permission === "granted" && kept(NOTIFY) === "1";
export const sounds = () => kept(SOUND) === "1";
export const setSound = (on) => keep(SOUND, on ? "1" : "0");

// To be called by a click: browsers show their question then only.
export async function setNotify(on) {
  if (on && possible && Notification.permission !== "granted" && (await Notification.requestPermission()) !== "granted") {
    throw new Error("The browser does not allow notices of this page: allow them in its settings of this site.");
  }
  keep(NOTIFY, on ? "1" : "0");
}

function told() {
  try { return JSON.parse(kept(TOLD) ?? "{}"); } catch { return {}; }
}

export function beep() {
  const context = new AudioContext(), tone = context.createOscillator(), gain = context.createGain();
  tone.frequency.value = 880;
  gain.gain.setValueAtTime(0.15, context.currentTime);
  gain.gain.exponentialRampToValueAtTime(0.001, context.currentTime + 0.5);
  tone.connect(gain).connect(context.destination);
  tone.start();
  tone.stop(context.currentTime + 0.5);
  tone.addEventListener("ended", () => context.close());
}

// alarms: {device, id, level, state, title, text, raised_s}. One notice for each beginning, kept between pages and tabs.
export function tell(alarms) {
  if (!notifies() && !sounds()) return;
  const known = told(), now = Date.now();
  let anything = false;
  for (const one of alarms.filter((alarm) => alarm.state === "unacknowledged" && alarm.raised_s)) {
    const key = `${one.device ?? ""}/${one.id}`, [raised, at] = known[key] ?? [0, 0];
    if (raised === one.raised_s || now - at < EACH_MS) continue;
    known[key] = [one.raised_s, now];
    anything = true;
    if (notifies()) new Notification(`${one.level}: ${one.title}`, { body: `${one.device || "bench"}: ${one.text}`, tag: key, silent: true });
  }
  if (!anything) return;
  const newest = Object.entries(known).sort(([, a], [, b]) => b[1] - a[1]).slice(0, KEPT);
  keep(TOLD, JSON.stringify(Object.fromEntries(newest)));
  if (sounds()) beep();
}
