// Saved, or why not: the text beside the title, and the choice between two states of one video.
import { clock, id, written } from "./dom.js";

export function say(text, kind = "") {
  id("saved").textContent = text;
  id("saved").className = kind;
}

export function sayProblem(text) {
  id("problem").textContent = text;
  id("problem").hidden = !text;
}

export function saySaved(savedAt) {
  say(savedAt ? `Saved ${clock(savedAt)}` : "Nothing saved yet", savedAt ? "good" : "");
}

const REFUSED = "Not saved; what you wrote is kept in this browser. ";

// What the outbox tells, except a conflict.
export function showSaving(kind, data) {
  if (kind === "waiting") {
    if (!id("saved").classList.contains("bad")) say("Saving …");
    return;
  }
  if (kind === "saved") saySaved(data.saved_at);
  else if (kind === "refused") say("Not saved", "bad");
  else if (data.status === 401 || data.status === 403) {
    say("Not saved: open the address that the server printed when it started, then come back; trying again", "bad");
  } else if (data.status) say(`Not saved: ${data.error} Trying again`, "bad");
  else say("Not saved: the server does not answer; trying again", "bad");
  sayProblem(kind === "refused" ? REFUSED + data.error : "");
}

export function showConflict(here, current) {
  say("Not saved: choose which one counts", "bad");
  id("conflict-here").replaceChildren(...written(here));
  id("conflict-saved").replaceChildren(...written(current));
  id("conflict-when").textContent = current.saved_at ? ` · ${clock(current.saved_at)}` : "";
  id("conflict").hidden = false;
  id("keep-mine").focus();
}

export function hideConflict() {
  id("conflict").hidden = true;
}

// What is still missing, or that it is finished.
export function showProblems(problems, isFinished) {
  const lines = problems.map((text) => {
    const line = document.createElement("li");
    line.textContent = text;
    return line;
  });
  id("problems").replaceChildren(...lines);
  id("problems").hidden = lines.length === 0;
  id("finished").hidden = !isFinished;
}
