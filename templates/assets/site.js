// Theme, keyboard list, table sorting, search. Every page reads without any of it.
(function () {
  "use strict";
  var root = document.documentElement;
  var THEMES = ["system", "light", "dark"];
  var _ = window.COOOLER_I18N._;
  var plural = window.COOOLER_I18N.plural;
  var whole = window.COOOLER_I18N.whole;
  var NAMES = { system: _("System"), light: _("Light"), dark: _("Dark") };

  function theme() {
    return root.dataset.theme || "system";
  }

  function showTheme() {
    document.querySelectorAll("[data-theme-name]").forEach(function (place) {
      place.textContent = NAMES[theme()];
    });
  }

  function nextTheme() {
    var next = THEMES[(THEMES.indexOf(theme()) + 1) % THEMES.length];
    if (next === "system") delete root.dataset.theme;
    else root.dataset.theme = next;
    try {
      localStorage.setItem("coooler-theme", next);
    } catch (error) {
      // Not remembered then.
    }
    showTheme();
    document.dispatchEvent(new CustomEvent("coooler:theme"));
  }

  showTheme();
  document.querySelectorAll("[data-theme-button]").forEach(function (button) {
    button.addEventListener("click", nextTheme);
  });

  var keys = document.getElementById("keys");
  function toggleKeys() {
    if (keys.open) keys.close();
    else keys.showModal();
  }
  var opener = document.getElementById("keys-open");
  if (opener) opener.addEventListener("click", toggleKeys);
  keys.addEventListener("click", function (event) {
    if (event.target === keys) keys.close();
  });

  function typing(target) {
    return target instanceof Element && target.closest("input, select, textarea, [contenteditable]");
  }

  document.addEventListener("keydown", function (event) {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof Element && typing(event.target) && event.target.type !== "checkbox") return;
    if (event.key === "?") {
      event.preventDefault();
      toggleKeys();
      return;
    }
    if (keys.open) return;
    if (event.key === "t") nextTheme();
    if (event.key === "/") {
      var search = document.getElementById("search");
      if (search) {
        event.preventDefault();
        search.focus();
      }
    }
  });

  // Sorting: a button in each heading; numbers come from data-value, so that text stays text.
  function valueOf(row, column, kind) {
    var cell = row.cells[column];
    if (kind === "number") return Number(cell.dataset.value);
    return cell.textContent.trim().toLowerCase();
  }

  function sortBy(table, head, column) {
    var kind = head.dataset.sort;
    var now = head.getAttribute("aria-sort");
    var first = head.dataset.first === "desc" ? "descending" : "ascending";
    var other = first === "descending" ? "ascending" : "descending";
    var next = now === first ? other : first;
    var sign = next === "ascending" ? 1 : -1;
    var body = table.tBodies[0];
    var rows = Array.from(body.rows).map(function (row, place) {
      return { row: row, place: place, value: valueOf(row, column, kind) };
    });
    rows.sort(function (a, b) {
      if (a.value < b.value) return -sign;
      if (a.value > b.value) return sign;
      return a.place - b.place;
    });
    rows.forEach(function (item) {
      body.appendChild(item.row);
    });
    Array.from(head.parentNode.cells).forEach(function (cell) {
      cell.removeAttribute("aria-sort");
    });
    head.setAttribute("aria-sort", next);
  }

  document.querySelectorAll("table[data-sortable]").forEach(function (table) {
    Array.from(table.tHead.rows[0].cells).forEach(function (head, column) {
      if (!head.dataset.sort) return;
      var button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      while (head.firstChild) button.appendChild(head.firstChild);
      head.appendChild(button);
      button.addEventListener("click", function () {
        sortBy(table, head, column);
      });
    });
  });

  // Search and the state filter hide items; the count says how many are left.
  var select = document.querySelector("[data-state-filter]");
  var search = document.querySelector("[data-filters]");
  function filter() {
    var items = document.querySelectorAll((search || select).dataset[search ? "filters" : "stateFilter"]);
    var words = search ? search.value.toLowerCase().split(/\s+/).filter(Boolean) : [];
    var state = select ? select.value : "";
    var shown = 0;
    items.forEach(function (item) {
      var key = item.dataset.key || item.textContent.toLowerCase();
      var fits = words.every(function (word) {
        return key.includes(word);
      });
      if (state && item.dataset.state !== state) fits = false;
      item.hidden = !fits;
      if (fits) shown += 1;
    });
    var section = (search || select).closest("section, main");
    var none = section.querySelector(".none");
    if (none) none.hidden = shown > 0;
    var count = section.querySelector("[data-count]");
    var all = items.length;
    if (count) count.textContent = shown === all ? plural(all, "{n} video", "{n} videos")
      : plural(all, "{shown} of {n} video", "{shown} of {n} videos", { shown: whole(shown) });
  }
  if (search) search.addEventListener("input", filter);
  if (select) select.addEventListener("change", filter);
  if (search || select) filter();
})();
