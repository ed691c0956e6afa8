// The list: which videos are shown, and the keys to the next ones.
import { id, isTyping } from "./dom.js";

const rows = Array.from(document.querySelectorAll("table.videos tbody tr"));
const show = id("show");
const search = id("search");
const MEMORY = "coooler-annotate-show";

function filter() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0;
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    const fits = words.every((word) => text.includes(word));
    row.hidden = !fits || (show.value !== "" && !row.dataset.tags.split(" ").includes(show.value));
    shown += row.hidden ? 0 : 1;
  }
  id("count").textContent = `${shown} of ${rows.length}`;
  id("none").hidden = shown > 0;
}

try {
  show.value = sessionStorage.getItem(MEMORY) || "";
  if (show.selectedIndex < 0) show.value = "";
} catch (error) {
  show.value = "";
}
search.addEventListener("input", filter);
show.addEventListener("change", () => {
  try {
    sessionStorage.setItem(MEMORY, show.value);
  } catch (error) {
    // Not remembered then.
  }
  filter();
});
filter();

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || id("keys").open || isTyping(event.target)) return;
  const link = { n: id("next-todo"), m: id("next-merge") }[event.key];
  if (link) link.click();
  if (event.key === "/") {
    event.preventDefault();
    search.focus();
  }
});
