// The editor of one video: what is said of it, from keys, buttons and fields to the outbox.
import { enterFrom, focusCard, setField, showActive, showCards } from "./cards.js";
import { id, isTyping, make, written } from "./dom.js";
import { seenOf, showOthers } from "./others.js";
import { Player } from "./player.js";
import { hideConflict, say, sayProblem, saySaved, showConflict, showProblems, showSaving } from "./saving.js";
import { older } from "./shell.js";
import { EMPTY, added, changed, copied, isSaid, only, without } from "./state.js";
import { Outbox, loadClip, loadState } from "./store.js";

const { video, merge } = id("editor").dataset;
const player = new Player((track) => toggleTrack(track));
const outbox = new Outbox(video, Boolean(merge), tell);
let state = EMPTY;
let others = [];
let active = null; // hazard_id
let undo = null; // the state before a hazard was removed
let imported = null; // the truth that the work began with
let current = null; // what is saved, in a conflict
let isReady = false;

const hazardOf = (hazardId) => state.hazards.find((hazard) => hazard.hazard_id === hazardId);
const hazardTracks = () => new Set(state.hazards.map((hazard) => hazard.track_id).filter((track) => track !== null));

// All that the state decides, but the texts in the fields.
function showAround() {
  const picked = hazardTracks();
  player.mark(picked);
  for (const chip of id("tracks").children) chip.setAttribute("aria-pressed", String(picked.has(chip.dataset.track)));
  id("no-hazard").setAttribute("aria-pressed", String(state.no_hazard));
  id("removed").hidden = undo === null;
  id("imported").hidden = Boolean(merge) || !imported || isSaid(state) || outbox.base > 0;
  showActive(active);
}

function show() {
  if (!hazardOf(active)) active = state.hazards.length ? state.hazards[state.hazards.length - 1].hazard_id : null;
  showCards(state.hazards, Math.max(0, player.clip.frame_count - 1), { change, now, remove, enter });
  showAround();
}

const send = () => outbox.change(only(state), seenOf(others));

function put(next, removed = "") {
  if (!isReady) return;
  undo = removed ? state : null;
  id("removed").firstElementChild.textContent = removed;
  state = next;
  show();
  send();
}

function change(hazardId, field, value) {
  undo = null;
  state = changed(state, hazardId, field, value);
  showAround();
  send();
}

function enter(hazardId) {
  active = hazardId;
  showActive(active);
}

function now(hazardId, field) {
  setField(hazardId, field, player.frame);
  change(hazardId, field, player.frame);
}

function remove(hazardId) {
  put(without(state, hazardId), "Removed the hazard.");
  leaveField();
}

function add(track) {
  put(added(state, track));
  if (!isReady) return;
  active = state.hazards[state.hazards.length - 1].hazard_id;
  if (track && (player.frame < track.first_frame || player.frame > track.last_frame)) player.seek(track.first_frame);
  showAround();
  focusCard(active);
}

function toggleTrack(trackId) {
  const track = player.clip.tracks.find((one) => one.track_id === trackId);
  const hazard = state.hazards.find((one) => one.track_id === trackId);
  if (hazard) remove(hazard.hazard_id);
  else if (track) add(track);
}

function sayNone() {
  if (state.no_hazard) put({ hazards: [], no_hazard: false });
  else put({ hazards: [], no_hazard: true }, state.hazards.length ? "Removed what was said before." : "");
}

function takeBack() {
  if (undo) put(undo);
}

function takeAll(other) {
  if (other) put(only(other), isSaid(state) ? "Replaced what was said before." : "");
}

function leaveField() {
  id("stage").focus({ preventScroll: true });
}

function tell(kind, data) {
  if (kind === "conflict") {
    current = data;
    takeOthers(data);
    showConflict(state, current);
    return;
  }
  showSaving(kind, data);
  if (kind === "saved") showProblems(data.problems, data.finished);
}

function takeOthers(answer) {
  if (!merge) return;
  others = answer.others;
  showOthers(others, takeAll, (hazard) => put(copied(state, hazard)));
}

function settle() {
  outbox.settleOn(current.revision);
  hideConflict();
}

id("keep-mine").addEventListener("click", () => {
  settle();
  send();
  leaveField();
});
id("take-saved").addEventListener("click", () => {
  outbox.drop();
  settle();
  read(current);
  leaveField();
});

function read(answer) {
  state = only(answer);
  undo = null;
  imported = answer.imported || null;
  if (imported) id("imported-text").replaceChildren(...written(imported));
  outbox.settleOn(answer.revision);
  takeOthers(answer);
  show();
  saySaved(answer.saved_at);
  showProblems(isSaid(state) ? answer.problems : [], isSaid(state) && answer.problems.length === 0);
}

