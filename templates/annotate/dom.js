// Elements and texts; everything outside becomes text, never markup.
export const id = (name) => document.getElementById(name);

// An element with attributes (on… are listeners, true is an empty attribute, false none) and children.
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== false && value !== null) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

export const clock = (time) => (time ? new Date(time).toLocaleTimeString("en-GB") : "");

// "track 3 · frames 39 to 149", as far as it is known.
export function whereabouts(hazard) {
  const { track_id: track, first_frame: first, last_frame: last } = hazard;
  const parts = [track === null ? "without a track" : `track ${track}`];
  if (first !== null && last !== null) parts.push(`frames ${first} to ${last}`);
  else if (first !== null) parts.push(`from frame ${first}`);
  else if (last !== null) parts.push(`to frame ${last}`);
  return parts.join(" · ");
}

// What someone wrote of a video, to read; `extra` gives more for a hazard.
export function written(state, extra = () => []) {
  if (state.no_hazard) return [make("p", {}, "No hazard.")];
  if (!state.hazards.length) return [make("p", { class: "sub" }, "Nothing yet.")];
  return state.hazards.map((hazard) =>
    make(
      "div",
      { class: "written" },
      make("p", { class: "label" }, hazard.label || "no label"),
      make("p", {}, hazard.description || "no sentence"),
      make("p", { class: "sub" }, whereabouts(hazard)),
      ...extra(hazard),
    ),
  );
}

// Whether a key pressed there is text, or moves within a field.
export function isTyping(target) {
  if (!(target instanceof Element)) return false;
  return Boolean(target.closest("textarea, select, input:not([type='checkbox'], [type='range'])"));
}
