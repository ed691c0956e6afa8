// What every page has: theme, list of keys, and what a page that crashed left unsaved.
import { id, isTyping, make } from "./dom.js";
import { dropDraft, loadState, sendDraft, sendLeftovers } from "./store.js";

const root = document.documentElement;
const THEMES = ["system", "light", "dark"];
const NAMES = { system: "System", light: "Light", dark: "Dark" };
const keys = id("keys");

const theme = () => root.dataset.theme || "system";

function nextTheme() {
  const next = THEMES[(THEMES.indexOf(theme()) + 1) % THEMES.length];
  if (next === "system") delete root.dataset.theme;
  else root.dataset.theme = next;
  try {
    localStorage.setItem("coooler-theme", next);
  } catch (error) {
    // Not remembered then.
  }
  id("theme-name").textContent = NAMES[next];
}

function toggleKeys() {
  if (keys.open) keys.close();
  else {
    keys.showModal();
    keys.scrollTop = 0; // the button that has the focus is at its end
  }
}

id("theme-name").textContent = NAMES[theme()];
id("theme").addEventListener("click", nextTheme);
id("keys-open").addEventListener("click", toggleKeys);
keys.addEventListener("click", (event) => {
  if (event.target === keys) keys.close();
});

document.addEventListener("keydown", (event) => {
  if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
  if (event.key === "?") {
    event.preventDefault();
    toggleKeys();
  } else if (event.key === "t" && !keys.open) nextTheme();
});

const addressOf = ({ video, merge }) => `/${merge ? "merge" : "video"}/${encodeURIComponent(video)}`;

// A draft that was made from what is no longer the newest: it may still replace that, or go.
async function insist(item) {
  const { draft } = item;
  const { status, data } = await loadState(draft.video, draft.merge, draft.author);
  if (status !== 200) return;
  const sent = await sendDraft({ ...draft, save: { ...draft.save, base: data.revision } });
  if (sent.status !== 200) return;
  dropDraft(item.name);
  location.reload();
}

function rest(item) {
  const { draft, status, error, name } = item;
  const line = make("p", {}, "Not saved yet: what was written of ", make("a", { href: addressOf(draft) }, draft.video));
  if (draft.author !== document.body.dataset.author) line.append(` by ${draft.author}`);
  const drop = () => {
    dropDraft(name);
    line.remove();
  };
  if (status === 409) {
    line.append(". It was saved from another window since. ");
    line.append(make("button", { type: "button", onclick: () => insist(item) }, "Keep mine"), " ");
    line.append(make("button", { type: "button", onclick: drop }, "Take what is saved"));
  } else if (status === 0) line.append(": the server does not answer. It is kept in this browser.");
  else {
    line.append(`: ${error} `, make("button", { type: "button", onclick: drop }, "Throw it away"));
  }
  return line;
}

// Done before a page reads what is saved, so that it reads that too.
async function sendOlder() {
  const { taken, left } = await sendLeftovers();
  const place = id("leftovers");
  if (taken) place.append(make("p", {}, "Saved what a page that was closed had left unsaved."));
  place.append(...left.map(rest));
  place.classList.toggle("problem", left.length > 0);
  place.hidden = !taken && !left.length;
}

export const older = sendOlder();
