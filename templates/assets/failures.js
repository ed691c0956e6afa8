// The failures page: what is chosen, in the address, so that a link is a finding; keys; progress.
(function () {
  "use strict";
  const { TEXT } = window.COOOLER_FAILURE_WORDS;
  const data = window.COOOLER_FAILURE_DATA;
  const filter = window.COOOLER_FAILURE_FILTER;
  const panel = window.COOOLER_FAILURE_FACETS;
  const list = window.COOOLER_FAILURE_LIST;
  const page = (id) => document.getElementById(id);
  const search = page("search");
  const SLOW = 200; // milliseconds between two looks at what came
  const MOST_WALKED = 20000;
  const state = { q: "", sort: filter.SORTS[0], at: "" };
  let facets = [];
  let version = 0;
  let totals = -1; // of which version
  let hits = { query: "", version: -1, found: null };
  let ready = false;
  let walk = []; // the failures that fit, in order
  let typed = false; // whether the last change was typing, which makes one step in the history

  const index = data.index();
  const say = (words) => {
    page("fail-said").textContent = words;
  };
  const problem = (words) => {
    page("fail-problem").textContent = words;
    page("fail-problem").hidden = false;
  };

  function makeFacets() {
    const columns = data.columns();
    const numbered = (words) => words.map((text, number) => [number ? text : "-", text]);
    const values = {
      kind: index.kinds,
      system: index.systems,
      score: index.ranges,
      label: numbered(index.labels),
      size: index.sizes,
      stages: index.stages,
      video: data.videos,
    };
    facets = Object.entries(values).map(([name, all]) => (
      { name, values: all, size: all.length, column: columns[name], chosen: new Set() }
    ));
    facets.forEach((facet) => {
      facet.codes = new Map(facet.values.map(([key], value) => [key, value]));
    });
    panel.start(facets, (facet, value, on) => change(() => {
      if (on) facet.chosen.add(value);
      else facet.chosen.delete(value);
    }));
  }

  // The name of a failure in the address: system, video, and its hazard or caption there.
  function nameOf(at) {
    const columns = data.columns();
    const [slug] = index.systems[columns.system[at]];
    const [video] = data.videos[columns.video[at]];
    const hazard = columns.hazard[at];
    if (!hazard) return `${slug}~${video}~c${columns.rank[at]}`;
    const first = data.hazards.findIndex((row) => row && row[0] === columns.video[at]);
    return `${slug}~${video}~h${hazard - first + 1}`;
  }

  function find(name) {
    const columns = data.columns();
    const [slug, video] = name.split("~");
    const ofSystem = index.systems.findIndex((row) => row[0] === slug);
    const ofVideo = data.videos.findIndex((row) => row[0] === video);
    for (let at = 0; at < columns.length && ofSystem >= 0 && ofVideo >= 0; at += 1) {
      const here = columns.ready[at] && columns.system[at] === ofSystem && columns.video[at] === ofVideo;
      if (here && nameOf(at) === name) return at;
    }
    return -1;
  }

  function read() {
    const query = new URLSearchParams(location.search);
    const unknown = [];
    facets.forEach((facet) => {
      facet.chosen.clear();
      query.getAll(facet.name).forEach((key) => {
        if (facet.codes.has(key)) facet.chosen.add(facet.codes.get(key));
        else unknown.push(key.slice(0, 80));
      });
    });
    state.q = (query.get("q") || "").slice(0, 200);
    const sort = query.get("sort");
    state.sort = filter.SORTS.includes(sort) ? sort : filter.SORTS[0];
    if (sort && sort !== state.sort) unknown.push(sort.slice(0, 80));
    state.at = (query.get("at") || "").slice(0, 300);
    say(unknown.length ? TEXT.unknown(unknown.slice(0, 3).join(", ")) : "");
    search.value = state.q;
    page("fail-sort").value = state.sort;
  }

  function address() {
    const query = new URLSearchParams();
    facets.forEach((facet) => {
      const chosen = Array.from(facet.chosen).sort((a, b) => a - b);
      chosen.forEach((value) => query.append(facet.name, facet.values[value][0]));
    });
    if (state.q) query.set("q", state.q);
    if (state.sort !== filter.SORTS[0]) query.set("sort", state.sort);
    if (state.at) query.set("at", state.at);
    const text = query.toString();
    return location.href.split(/[?#]/)[0] + (text ? `?${text}` : "");
  }

  function remember(replace) {
    if (address() === location.href) return;
    try {
      history[replace ? "replaceState" : "pushState"](null, "", address());
    } catch (error) {
      // Where the address cannot be changed, the button still copies it.
    }
  }

  // A choice of the visitor: a step in the history, but typing makes one step only.
  function change(apply, typing = false) {
    apply();
    say("");
    remember(typing && typed);
    typed = typing;
    update();
    const away = page("fail-list").getBoundingClientRect().top < 0;
    if (away) page("fail-gallery").scrollIntoView({ behavior: "instant" });
  }

  function update() {
    if (hits.query !== state.q || hits.version !== version) {
      hits = { query: state.q, version, found: filter.search(state.q, version) };
    }
    const order = filter.order(state.sort, version);
    const { places, counts } = filter.run(facets, hits.found, order);
    walk = places;
    let all = null;
    if (totals !== version) {
      all = filter.run(facets.map((facet) => ({ ...facet, chosen: new Set() })), null, order).counts;
      totals = version;
    }
    panel.show(counts, all);
    const chosen = facets.some((facet) => facet.chosen.size) || state.q;
    page("fail-clear").hidden = !chosen;
    page("fail-count").textContent = TEXT.found(places.length, index.failures);
    page("fail-none").hidden = places.length > 0 || !ready;
    page("fail-capped").textContent = places.length > list.MOST ? TEXT.capped(list.MOST) : "";
    meaning();
    list.show(places, state.at ? find(state.at) : -1);
    if (state.q && !data.hasTexts()) readTexts();
  }

  // A video that is opened from here is followed by the others of the filter.
  function leave() {
    const ids = Array.from(new Set(Array.from(walk.slice(0, MOST_WALKED), data.path)));
    try {
      if (page("fail-clear").hidden) sessionStorage.removeItem("coooler-walk");
      else {
        const title = page("fail-count").textContent;
        sessionStorage.setItem("coooler-walk", JSON.stringify({ ids, from: address(), title }));
      }
    } catch (error) {
      // Then videos follow each other in the usual order.
    }
  }

  // What the one kind that is chosen means.
  function meaning() {
    const [kinds] = facets;
    const [only] = kinds.chosen.size === 1 ? kinds.chosen : [null];
    page("fail-meaning").textContent = only === null ? "" : index.kinds[only][2];
  }

  function progress(words, done, all) {
    const bar = page("fail-progress");
    bar.hidden = done >= all;
    bar.querySelector("span").textContent = done < all ? words(done, all) : "";
    bar.querySelector("progress").max = Math.max(all, 1);
    bar.querySelector("progress").value = done;
  }

  // A look at what came, now and then.
  function slowly(look) {
    let last = -Infinity;
    return (done, all) => {
      if (done < all && performance.now() - last < SLOW) return;
      look(done, all);
      last = performance.now();
    };
  }

  let reading = false;
  async function readTexts() {
    if (reading) return;
    reading = true;
    progress(TEXT.reading, 0, 1);
    const failed = await data.everyText(slowly((done, all) => {
      progress(TEXT.reading, done, all);
      version += 1;
      update();
    }));
    if (failed) {
      problem(TEXT.unloaded);
      progress(TEXT.reading, 1, 1);
    }
    reading = failed > 0; // no second try
  }

  async function copy() {
    try {
      await navigator.clipboard.writeText(address());
      say(TEXT.copied);
    } catch (error) {
      say(TEXT.notCopied(address()));
    }
  }

  function clear() {
    change(() => {
      facets.forEach((facet) => facet.chosen.clear());
      state.q = "";
      state.at = "";
      search.value = "";
    });
  }

  const wide = window.matchMedia("(min-width: 62rem)");
  function fold() {
    page("fail-filters").open = wide.matches;
  }

  function keys(event) {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || page("keys").open) return;
    const { target, key } = event;
    if (key === "Escape" && target.matches(".fail-find")) return; // it clears itself
    if (key === "Escape" && (target === document.body || page("fail-gallery").contains(target))) {
      clear();
      return;
    }
    if (target.closest("select, textarea, input:not([type=checkbox])")) return;
    const inList = page("fail-list").contains(target);
    const arrows = inList || (target === document.body && list.inSight());
    const by = { j: 1, k: -1, ArrowDown: arrows ? 1 : 0, ArrowUp: arrows ? -1 : 0 }[key];
    if (by) {
      event.preventDefault();
      list.step(by);
    }
    if (key === "f") {
      event.preventDefault();
      page("fail-filters").open = true;
      panel.focus();
    }
    // On a link or a button Enter does what it always does.
    if (key === "Enter" && list.link() && !target.closest("a, button, input, summary")) list.link().click();
  }

  async function start() {
    const asked = location.search.length > 1;
    let began = false;
    const failed = await data.begin(slowly((done, all) => {
      if (!began) {
        began = true;
        makeFacets();
        read();
        fold();
        listen();
      }
      progress(TEXT.loading, done, all);
      if (!done) return;
      version += 1;
      page("fail-first").hidden = true;
      page("fail-tool").hidden = false;
      update();
    }));
    ready = began;
    if (failed) {
      problem(TEXT.unloaded);
      progress(TEXT.loading, 1, 1);
    }
    if (!began) return;
    update();
    if (state.at && list.at() >= 0) list.to(list.at());
    else if (asked) page("fail-gallery").scrollIntoView({ behavior: "instant" });
  }

  function listen() {
    search.addEventListener("input", () => change(() => {
      state.q = search.value.trim().slice(0, 200);
    }, true));
    page("fail-sort").addEventListener("change", ({ target }) => change(() => {
      state.sort = target.value;
    }));
    page("fail-copy").addEventListener("click", copy);
    page("fail-clear").addEventListener("click", clear);
    page("fail-list").addEventListener("click", ({ target }) => {
      if (target.closest(".fail-link")) leave();
    });
    document.addEventListener("keydown", keys);
    window.addEventListener("popstate", () => {
      typed = false;
      read();
      update();
    });
    wide.addEventListener("change", fold);
    list.onMove((at) => {
      state.at = at < 0 ? "" : nameOf(at);
      remember(true);
    });
  }

  if (index) start();
  else problem(TEXT.unloaded);
})();
