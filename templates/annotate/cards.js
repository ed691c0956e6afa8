// The cards of the hazards: fields to write in. Typing changes the state, never the cards, so the caret stays.
import { id, make } from "./dom.js";

const FRAMES = [
  ["first_frame", "First frame", "["],
  ["last_frame", "Last frame", "]"],
];

const cardOf = (hazardId) =>
  Array.from(id("hazards").children).find((card) => card.dataset.hazard === hazardId) || null;

const fieldOf = (hazardId, name) => cardOf(hazardId).querySelector(`[name="${name}"]`);

function frameOf(input) {
  return input.value === "" || !input.checkValidity() ? null : Number(input.value);
}

function frameField(hazard, [name, title, key], last, on) {
  const field = `${name}-${hazard.hazard_id}`;
  const value = hazard[name] === null ? "" : String(hazard[name]);
  const input = make("input", {
    id: field, name, type: "number", min: "0", max: String(last), step: "1", value,
    oninput: (event) => on.change(hazard.hazard_id, name, frameOf(event.target)),
  });
  const now = make(
    "button",
    { type: "button", class: "now", "aria-label": `${title}: now`, onclick: () => on.now(hazard.hazard_id, name) },
    "Now ",
    make("kbd", {}, key),
  );
  return make("div", {}, make("label", { for: field }, title), make("div", { class: "frame" }, input, now));
}

function card(hazard, place, last, on) {
  const name = (field) => `${field}-${hazard.hazard_id}`;
  const change = (field) => (event) => on.change(hazard.hazard_id, field, event.target.value);
  const title = make(
    "h3",
    { id: name("title") },
    `Hazard ${place + 1} `,
    make("span", { class: "sub" }, hazard.track_id === null ? "without a track" : `track ${hazard.track_id}`),
  );
  return make(
    "section",
    {
      class: "hazard-card", "data-hazard": hazard.hazard_id, "aria-labelledby": name("title"),
      onfocusin: () => on.enter(hazard.hazard_id),
    },
    title,
    make("label", { for: name("label") }, "Label"),
    make("input", {
      id: name("label"), name: "label", maxlength: "200", autocomplete: "off", value: hazard.label,
      oninput: change("label"),
    }),
    make("label", { for: name("description") }, "What happens, in one sentence"),
    make(
      "textarea",
      { id: name("description"), name: "description", rows: "3", maxlength: "2000", oninput: change("description") },
      hazard.description,
    ),
    make("div", { class: "frames" }, ...FRAMES.map((field) => frameField(hazard, field, last, on))),
    make("button", { type: "button", class: "quiet", onclick: () => on.remove(hazard.hazard_id) }, "Remove"),
  );
}

// `on`: change(id, field, value), now(id, field), remove(id), enter(id).
export function showCards(hazards, last, on) {
  id("hazards").replaceChildren(...hazards.map((hazard, place) => card(hazard, place, last, on)));
}

export function showActive(hazardId) {
  for (const item of id("hazards").children) item.classList.toggle("active", item.dataset.hazard === hazardId);
}

export function setField(hazardId, name, value) {
  fieldOf(hazardId, name).value = value === null ? "" : String(value);
}

// The first field of the card that is still empty, else its label.
export function focusCard(hazardId) {
  const fields = ["label", "description"].map((name) => fieldOf(hazardId, name));
  (fields.find((field) => field.value === "") || fields[0]).focus();
}

// Where Enter leads from a field: label, sentence, out. Gives false when it is no field of a card.
export function enterFrom(field, leave) {
  const item = field.closest(".hazard-card");
  if (!item) return false;
  if (field.name === "label") fieldOf(item.dataset.hazard, "description").focus();
  else leave();
  return true;
}
