// Who detects what, counted anew for the systems that are chosen; the page's own tables are the start.
(function () {
  "use strict";
  const { TEXT, add, whole, percent } = window.COOOLER_WORDS;
  const data = window.COOOLER_COMPARE;
  const SHOWN_VIDEOS = 6;
  const SHOWN_SETS = 12;
  const MORE = 100;
  const page = (id) => document.getElementById(id);
  const SVG = "http://www.w3.org/2000/svg";
  let boxes = [];
  let changed = () => {};
  let tables = {}; // id of a table -> the places of the videos of each of its rows
  let turn = 0;

  const chosen = () => boxes.filter((box) => box.checked).map((box) => box.value);
  const usual = () => boxes.every((box) => box.checked === (box.dataset.chosen === "yes"));

  // The videos by how many and by which systems detect them, and counts for every two systems.
  async function counted() {
    const places = boxes.flatMap((box, place) => (box.checked ? [place] : []));
    const found = await Promise.all(places.map((place) => data.found(boxes[place].value)));
    const { videos } = data.index();
    const n = places.length;
    const byNumber = Array.from({ length: n + 1 }, () => []);
    const bySet = new Map();
    const ahead = Array.from({ length: n }, () => new Array(n).fill(0));
    const alone = new Array(n).fill(0);
    for (let video = 0; video < videos; video += 1) {
      const who = [];
      const others = [];
      for (let one = 0; one < n; one += 1) (found[one][video] ? who : others).push(one);
      byNumber[who.length].push(video);
      if (who.length === 1) alone[who[0]] += 1;
      who.forEach((one) => others.forEach((other) => {
        ahead[one][other] += 1;
      }));
      const key = who.join(" ");
      if (who.length) {
        if (!bySet.has(key)) bySet.set(key, { who, videos: [] });
        bySet.get(key).videos.push(video);
      }
    }
    const sets = Array.from(bySet.values()).sort((one, other) => other.videos.length - one.videos.length
      || one.who.length - other.who.length || before(one.who, other.who));
    const detected = found.map((of) => of.reduce((sum, bit) => sum + bit, 0));
    return { places, byNumber, sets, ahead, alone, detected };
  }

  function before(one, other) {
    const at = one.findIndex((place, number) => place !== other[number]);
    return at < 0 ? 0 : one[at] - other[at];
  }

  async function draw() {
    const mine = (turn += 1);
    page("solved-number").textContent = String(chosen().length);
    let found;
    try {
      found = await counted();
    } catch (error) {
      page("solved-problem").textContent = TEXT.unloaded;
      page("solved-problem").hidden = false;
      return;
    }
    if (mine !== turn) return;
    page("solved-problem").hidden = true;
    const n = found.places.length;
    const name = (one) => data.index().systems[found.places[one]][3];
    const words = (number) => {
      if (number === 0) return TEXT.noneOf;
      return number === n ? TEXT.all(n) : TEXT.some(number, n);
    };
    const counts = found.byNumber.map((videos, number) => ({ name: words(number), videos })).reverse();
    const sets = found.sets.map(({ who, videos }) => ({ name: who.map(name).join(" · "), videos }));
    fill("solved-counts", counts);
    fill("solved-sets", sets.slice(0, SHOWN_SETS));
    page("solved-more").textContent = sets.length > SHOWN_SETS ? TEXT.sets(sets.length - SHOWN_SETS) : "";
    matrix(found, name);
  }

  function fill(id, rows) {
    tables[id] = rows.map((row) => row.videos);
    const body = page(id).tBodies[0];
    body.textContent = "";
    rows.forEach(({ name, videos }) => {
      const line = add(body, "tr");
      add(line, "th", name).scope = "row";
      add(line, "td", String(videos.length), "n");
      const share = videos.length / data.index().videos;
      bar(add(line, "td", percent(share), "n"), Math.round(share * 100));
      const which = add(line, "td", "", "solved-which");
      if (!videos.length) which.textContent = TEXT.none;
      extend(which, videos, SHOWN_VIDEOS);
    });
  }

  function bar(cell, share) {
    const made = cell.appendChild(document.createElementNS(SVG, "svg"));
    Object.entries({ class: "bar", viewBox: "0 0 100 6", preserveAspectRatio: "none", "aria-hidden": "true" })
      .forEach(([name, value]) => made.setAttribute(name, value));
    [["bar-full", 100], ["bar-part", share]].forEach(([className, width]) => {
      const part = made.appendChild(document.createElementNS(SVG, "rect"));
      Object.entries({ class: className, width, height: 6, rx: 1 }).forEach(([name, value]) => {
        part.setAttribute(name, value);
      });
    });
  }

  // The next links of a cell, and a button for the rest.
  async function extend(cell, videos, wanted) {
    const rest = cell.querySelector(".solved-rest");
    const there = cell.querySelectorAll("a").length;
    const places = videos.slice(there, there + wanted);
    const next = await Promise.all(places.map((place) => data.video(place))).catch(() => []);
    if (rest) rest.remove();
    next.forEach(({ href, shown }, number) => {
      if (there + number) cell.append(", ");
      add(cell, "a", shown).href = href;
    });
    const left = videos.length - there - next.length;
    if (left > 0 && next.length) {
      cell.append(" ");
      cell.append(button(left));
    }
    if (there && next.length) cell.querySelectorAll("a")[there].focus();
  }

  function button(left) {
    const made = document.createElement("button");
    made.type = "button";
    made.className = "solved-rest quiet";
    made.textContent = TEXT.rest(left);
    return made;
  }

  page("solved-found").addEventListener("click", async (event) => {
    const pressed = event.target.closest(".solved-rest");
    if (!pressed) return;
    const cell = pressed.closest("td");
    const table = cell.closest("table");
    const row = cell.parentNode.sectionRowIndex;
    if (!tables[table.id]) await draw();
    if (tables[table.id]) extend(table.tBodies[0].rows[row].lastElementChild, tables[table.id][row], MORE);
  });

  function matrix({ places, ahead, alone, detected }, name) {
    const table = page("solved-matrix");
    const head = table.tHead.rows[0];
    while (head.cells.length > 3) head.lastElementChild.remove();
    const body = table.tBodies[0];
    body.textContent = "";
    places.forEach((place, one) => {
      const turned = add(head, "th", "", "turn");
      turned.scope = "col";
      add(turned, "span", name(one));
      const [slug] = data.index().systems[place];
      const line = add(body, "tr");
      line.dataset.slug = slug;
      const first = add(line, "th");
      first.scope = "row";
      add(first, "a", name(one)).href = `submissions/${slug}.html`;
      add(line, "td", String(detected[one]), "n");
      add(line, "td", String(alone[one]), "n");
      ahead[one].forEach((number, other) => {
        const level = Math.floor((number / data.index().videos) * 10 + 1e-9);
        if (other === one) add(line, "td", TEXT.none, "solved-self");
        else add(line, "td", String(number), `h${level}`);
      });
    });
    link();
  }

  // Every number of the matrix leads to its videos, in the list above.
  function link() {
    const rows = Array.from(page("solved-matrix").tBodies[0].rows);
    const names = new Map(data.index().systems);
    rows.forEach((row) => {
      rows.forEach((column, number) => {
        const cell = row.cells[number + 3];
        const [a, b] = [row.dataset.slug, column.dataset.slug];
        const videos = Number(cell.textContent.replace(/\D/g, ""));
        if (a === b || !videos) return;
        cell.textContent = "";
        const made = add(cell, "a", whole(videos));
        const query = new URLSearchParams({ a, b, metric: "detection", show: "only-a" });
        if (!usual()) query.set("of", chosen().join(","));
        made.href = `compare.html?${query}`;
        made.setAttribute("aria-label", TEXT.solves(videos, names.get(a), names.get(b)));
      });
    });
  }

  // `slugs` are those to count, null for the usual ones; `then` is called when others are chosen.
  function start(slugs, then) {
    boxes = Array.from(page("solved-boxes").querySelectorAll("input"));
    boxes.forEach((box) => {
      box.checked = slugs ? slugs.includes(box.value) : box.dataset.chosen === "yes";
      box.addEventListener("change", choose);
    });
    page("solved-all").addEventListener("click", () => mark(true));
    page("solved-none").addEventListener("click", () => mark(false));
    if (usual()) {
      link();
      page("solved-found").querySelectorAll(".solved-which").forEach((cell) => {
        const rest = cell.querySelector(".sub");
        if (rest) rest.replaceWith(button(Number(rest.dataset.more)));
      });
    } else draw();
    changed = then;
  }

  function mark(checked) {
    boxes.forEach((box) => {
      box.checked = checked;
    });
    choose();
  }

  function choose() {
    draw();
    changed();
  }

  window.COOOLER_SOLVED = { start, chosen: () => (usual() ? null : chosen()) };
})();
