// The leaderboard: rank by another score, another threshold, columns, details. All state is in the address.
(function () {
  "use strict";
  const { TEXT } = window.COOOLER_WORDS;
  const { marked, percent } = window.COOOLER_I18N;
  const details = window.COOOLER_DETAILS;
  const clip = window.COOOLER_COPY;
  const page = (id) => document.getElementById(id);
  const table = page("board");
  const body = table.tBodies[0];
  const heads = Array.from(table.tHead.rows[0].cells);
  const columns = heads.map((head) => head.dataset.column);
  const MEASURES = ["besm", "sam", "detection", "recall"];
  const FIXED = ["rank", "name"]; // always shown
  const search = page("search");
  const slider = page("board-threshold");
  const thresholds = slider ? slider.dataset.texts.split(" ") : [];
  const shownThreshold = (number) => marked(thresholds[number]);
  const published = slider ? Number(slider.defaultValue) : 0;
  const titles = heads.map((head) => head.textContent.trim());
  const at = (column) => columns.indexOf(column);
  const signature = (document.querySelector(".signature code") || { textContent: "" }).textContent;

  const state = { rank: "besm", threshold: published, sort: null, hidden: new Set() };
  let boards = null; // all parts of the data, once the slider was used
  let turn = 0;

  const rows = window.COOOLER_ROWS(table, columns, titles, MEASURES);
  const hasRecall = rows.some((row) => row.cells.recall.value >= 0);

  const say = (words) => {
    page("board-said").textContent = words;
  };

  // The values of every row at the chosen threshold.
  function count() {
    const own = state.threshold === published || !boards;
    rows.forEach((row) => {
      MEASURES.forEach((column) => {
        row.values[column] = row.cells[column].value;
        row.texts[column] = row.cells[column].text;
      });
      if (!own) {
        const board = boards.get(row.part);
        const system = board.systems[row.slug];
        row.values.detection = system.detected[state.threshold] / board.videos;
        if (board.hazards) row.values.recall = system.found[state.threshold] / board.hazards;
        ["detection", "recall"].forEach((column) => {
          row.texts[column] = row.values[column] < 0 ? TEXT.none : percent(row.values[column]);
        });
      }
      ["detection", "recall"].forEach((column) => show(row, column, own));
    });
    return own;
  }

  function show(row, column, own) {
    const { cell, nodes, text, value } = row.cells[column];
    cell.dataset.value = row.values[column];
    if (own || value < 0) {
      cell.replaceChildren(...nodes);
      return;
    }
    const bar = cell.querySelector("svg").cloneNode(true);
    bar.querySelector(".bar-part").setAttribute("width", Math.round(row.values[column] * 100));
    const range = bar.querySelector(".bar-range");
    if (range) range.remove();
    const note = document.createElement("span");
    note.className = "range";
    note.textContent = TEXT.published(text);
    cell.replaceChildren(row.texts[column], bar, note);
  }

  // Competition ranks by the chosen score; those of BESM are the bands that the page came with.
  function rank() {
    const key = state.rank;
    const order = rows.slice().sort((a, b) => b.values[key] - a.values[key] || a.place - b.place);
    if (key === "besm") order.sort((a, b) => a.place - b.place);
    let first = 0;
    order.forEach((row, number) => {
      if (row.values[key] !== order[first].values[key]) first = number;
      const shared = order.filter((other) => other.values[key] === row.values[key]).length > 1;
      row.shownRank = key === "besm" ? row.rank : `${first + 1}${shared ? "=" : ""}`;
      row.element.cells[0].dataset.value = key === "besm" ? row.cells.rank.value : number + 1;
      row.rankText.textContent = row.shownRank;
    });
    return order;
  }

  function sorted(order) {
    const by = state.sort || { column: state.rank, descending: true };
    heads.forEach((head, number) => {
      if (columns[number] !== by.column) head.removeAttribute("aria-sort");
      else head.setAttribute("aria-sort", by.descending ? "descending" : "ascending");
    });
    if (!state.sort) return order;
    const number = heads[at(by.column)].dataset.sort === "number";
    const cellOf = (row) => row.element.cells[at(by.column)];
    const value = (row) => (number ? Number(cellOf(row).dataset.value) : row.cells[by.column].text.toLowerCase());
    const sign = by.descending ? -1 : 1;
    return order.slice().sort((a, b) => {
      const [one, other] = [value(a), value(b)];
      return one < other ? -sign : one > other ? sign : 0;
    });
  }

  function apply() {
    const own = count();
    const order = sorted(rank());
    const focus = document.activeElement;
    body.append(...order.flatMap((row) => (row.open ? [row.element, row.more.below] : [row.element])));
    if (focus && focus !== document.activeElement) focus.focus();
    heads.forEach((head, number) => {
      const hidden = state.hidden.has(columns[number]);
      head.hidden = hidden;
      rows.forEach((row) => {
        row.element.cells[number].hidden = hidden;
      });
    });
    rows.forEach((row) => row.more.fit());
    followSearch();
    MEASURES.forEach((column) => {
      rows.forEach((row) => row.cells[column].cell.classList.toggle("lead", column === state.rank));
    });
    const words = state.rank === "besm" ? [] : [TEXT.ranked(state.rank)];
    if (!own) words.push(TEXT.elsewhere(shownThreshold(state.threshold), shownThreshold(published)));
    page("board-note").textContent = words.join(" ");
    controls();
    remember();
  }

  function followSearch() {
    rows.forEach((row) => {
      row.more.below.hidden = row.element.hidden;
    });
  }

  function controls() {
    page("board-metric").querySelectorAll("input").forEach((input) => {
      input.checked = input.value === state.rank;
    });
    page("board-columns").querySelectorAll("input").forEach((input) => {
      input.checked = !state.hidden.has(input.value);
    });
    if (!slider) return;
    slider.value = state.threshold;
    slider.setAttribute("aria-valuetext", shownThreshold(state.threshold));
    page("board-threshold-text").textContent = shownThreshold(state.threshold);
    page("board-reset").hidden = state.threshold === published;
  }

  async function setThreshold(number) {
    state.threshold = number;
    controls();
    if (number !== published && !boards) {
      const mine = (turn += 1);
      const numbers = Array.from(new Set(rows.map((row) => row.part)));
      say(TEXT.loading);
      const found = await Promise.all(numbers.map(details.load)).catch(() => null);
      if (mine !== turn) return;
      say(found ? "" : TEXT.unloaded);
      if (found) boards = new Map(numbers.map((one, place) => [one, found[place]]));
      else state.threshold = published;
    }
    apply();
  }

  // The address: nothing in it while everything is as published.
  function address() {
    const query = new URLSearchParams();
    if (state.rank !== "besm") query.set("rank", state.rank);
    if (state.threshold !== published) query.set("threshold", thresholds[state.threshold]);
    if (state.sort) query.set("sort", `${state.sort.descending ? "-" : ""}${state.sort.column}`);
    if (state.hidden.size) query.set("columns", optional().filter((one) => !state.hidden.has(one)).join(","));
    if (search && search.value) query.set("q", search.value);
    const open = rows.filter((row) => row.open).map((row) => row.slug);
    if (open.length) query.set("open", open.join(","));
    const text = `${query}`.replaceAll("%2C", ",");
    return location.href.split(/[?#]/)[0] + (text ? `?${text}` : "");
  }

  function remember() {
    try {
      history.replaceState(null, "", address() + location.hash);
    } catch (error) {
      // Where the address cannot be changed, the button still copies it.
    }
  }

  const optional = () => columns.filter((column) => !FIXED.includes(column));

  async function read() {
    const query = new URLSearchParams(location.search);
    const unknown = [];
    const take = (name, known, set) => {
      const given = query.get(name);
      if (given === null) return;
      if (known(given)) set(given);
      else unknown.push(given.slice(0, 80));
    };
    take("rank", (given) => MEASURES.includes(given) && (given !== "recall" || hasRecall), (given) => {
      state.rank = given;
    });
    take("sort", (given) => columns.includes(given.replace(/^-/, "")), (given) => {
      state.sort = { column: given.replace(/^-/, ""), descending: given.startsWith("-") };
    });
    take("columns", (given) => given.split(",").every((one) => !one || columns.includes(one)), (given) => {
      state.hidden = new Set(optional().filter((one) => !given.split(",").includes(one)));
    });
    if (query.get("q") && search) {
      search.value = query.get("q").slice(0, 200);
      search.dispatchEvent(new Event("input"));
    }
    const open = (query.get("open") || "").split(",");
    let threshold = published;
    take("threshold", (given) => thresholds.includes(given), (given) => {
      threshold = thresholds.indexOf(given);
    });
    rows.filter((row) => open.includes(row.slug)).forEach((row) => row.more.turn(true));
    await setThreshold(threshold);
    if (unknown.length) say(TEXT.unknown(unknown.slice(0, 3).join(", ")));
  }

  // The table as it is shown, for copying.
  function shown() {
    const kept = columns.filter((column) => !state.hidden.has(column));
    const visible = Array.from(body.rows).map((element) => rows.find((row) => row.element === element))
      .filter((row) => row && !row.element.hidden);
    const own = state.threshold === published;
    const text = (row, column) => {
      const { interval, text: given } = row.cells[column];
      if (column === "rank") return row.shownRank;
      if (column === "name") return row.name;
      if (!MEASURES.includes(column)) return interval ? `${given} (${interval})` : given;
      const counted = column === "detection" || column === "recall";
      return interval && (own || !counted) ? `${row.texts[column]} (${interval})` : row.texts[column];
    };
    const notes = [TEXT.notes.interval];
    if (slider) notes.push(TEXT.above(shownThreshold(state.threshold)));
    if (page("board-note").textContent) notes.push(page("board-note").textContent);
    if (signature) notes.push(TEXT.notes.signature(signature));
    return {
      title: document.querySelector("h1").textContent,
      columns: kept.map((column) => ({
        text: titles[at(column)], number: heads[at(column)].classList.contains("n"),
      })),
      rows: visible.map((row) => kept.map((column) => text(row, column))),
      notes,
    };
  }

  // Building the controls.
  rows.forEach((row) => {
    row.rankText = document.createElement("span");
    row.rankText.textContent = row.rank;
    row.element.cells[0].replaceChildren(row.rankText);
    row.more = details.attach(row, signature, () => {
      followSearch();
      remember();
    });
  });
  optional().forEach((column) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    Object.assign(box, { type: "checkbox", value: column, checked: true });
    label.className = "check";
    label.append(box, titles[at(column)]);
    page("board-columns").append(label);
  });
  page("board-metric").querySelector("[value=recall]").disabled = !hasRecall;

  page("board-metric").addEventListener("change", ({ target }) => {
    Object.assign(state, { rank: target.value, sort: null });
    apply();
  });
  if (slider) {
    slider.addEventListener("input", () => setThreshold(Number(slider.value)));
    page("board-reset").addEventListener("click", () => {
      slider.focus();
      setThreshold(published);
    });
  }
  page("board-columns-open").addEventListener("click", ({ currentTarget }) => {
    const panel = page("board-columns");
    panel.hidden = !panel.hidden;
    currentTarget.setAttribute("aria-expanded", `${!panel.hidden}`);
  });
  page("board-columns").addEventListener("change", ({ target }) => {
    if (target.checked) state.hidden.delete(target.value);
    else state.hidden.add(target.value);
    apply();
  });
  // In place of the sorting of plain tables: it knows the rows below rows.
  table.tHead.addEventListener("click", (event) => {
    const head = event.target.closest(".sort") && event.target.closest("th");
    if (!head) return;
    event.stopPropagation();
    const first = head.dataset.first === "desc";
    const now = head.getAttribute("aria-sort");
    const descending = now ? now === "ascending" : first;
    const { column } = head.dataset;
    state.sort = column === state.rank && descending ? null : { column, descending };
    apply();
  }, true);
  if (search) search.addEventListener("input", () => {
    followSearch();
    remember();
  });
  ["markdown", "latex"].forEach((kind) => {
    page(`board-${kind}`).addEventListener("click", () => clip.copy(kind, clip[kind](shown()), say));
  });
  page("board-link").addEventListener("click", () => clip.copy("link", address(), say));

  read();
})();
