// The filters: a group of boxes for each facet; long ones show their most frequent values and are searched.
(function () {
  "use strict";
  const { TEXT, whole, add } = window.COOOLER_FAILURE_WORDS;
  const FIRST = 8;
  const PAGE = 40;
  let facets = []; // {name, values: [[key, words]], size, column, chosen, group, rows, shown, find}
  let changed = () => {};

  function start(made, then) {
    facets = made;
    changed = then;
    const place = document.getElementById("fail-facets");
    facets.forEach((facet) => {
      facet.group = add(place, "fieldset", "", "fail-facet");
      add(facet.group, "legend", TEXT.facets[facet.name]);
      facet.rows = new Map();
      facet.totals = new Uint32Array(facet.size);
      facet.shown = FIRST;
      facet.long = facet.size > FIRST + 4;
      if (facet.long) {
        facet.find = add(facet.group, "input", "", "fail-find");
        facet.find.type = "search";
        facet.find.autocomplete = "off";
        facet.find.placeholder = TEXT.find[facet.name];
        facet.find.setAttribute("aria-label", TEXT.find[facet.name]);
        facet.find.addEventListener("input", () => {
          facet.shown = FIRST;
          arrange(facet);
        });
      }
      facet.list = add(facet.group, "div", "", "fail-values");
      facet.none = add(facet.group, "p", TEXT.findNone, "sub");
      facet.more = add(facet.group, "button", "", "quiet fail-more");
      facet.more.type = "button";
      facet.more.addEventListener("click", () => {
        facet.shown += PAGE;
        arrange(facet);
      });
    });
  }

  function row(facet, value) {
    if (!facet.rows.has(value)) {
      const label = document.createElement("label");
      label.className = "check fail-value";
      const box = add(label, "input");
      box.type = "checkbox";
      box.autocomplete = "off";
      box.name = facet.name;
      [box.value] = facet.values[value];
      box.addEventListener("change", () => changed(facet, value, box.checked));
      add(label, "span", facet.values[value][1], "fail-name");
      const count = add(label, "span", "", "fail-count num");
      facet.rows.set(value, { label, box, count });
    }
    return facet.rows.get(value);
  }

  // The values in sight: all of a short facet; of a long one the chosen and the most frequent.
  function arrange(facet) {
    let values;
    let left = 0;
    if (facet.long) {
      const wanted = facet.find.value.trim().toLowerCase();
      const fits = (value) => facet.values[value][1].toLowerCase().includes(wanted);
      const all = wanted ? facet.sorted.filter(fits) : facet.sorted;
      const first = all.slice(0, facet.shown);
      values = [...first, ...Array.from(facet.chosen).filter((value) => !first.includes(value))];
      left = all.length - first.length;
    } else {
      values = Array.from(facet.values, (_, value) => value);
      values = values.filter((value) => facet.totals[value] || facet.chosen.has(value));
    }
    const rows = values.map((value) => row(facet, value).label);
    const same = facet.list.children.length === rows.length
      && rows.every((label, n) => facet.list.children[n] === label);
    if (!same) {
      const had = facet.list.contains(document.activeElement) ? document.activeElement : null;
      facet.list.replaceChildren(...rows);
      if (had) (had.isConnected ? had : facet.find).focus({ preventScroll: true });
    }
    facet.none.hidden = rows.length > 0;
    facet.more.hidden = left <= 0;
    facet.more.textContent = TEXT.more(Math.min(left, PAGE));
    values.forEach((value) => showRow(facet, value));
  }

  function showRow(facet, value) {
    const { label, box, count } = row(facet, value);
    const number = facet.counts[value];
    box.checked = facet.chosen.has(value);
    count.textContent = whole(number);
    label.classList.toggle("fail-zero", !number);
  }

  // `totals` are the counts without any filter, and only given when they changed; they decide the order.
  function show(counts, totals) {
    facets.forEach((facet, number) => {
      facet.counts = counts[number];
      if (totals) {
        facet.totals = totals[number];
        facet.sorted = facet.values.map((_, value) => value).filter((value) => facet.totals[value]);
        if (facet.long) facet.sorted.sort((a, b) => facet.totals[b] - facet.totals[a] || a - b);
      }
      arrange(facet);
    });
    chips();
  }

  // What is chosen, as buttons that take it away.
  function chips() {
    const place = document.getElementById("fail-chosen");
    const made = facets.flatMap((facet) => Array.from(facet.chosen).sort((a, b) => a - b).map((value) => {
      const item = document.createElement("li");
      const button = add(item, "button", "", "quiet fail-chip");
      button.type = "button";
      const words = TEXT.chosen(TEXT.facets[facet.name], facet.values[value][1]);
      button.setAttribute("aria-label", TEXT.remove(words));
      add(button, "span", words);
      add(button, "span", "×");
      button.addEventListener("click", () => {
        changed(facet, value, false);
        const clear = document.getElementById("fail-clear");
        (clear.hidden ? document.getElementById("search") : clear).focus({ preventScroll: true });
      });
      return item;
    }));
    place.replaceChildren(...made);
    document.getElementById("fail-filters-title").textContent = TEXT.filters(made.length);
  }

  function focus() {
    const first = document.querySelector("#fail-facets input");
    if (first) first.focus();
  }

  window.COOOLER_FAILURE_FACETS = { start, show, focus };
})();
