// Calls to /api with the session's token, and short messages at the edge of the page.
const csrf = document.querySelector("meta[name=csrf]")?.content ?? "";

export async function call(path, body) {
  const options = body === undefined ? {} : {
    method: "POST",
    headers: { "content-type": "application/json", "x-csrf-token": csrf },
    body: JSON.stringify(body),
  };
  const answer = await fetch(`/api/${path}`, options);
  if (answer.status === 401) location.assign("/login");
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.error ?? `the dashboard answered ${answer.status}`);
  return value;
}

export function toast(text, kind = "fault") {
  const note = document.createElement("p");
  note.className = kind;
  note.textContent = text;
  document.getElementById("toasts").append(note);
  setTimeout(() => note.remove(), 8000);
}
