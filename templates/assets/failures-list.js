// The list: only what is near the window is in the document. Every item has the same height.
(function () {
  "use strict";
  const { TEXT, fixed, add } = window.COOOLER_FAILURE_WORDS;
  const data = window.COOOLER_FAILURE_DATA;
  const SVG = "http://www.w3.org/2000/svg";
  const AHEAD = 6; // items beyond the window, on both sides
  const MOST = 40_000; // browsers cannot lay out pages of any height
  const PRINTED = 50;
  const list = document.getElementById("fail-list");
  const items = new Map(); // number in `places` -> its element
  let places = new Uint32Array(0);
  let current = -1; // a number in `places`
  let height = 0;
  let paper = false;
  let moved = () => {};

  const shownCount = () => Math.min(places.length, MOST);

  // `at`: the failure to select; -1 for none. Focus in the list stays there.
  function show(next, at) {
    const had = list.contains(document.activeElement);
    const before = places;
    places = next;
    current = at < 0 ? -1 : places.indexOf(at);
    if (current >= MOST) current = -1;
    items.forEach((item, number) => {
      if (before[number] === places[number]) {
        item.setAttribute("aria-setsize", places.length);
        mark(item, number === current);
        return;
      }
      item.remove();
      items.delete(number);
    });
    list.hidden = !places.length;
    measure();
    draw();
    if (had && current >= 0) link(current).focus({ preventScroll: true });
  }

  function measure() {
    if (!places.length) return;
    const probe = items.get(0) || make(0);
    if (!probe.isConnected) list.append(probe);
    height = probe.getBoundingClientRect().height;
    if (!items.has(0)) probe.remove();
    list.style.height = `${height * shownCount()}px`;
  }

  function draw() {
    if (!places.length || !height) return;
    const top = list.getBoundingClientRect().top;
    let first = Math.max(0, Math.floor(-top / height) - AHEAD);
    let end = Math.min(shownCount(), Math.ceil((window.innerHeight - top) / height) + AHEAD);
    if (paper) [first, end] = [0, Math.min(PRINTED, shownCount())];
    end = Math.max(end, Math.min(first + AHEAD, shownCount()));
    items.forEach((item, number) => {
      if ((number >= first && number < end) || (number === current && !paper)) return;
      item.remove();
      items.delete(number);
    });
    for (let number = first; number < end; number += 1) put(number);
    if (current >= 0) put(current);
  }

  // An item stands in the document where it stands in the list, for those who read by ear.
  function put(number) {
    if (items.has(number)) return;
    const item = make(number);
    const after = Array.from(items.keys()).filter((other) => other > number);
    list.insertBefore(item, after.length ? items.get(Math.min(...after)) : null);
    items.set(number, item);
  }

  function make(number) {
    const at = places[number];
    const columns = data.columns();
    const [name, shown, card] = data.videos[columns.video[at]];
    const [slug, system] = data.index().systems[columns.system[at]];
    const [, kind] = data.index().kinds[columns.kind[at]];
    const truth = data.hazardsOf(at);
    const item = document.createElement("li");
    item.className = "fail-item";
    item.style.top = `${number * height}px`;
    item.setAttribute("aria-setsize", places.length);
    item.setAttribute("aria-posinset", number + 1);
    item.dataset.number = number;
    const frame = add(item, "span", "", "fail-picture");
    if (card) {
      const picture = add(frame, "img");
      picture.loading = "lazy";
      picture.decoding = "async";
      picture.alt = TEXT.picture(shown, truth.map((row) => row[3]).join(", ").slice(0, 80) || TEXT.noHazard);
      [picture.width, picture.height] = [400, 225];
      picture.src = card;
    } else add(frame, "span", TEXT.noPicture, "sub");
    const head = add(item, "p", "", "fail-head");
    add(head, "span", kind, "badge");
    const anchor = add(head, "a", shown, "fail-link");
    anchor.href = `videos/${name}.html#${slug}`;
    add(anchor, "span", `: ${kind}, ${system}`, "sr");
    add(head, "span", system, "sub fail-system");
    const words = add(item, "div", "", "fail-words");
    part(words, TEXT.truth, "fail-truth", truth.length ? "" : TEXT.noHazard);
    truth.forEach((row, n) => {
      if (n) words.lastChild.append("; ");
      add(words.lastChild, "b", row[3]);
      words.lastChild.append(`: ${row[4]}`);
    });
    texts(words, at);
    score(item, columns.units[at]);
    if (number === current) mark(item, true);
    return item;
  }

  function part(words, name, kind, text) {
    const line = add(words, "p", "", kind);
    add(line, "span", `${name} `, "fail-part");
    if (text) line.append(text);
    return line;
  }

  function texts(words, at) {
    const { said, evidence } = data.columns();
    const waits = [];
    [
      [TEXT.said, "fail-said", said[at]],
      [TEXT.evidence, "fail-evidence", evidence[at]],
    ].forEach(([name, kind, number]) => {
      const line = part(words, name, kind, "");
      const place = add(line, "span");
      if (!number) {
        place.textContent = kind === "fail-said" ? TEXT.silent : "–";
        line.classList.toggle("fail-silent", kind === "fail-said");
        return;
      }
      const text = data.text(number);
      place.textContent = text === null ? TEXT.wait : text;
      if (text === null) waits.push([place, number]);
    });
    waits.forEach(async ([place, number]) => {
      try {
        await data.want(number);
        place.textContent = data.text(number);
      } catch (error) {
        place.textContent = TEXT.unreadable;
      }
    });
  }

  function score(item, units) {
    const scale = data.index().units;
    const line = add(item, "p", "", "fail-score");
    add(line, "b", fixed(units / scale, 4), "num");
    add(line, "span", TEXT.similarity, "sub");
    const bar = line.appendChild(document.createElementNS(SVG, "svg"));
    const set = (shape, values) => Object.entries(values).forEach(([name, text]) => {
      shape.setAttribute(name, text);
    });
    set(bar, { class: "bar", viewBox: "0 0 100 6", preserveAspectRatio: "none", "aria-hidden": "true" });
    const mark = Math.round(data.index().threshold * 100);
    [
      ["rect", { class: "bar-full", width: 100, height: 6, rx: 1 }],
      ["rect", { class: "bar-part", width: (units / scale) * 100, height: 6, rx: 1 }],
      ["line", { class: "bar-mark", x1: mark, x2: mark, y1: 0, y2: 6 }],
    ].forEach(([kind, values]) => set(bar.appendChild(document.createElementNS(SVG, kind)), values));
  }

  const link = (number) => items.get(number).querySelector(".fail-link");

  function mark(item, here) {
    item.classList.toggle("fail-here", here);
    if (here) item.setAttribute("aria-current", "true");
    else item.removeAttribute("aria-current");
  }

  function choose(number) {
    if (number === current) return;
    if (items.has(current)) mark(items.get(current), false);
    current = number;
    if (items.has(current)) mark(items.get(current), true);
    moved(current < 0 ? -1 : places[current]);
  }

  // To an item by its number: it is selected, in sight, and has the focus.
  function go(number) {
    if (number < 0 || number >= shownCount()) return;
    choose(number);
    const top = list.getBoundingClientRect().top + number * height;
    const room = window.innerHeight - height;
    if (top < 0 || top > room) window.scrollBy({ top: top - Math.max(0, room / 2), behavior: "instant" });
    draw();
    link(number).focus({ preventScroll: true });
  }

  // The first item in sight, where a walk through the list starts.
  function step(by) {
    if (current >= 0) return go(current + by);
    const top = list.getBoundingClientRect().top;
    return go(Math.min(shownCount() - 1, Math.max(0, Math.ceil(-top / height))));
  }

  list.addEventListener("focusin", (event) => {
    const item = event.target.closest(".fail-item");
    if (item) choose(Number(item.dataset.number));
  });
  list.addEventListener("click", (event) => {
    const item = event.target.closest(".fail-item");
    const marking = !getSelection().isCollapsed; // the visitor marks a text
    if (item && !marking && !event.target.closest("a")) go(Number(item.dataset.number));
  });
  let asked = false;
  function later() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  }
  window.addEventListener("scroll", later, { passive: true });
  new ResizeObserver(() => {
    const before = height;
    measure();
    if (height !== before) {
      items.forEach((item, number) => {
        item.style.top = `${number * height}px`;
      });
    }
    later();
  }).observe(list.parentNode);
  window.addEventListener("resize", later);

  // On paper stand the first ones, one after the other.
  window.addEventListener("beforeprint", () => {
    paper = true;
    draw();
    const note = document.getElementById("fail-printed");
    note.textContent = places.length ? TEXT.printed(Math.min(PRINTED, shownCount()), places.length) : "";
  });
  window.addEventListener("afterprint", () => {
    paper = false;
    draw();
  });

  window.COOOLER_FAILURE_LIST = {
    MOST,
    show,
    step,
    at: () => (current < 0 ? -1 : places[current]),
    link: () => (current < 0 || !items.has(current) ? null : link(current)),
    to: (at) => go(places.indexOf(at)),
    clear: () => choose(-1),
    inSight: () => !list.hidden && list.getBoundingClientRect().top < window.innerHeight * 0.7,
    onMove: (then) => {
      moved = then;
    },
  };
})();
