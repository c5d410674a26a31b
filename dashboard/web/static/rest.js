// Calls to /api with the session's token, and short messages at the edge of the page.
const csrf = document.querySelector("meta[name=csrf]")?.content ?? "";

export async function call(path, body) {
  const options = body === undefined ? {} : {
    method: "POST",
    headers: { "content-type": "application/json", "x-csrf-token": csrf },
    body: JSON.stringify(body),
  };
  return answered(await asked(`/api/${path}`, options));
}

// Bytes as they are, a piece of a file.
export async function send(path, blob) {
  const headers = { "content-type": "application/octet-stream", "x-csrf-token": csrf };
  return answered(await asked(`/api/${path}`, { method: "POST", headers, body: blob }));
}

// A browser's own word for a server that is gone tells nobody what to do.
const asked = (path, options) => fetch(path, options).catch(() => { throw new Error("The dashboard does not answer: does it still run, and is the network there?"); });

async function answered(answer) {
  if (answer.status === 401) location.assign(`/login?${new URLSearchParams({ next: location.pathname + location.search })}`);
  const value = await answer.json();
  const faults = (value?.faults ?? []).map((fault) => `${fault.at.slice(1).join(".")}: ${fault.what}`).join("; ");
  if (!answer.ok) throw new Error(faults || (value.error ?? `the dashboard answered ${answer.status}`));
  return value;
}

// Until a job has ended; `line` says how far it is.
export async function ended(job, line) {
  while (job.state === "waiting" || job.state === "running") {
    const size = job.bytes ? `, ${(job.bytes / 1e6).toFixed(1)} MB` : "";
    line.textContent = `${job.state}, ${job.seconds.toFixed(0)} s${size}`;
    await new Promise((resolve) => setTimeout(resolve, 500));
    job = await call(`jobs/${job.number}`);
  }
  line.textContent = "";
  if (job.state === "failed") throw new Error(job.message || `${job.kind} failed`);
  return job;
}

export function toast(text, kind = "fault") {
  const note = document.createElement("p");
  note.className = kind;
  note.textContent = text;
  document.getElementById("toasts").append(note);
  setTimeout(() => note.remove(), 8000);
}
