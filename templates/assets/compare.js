// Two systems side by side. The whole state is in the address, so that a link is a finding.
(function () {
  "use strict";
  const { TEXT, whole } = window.COOOLER_WORDS;
  const data = window.COOOLER_COMPARE;
  const view = window.COOOLER_VIEW;
  const rows = window.COOOLER_ROWS;
  const solved = window.COOOLER_SOLVED;
  const page = (id) => document.getElementById(id);
  const index = data.index();
  if (!index) {
    fail();
    return;
  }
  const { systems, scale } = index;
  const slugs = systems.map(([slug]) => slug);
  const place = (slug) => slugs.indexOf(slug);
  const choices = (id) => Array.from(page(id).querySelectorAll("input"), (input) => input.value);
  const ALLOWED = {
    a: slugs,
    b: slugs,
    metric: choices("duel-metric"),
    sort: Array.from(page("duel-sort").options, (option) => option.value),
    show: choices("duel-show"),
  };
  const state = { a: slugs[0], b: slugs[1], metric: "besm", sort: "a", show: "all" };
  let found = null; // what is shown: both systems, their tests, the differences by the chosen score
  let turn = 0;

  function fail() {
    page("duel-problem").textContent = TEXT.unloaded;
    page("duel-problem").hidden = false;
    page("duel-found").hidden = true;
  }
  const say = (words) => {
    page("duel-said").textContent = words;
  };

  // The address: read once, written after every choice.
  function read() {
    const query = new URLSearchParams(location.search);
    const unknown = [];
    const known = new Set();
    Object.keys(ALLOWED).forEach((name) => {
      const given = query.get(name);
      if (given === null) return;
      if (ALLOWED[name].includes(given)) {
        state[name] = given;
        known.add(name);
      } else unknown.push(given.slice(0, 80));
    });
    if (state.a === state.b) state[known.has("a") ? "b" : "a"] = slugs.find((slug) => slug !== state.a);
    const of = query.has("of") ? query.get("of").split(",").filter(Boolean) : null;
    if (of) unknown.push(...of.filter((slug) => !slugs.includes(slug)).map((slug) => slug.slice(0, 80)));
    if (unknown.length) say(TEXT.unknown(unknown.slice(0, 3).join(", ")));
    return of;
  }

  function address() {
    const query = new URLSearchParams(state);
    const of = solved.chosen();
    if (of) query.set("of", of.join(","));
    return `${location.href.split(/[?#]/)[0]}?${query}`;
  }

  function remember() {
    try {
      history.replaceState(null, "", address());
    } catch (error) {
      // Where the address cannot be changed, the button still copies it.
    }
  }

  function showControls() {
    ["a", "b"].forEach((letter) => {
      page(`duel-${letter}`).value = state[letter];
    });
    page("duel-sort").value = state.sort;
    ["metric", "show"].forEach((name) => {
      page(`duel-${name}`).querySelectorAll("input").forEach((input) => {
        input.checked = input.value === state[name];
      });
    });
  }

  function choose(changes) {
    say("");
    Object.assign(state, changes);
    remember();
    showControls();
    const kept = found && found.a.slug === state.a && found.b.slug === state.b;
    if (!kept) return update();
    if ("metric" in changes) weigh();
    return "metric" in changes ? showAll() : showRows();
  }

  async function update() {
    const mine = (turn += 1);
    const [a, b] = [state.a, state.b];
    let parts;
    try {
      parts = await Promise.all([data.scores(a), data.scores(b), data.tests(place(a), place(b))]);
    } catch (error) {
      if (mine === turn) fail();
      return;
    }
    if (mine !== turn) return;
    const [one, other] = [a, b].map((slug, number) => {
      const [, name, cards] = systems[place(slug)];
      return { slug, name, cards, scores: parts[number] };
    });
    found = { a: one, b: other, tests: parts[2] };
    page("duel-problem").hidden = true;
    page("duel-found").hidden = false;
    weigh();
    showAll();
  }

  // The differences by the chosen score, the places of the videos by them, and videos by kind.
  function weigh() {
    const { a, b } = found;
    found.metric = state.metric;
    const [ofA, ofB] = [a.scores[state.metric], b.scores[state.metric]];
    const gap = Array.from(ofA, (number, video) => {
      const step = number - ofB[video];
      return Math.abs(step) <= 1 ? 0 : step; // one step is rounding
    });
    found.differences = gap;
    found.places = gap.map((_, video) => video).sort((one, other) => gap[other] - gap[one] || one - other);
    found.peak = gap.reduce((most, number) => Math.max(most, Math.abs(number)), 0);
    const mean = (numbers) => numbers.reduce((sum, number) => sum + number, 0) / numbers.length / scale;
    found.means = [mean(ofA), mean(ofB)];
    const [inA, inB] = [a.scores.detection, b.scores.detection];
    found.kinds = {
      all: () => true,
      "a-better": (video) => gap[video] > 0,
      "b-better": (video) => gap[video] < 0,
      equal: (video) => gap[video] === 0,
      both: (video) => inA[video] > 0 && inB[video] > 0,
      "only-a": (video) => inA[video] > 0 && inB[video] === 0,
      "only-b": (video) => inA[video] === 0 && inB[video] > 0,
      neither: (video) => inA[video] === 0 && inB[video] === 0,
    };
    found.count = (kind) => found.places.filter(found.kinds[kind]).length;
  }

  function showAll() {
    page("duel-show").querySelectorAll("input").forEach((input) => {
      input.parentNode.querySelector(".chip-count").textContent = whole(found.count(input.value));
    });
    view.show(found);
    showRows();
  }

  function order() {
    const kept = found.places.filter(found.kinds[state.show]);
    const gap = found.differences;
    if (state.sort === "b") kept.sort((one, other) => gap[one] - gap[other] || one - other);
    const size = (video) => Math.abs(gap[video]);
    if (state.sort === "size") kept.sort((one, other) => size(other) - size(one) || one - other);
    if (state.sort === "id") kept.sort((one, other) => one - other);
    return kept;
  }

  function showRows() {
    const { a, b, differences, peak } = found;
    rows.show({ a, b, metric: state.metric, differences, order: order(), peak, scale });
  }

  // Exports.
  function save(content, type, ending) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
    link.download = `compare-${state.a}-${state.b}.${ending}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    say(TEXT.exported(link.download));
  }

  async function json() {
    const kept = order();
    const videos = await Promise.all(kept.map((video) => data.video(video)));
    const of = (scores, video) => ({
      best: scores.best[video] / scale,
      besm: scores.besm[video] / scale,
      sam: scores.sam[video] / scale,
      detected: scores.detection[video] > 0,
    });
    return {
      format: "coooler-comparison",
      version: 1,
      benchmark: index.benchmark,
      signature: index.signature,
      resamples: index.resamples,
      seed: index.seed,
      ...state,
      names: { a: found.a.name, b: found.b.name },
      tests: found.tests,
      videos: kept.map((video, number) => ({
        video_id: videos[number].id,
        a: of(found.a.scores, video),
        b: of(found.b.scores, video),
        difference: found.differences[video] / scale,
      })),
    };
  }

  async function copy() {
    const link = address();
    try {
      await navigator.clipboard.writeText(link);
      say(TEXT.copied);
    } catch (error) {
      say(TEXT.notCopied(link));
    }
  }

  const swap = () => {
    choose({ a: state.b, b: state.a });
    say(TEXT.swapped(systems[place(state.a)][1], systems[place(state.b)][1]));
  };

  ["a", "b"].forEach((letter, number) => {
    page(`duel-${letter}`).addEventListener("change", ({ target }) => {
      const other = "ba"[number];
      // The same system on both sides says nothing: they change sides then.
      choose(state[other] === target.value ? { a: state.b, b: state.a } : { [letter]: target.value });
    });
  });
  page("duel-swap").addEventListener("click", swap);
  page("duel-sort").addEventListener("change", ({ target }) => choose({ sort: target.value }));
  ["metric", "show"].forEach((name) => {
    page(`duel-${name}`).addEventListener("change", ({ target }) => choose({ [name]: target.value }));
  });
  page("duel-copy").addEventListener("click", copy);
  page("duel-json").addEventListener("click", () => json().then((content) => {
    save(`${JSON.stringify(content, null, 1)}\n`, "application/json", "json");
  }, fail));
  page("duel-svg").addEventListener("click", () => save(view.svg(), "image/svg+xml", "svg"));
  page("duel-png").addEventListener("click", async () => save(await view.png(), "image/png", "png"));

  document.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || !found) return;
    const { target } = event;
    if (page("keys").open) return;
    if (target.closest("select, textarea, input:not([type=radio]):not([type=checkbox])")) return;
    if (event.key === "j" || event.key === "k") {
      event.preventDefault();
      rows.step(event.key === "j" ? 1 : -1);
    }
    if (event.key === "x") swap();
    // On a link or a button Enter does what it always does.
    const own = target.closest("a, button, input, summary");
    if (event.key === "Enter" && rows.link() && !own) rows.link().click();
  });

  view.onPick((video) => {
    if (!found.kinds[state.show](video)) choose({ show: "all" });
    rows.to(video);
  });
  rows.onMove(view.mark);

  solved.start(read(), remember);
  showControls();
  update();
})();