// Goes there once all is saved; stays, and says so, when that cannot be.
async function go(link) {
  if (!link) return;
  if (await outbox.settled()) location.assign(link.href);
}

function showTracks(tracks) {
  const about = ({ kind, first_frame: first, last_frame: last }) => ` ${kind} · frames ${first} to ${last}`;
  const chip = (track, place) =>
    make(
      "button",
      {
        type: "button", class: "track", "data-track": track.track_id, "aria-pressed": "false",
        onclick: () => toggleTrack(track.track_id),
      },
      ...(place < 9 ? [make("kbd", {}, String(place + 1)), " "] : []),
      make("b", {}, `track ${track.track_id}`),
      make("span", { class: "sub" }, about(track)),
    );
  id("tracks").replaceChildren(...tracks.map(chip));
}

function nextHazard() {
  const place = state.hazards.findIndex((hazard) => hazard.hazard_id === active);
  if (state.hazards.length) enter(state.hazards[(place + 1) % state.hazards.length].hazard_id);
}

const ofActive = (act) => () => active && act(active);
const KEYS = {
  " ": () => player.toggle(),
  "-": () => player.shift(-1),
  "+": () => player.shift(1),
  "=": () => player.shift(1),
  b: () => id("show-boxes").click(),
  g: () => add(null),
  e: ofActive(focusCard),
  h: nextHazard,
  d: ofActive(remove),
  u: takeBack,
  "[": ofActive((hazardId) => now(hazardId, "first_frame")),
  "]": ofActive((hazardId) => now(hazardId, "last_frame")),
  j: () => go(id("after")),
  k: () => go(id("before")),
  n: () => go(id("todo")),
};

function digit(event) {
  const found = /^(?:Digit|Numpad)(\d)$/.exec(event.code);
  if (!found) return false;
  const number = Number(found[1]);
  if (event.shiftKey) {
    if (!merge || !event.code.startsWith("Digit") || !others[number - 1]) return false;
    takeAll(others[number - 1]);
  } else if (number === 0) sayNone();
  else if (player.clip.tracks[number - 1]) toggleTrack(player.clip.tracks[number - 1].track_id);
  return true;
}

function whileTyping(event) {
  if (event.key === "Escape") leaveField();
  else if (event.key !== "Enter" || event.isComposing) return false;
  else if (event.ctrlKey || event.metaKey) go(id("todo"));
  else return enterFrom(event.target, leaveField);
  return true;
}

function arrow(event) {
  const sign = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!sign || (event.target.type === "range" && !event.shiftKey)) return false;
  if (event.shiftKey) player.stepKeyframe(sign);
  else player.step(sign);
  return true;
}

function pressed(event) {
  if (isTyping(event.target)) return whileTyping(event);
  const isAltGraph = event.getModifierState("AltGraph"); // brackets of many keyboards
  if (!isAltGraph && (event.ctrlKey || event.metaKey || event.altKey)) return false;
  if (event.key === " " && event.target.closest("button, a, [type='checkbox']")) return false;
  if (!isAltGraph && (digit(event) || arrow(event))) return true;
  const act = event.shiftKey && event.key !== "+" ? null : KEYS[event.key];
  if (act) act();
  return Boolean(act);
}

document.addEventListener("keydown", (event) => {
  if (!isReady || id("keys").open || event.defaultPrevented || !(event.target instanceof Element)) return;
  if (pressed(event)) event.preventDefault();
});
id("no-hazard").addEventListener("click", sayNone);
id("general").addEventListener("click", () => add(null));
id("undo").addEventListener("click", () => {
  takeBack();
  leaveField();
});
id("begin-imported").addEventListener("click", () => {
  takeAll(imported);
  leaveField();
});
if (id("still")) {
  id("still").addEventListener("click", () => {
    send();
    id("still").parentNode.remove();
  });
}

// Reads until the server answers.
async function begin() {
  await older;
  const [clip, answer] = await Promise.all([loadClip(video), loadState(video, Boolean(merge))]);
  if (answer.status !== 200) {
    say(answer.status ? answer.data.error : "The server does not answer; trying again", "bad");
    setTimeout(begin, 2000);
    return;
  }
  if (clip.status === 200) {
    player.load(clip.data);
    showTracks(clip.data.tracks);
  }
  sayProblem(clip.status === 200 ? clip.data.problem : clip.data.error);
  isReady = true;
  read(answer.data);
  leaveField();
  id("editor").dataset.ready = "1";
}

begin();
