// A merge: what each annotator wrote, side by side, with buttons to take one hazard or all.
import { clock, id, make, written } from "./dom.js";

// The revisions that whoever merges now looks at.
export const seenOf = (others) => Object.fromEntries(others.map((other) => [other.author, other.revision]));

export function showOthers(others, takeAll, takeOne) {
  const cards = others.map((other, place) => {
    const one = (hazard) => {
      const name = `Take ${hazard.label || "this hazard"} of ${other.author}`;
      const act = { type: "button", class: "quiet", "aria-label": name, onclick: () => takeOne(hazard) };
      return other.hazards.length > 1 ? [make("button", act, "Take this")] : [];
    };
    const key = place < 9 ? make("kbd", {}, `⇧${place + 1}`) : "";
    const all = make("button", { type: "button", onclick: () => takeAll(other) }, "Take all ", key);
    all.append(make("span", { class: "sr" }, ` of ${other.author}`));
    const when = other.saved_at ? `${other.finished ? "" : "unfinished · "}${clock(other.saved_at)}` : "";
    return make(
      "section",
      { class: "other", "aria-label": other.author },
      make("h3", {}, `${other.author} `, make("span", { class: "sub" }, when)),
      ...written(other, one),
      make("p", { class: "buttons" }, all),
    );
  });
  if (!cards.length) cards.push(make("p", { class: "note" }, "Nobody wrote anything of this video yet."));
  id("others").replaceChildren(...cards);
}
