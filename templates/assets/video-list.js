// The lists of videos: a search of all of them, kept in the address, a page of what it finds at a time.
(function () {
  "use strict";
  const { _, plural, whole } = window.COOOLER_I18N;
  const data = window.COOOLER_VIDEO_LIST;
  const card = window.COOOLER_VIDEO_CARD;
  const KEY = "coooler-walk";
  const SHOWN = 60; // cards at a time
  const WAIT_MS = 200; // browsers refuse addresses that change too often
  const part = (id) => document.getElementById(id);
  const tools = part("list-tools");
  const search = part("search");
  const state = part("list-state");
  const label = part("list-label");
  const given = new URLSearchParams(location.search);
  const usual = tools.dataset.state;
  let wanted = given.get("label") || ""; // until the labels are here
  let page = Math.max(1, parseInt(given.get("page"), 10) || 1);
  let found = [];
  let ready = false;
  let failed = false;

  const words = () => search.value.trim().slice(0, 200);
  const ofState = () => (state ? state.value : "");
  const ofLabel = () => (label && ready ? label.value : wanted);
  const asks = () => Boolean(words() || ofLabel() || ofState() !== usual);

  function address(number = page) {
    const query = new URLSearchParams();
    if (asks()) {
      if (ofState() !== usual) query.set("show", ofState() || "all");
      if (ofLabel()) query.set("label", ofLabel());
      if (words()) query.set("q", words());
      if (number > 1) query.set("page", number);
    }
    const text = query.toString();
    return location.href.split(/[?#]/)[0] + (text ? `?${text}` : "");
  }

  let timer = 0;
  function remember() {
    clearTimeout(timer);
    timer = setTimeout(() => {
      try {
        if (asks() || location.search) history.replaceState(null, "", address());
      } catch (error) {
        // The search is not in the address then.
      }
    }, WAIT_MS);
  }

  function title() {
    const parts = [];
    if (ofState()) parts.push(state.selectedOptions[0].textContent);
    if (ofLabel()) parts.push(ofLabel());
    if (words()) parts.push(words());
    return parts.join(", ");
  }

  function fillLabels() {
    if (!label) return;
    data.index().labels.slice(1).forEach((text) => label.append(new Option(text, text)));
    label.value = data.index().labels.includes(wanted) ? wanted : "";
    part("list-label-choice").hidden = data.index().labels.length < 2;
    wanted = "";
  }

  async function begin() {
    if (ready) return;
    try {
      await data.begin((done, all) => {
        if (asks()) part("list-count").textContent = _("Loading {done} of {all}", { done, all });
      });
    } catch (error) {
      failed = true;
      part("list-problem").textContent = _("The data of the videos could not be loaded.");
      part("list-problem").hidden = false;
      part("list-count").textContent = "";
      return;
    }
    if (ready) return;
    fillLabels();
    ready = true;
    failed = false;
    part("list-problem").hidden = true;
    show();
  }

  function show() {
    const searching = asks();
    part("list-clear").hidden = !searching;
    if (!ready || !searching) {
      part("list-found").hidden = true;
      part("list-plain").hidden = false;
      if (!searching) part("list-count").textContent = "";
      else if (!failed) begin();
      return;
    }
    const { labels, states, videos } = data.index();
    const code = label ? Math.max(0, labels.indexOf(label.value)) : 0;
    const terms = words().toLowerCase().split(/\s+/).filter(Boolean);
    found = data.find(terms, states.indexOf(ofState()), code);
    part("list-count").textContent = plural(videos, "{shown} of {n} video", "{shown} of {n} videos", {
      shown: whole(found.length),
    });
    part("list-none").hidden = found.length > 0;
    page = Math.min(page, Math.max(1, Math.ceil(found.length / SHOWN)));
    const cards = found.slice((page - 1) * SHOWN, page * SHOWN).map((place) => card(data.row(place)));
    part("list-cards").replaceChildren(...cards);
    pager();
    part("list-plain").hidden = true;
    part("list-found").hidden = false;
  }

  function pager() {
    const pages = Math.ceil(found.length / SHOWN);
    const list = part("list-pager").firstElementChild;
    part("list-pager").hidden = pages < 2;
    const item = (text, number, kind) => {
      const made = document.createElement("li");
      const inside = document.createElement(number ? "a" : "span");
      inside.textContent = text;
      inside.className = number ? "" : kind;
      if (number) {
        inside.href = address(number);
        inside.dataset.page = number;
        if (number === page && !kind) inside.setAttribute("aria-current", "page");
        if (kind) inside.rel = kind;
      }
      made.append(inside);
      return made;
    };
    const near = [1, page - 2, page - 1, page, page + 1, page + 2, pages];
    const shown = Array.from(new Set(near.filter((n) => n >= 1 && n <= pages))).sort((a, b) => a - b);
    const items = [item(_("Previous"), page > 1 ? page - 1 : 0, page > 1 ? "prev" : "off")];
    shown.forEach((n, place) => {
      const gap = n - (shown[place - 1] || 0);
      if (gap === 2) items.push(item(whole(n - 1), n - 1, ""));
      if (gap > 2) items.push(item("…", 0, "gap"));
      items.push(item(whole(n), n, ""));
    });
    items.push(item(_("Next"), page < pages ? page + 1 : 0, page < pages ? "next" : "off"));
    list.replaceChildren(...items);
  }

  function turn(number) {
    page = number;
    show();
    remember();
    tools.scrollIntoView({ behavior: "instant" });
    const first = part("list-cards").querySelector(".card-link");
    if (first) first.focus({ preventScroll: true });
  }

  function change() {
    page = 1;
    failed = false;
    show();
    remember();
  }

  function clear() {
    search.value = "";
    if (state) state.value = usual;
    if (label) label.value = "";
    wanted = "";
    change();
  }

  // A video that is opened from a search, or from a group's page, is followed by the others found there.
  function leave() {
    const root = new URL(tools.dataset.root || ".", location.href).href;
    const links = Array.from(document.querySelectorAll("#list-plain .card-link"), (link) => link.href);
    const searched = asks() && ready;
    const ids = searched ? found.map((place) => `videos/${data.row(place)[0]}.html`)
      : links.map((href) => href.slice(root.length));
    const words = searched ? title() : tools.dataset.state && document.title;
    try {
      if (words) sessionStorage.setItem(KEY, JSON.stringify({ ids, from: address(), title: words }));
      else sessionStorage.removeItem(KEY);
    } catch (error) {
      // Then videos follow each other in the usual order.
    }
  }

  function step(by) {
    const links = Array.from(document.querySelectorAll(".card-link")).filter((link) => link.offsetParent);
    const here = links.indexOf(document.activeElement);
    const next = links[here < 0 ? 0 : here + by];
    if (next) next.focus();
  }

  function keys(event) {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || part("keys").open) return;
    const { target, key } = event;
    if (key === "Escape" && asks()) {
      event.preventDefault();
      clear();
    }
    if ({ ArrowDown: true }[key] && target === search) {
      event.preventDefault();
      step(1);
    }
    if (target.closest("input, select, textarea")) return;
    if (key === "j" || key === "k") step(key === "j" ? 1 : -1);
    if (key === "n" || key === "p") {
      const rel = key === "n" ? "next" : "prev";
      const links = Array.from(document.querySelectorAll(`.pager a[rel=${rel}]`));
      const link = links.find((one) => one.offsetParent);
      if (link) link.click();
    }
  }

  search.value = given.get("q") || "";
  const first = given.get("show") === "all" ? "" : given.get("show") || usual;
  if (state) state.value = Array.from(state.options).some((one) => one.value === first) ? first : usual;
  tools.addEventListener("submit", (event) => event.preventDefault());
  search.addEventListener("input", change);
  search.addEventListener("focus", begin);
  [state, label].filter(Boolean).forEach((choice) => choice.addEventListener("change", change));
  part("list-clear").addEventListener("click", () => {
    clear();
    search.focus();
  });
  part("list-pager").addEventListener("click", (event) => {
    const link = event.target.closest("a");
    if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    turn(Number(link.dataset.page));
  });
  part("main").addEventListener("click", (event) => {
    if (event.target.closest(".card-link")) leave();
  });
  document.addEventListener("keydown", keys);
  show();
})();
