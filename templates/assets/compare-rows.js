// The list of videos of the compare page: a few rows, then a hundred at a time; captions when they come near.
(function () {
  "use strict";
  const { TEXT, add, value, difference } = window.COOOLER_WORDS;
  const data = window.COOOLER_COMPARE;
  const FIRST = 20;
  const PAGE = 100;
  const SOON_MS = 400;
  const SVG = "http://www.w3.org/2000/svg";
  const list = document.getElementById("duel-rows");
  const more = document.getElementById("duel-more");
  const count = document.getElementById("duel-count");
  let view = null; // {a, b: {slug, scores}, metric, differences, order, peak}, all places are of videos
  let moved = () => {};
  let current = -1; // a number in view.order

  function show(next) {
    view = next;
    current = -1;
    list.textContent = "";
    observer.disconnect();
    extend(FIRST);
    // All of the first rows get their captions soon, so that they can be printed.
    const first = Array.from(list.children);
    setTimeout(() => first.forEach(captions), SOON_MS);
  }

  function extend(wanted) {
    const shown = list.children.length;
    const rows = view.order.slice(shown, shown + wanted).map(row);
    list.append(...rows);
    rows.forEach((made) => observer.observe(made));
    const total = view.order.length;
    const left = total - list.children.length;
    more.hidden = left === 0;
    more.textContent = TEXT.more(Math.min(PAGE, left), left);
    const videos = view.differences.length;
    count.textContent = total ? TEXT.count(list.children.length, total, videos) : TEXT.nothing;
  }
  more.addEventListener("click", () => {
    const next = list.children.length;
    extend(PAGE);
    go(next);
  });

  function row(place) {
    const made = document.createElement("li");
    made.className = "duel-row";
    const link = add(made, "a", "", "duel-video");
    add(link, "span", "", "duel-picture");
    add(link, "span", "", "duel-id");
    add(made, "p", "", "duel-label sub");
    const verdicts = ["a", "b"].map((letter) => side(made, letter, place));
    made.append(gap(place));
    fill(made, link, verdicts, place);
    made.dataset.place = place;
    return made;
  }

  function side(made, letter, place) {
    const { scores } = view[letter];
    const box = add(made, "div", "", "duel-side");
    const line = add(box, "p", "", "duel-score");
    add(line, "span", letter.toUpperCase(), `duel-mark duel-${letter}`);
    const shown = view.metric === "detection" ? "best" : view.metric;
    add(line, "b", value(shown, scores[shown][place] / view.scale), "num");
    const detected = scores.detection[place] > 0;
    const words = detected ? TEXT.detected : TEXT.missed;
    const verdict = add(line, "span", words, `duel-verdict ${detected ? "pass" : "fail"}`);
    add(box, "p", "", "duel-caption");
    return { verdict, detected };
  }

  function draw(parent, kind, attributes) {
    const shape = parent.appendChild(document.createElementNS(SVG, kind));
    Object.entries(attributes).forEach(([name, text]) => shape.setAttribute(name, text));
    return shape;
  }

  // The difference as words and as a bar from the middle: to the right when A is better.
  function gap(place) {
    const box = document.createElement("div");
    box.className = "duel-gap";
    const number = view.differences[place];
    const words = view.metric === "detection" ? [TEXT.onlyB, TEXT.same, TEXT.onlyA][Math.sign(number) + 1]
      : difference(view.metric, number / view.scale);
    add(box, "b", words, "num");
    const frame = { viewBox: "-50 0 100 6", preserveAspectRatio: "none", "aria-hidden": "true" };
    const bar = draw(box, "svg", { class: "bar", ...frame });
    const width = view.peak ? Math.round((Math.abs(number) / view.peak) * 500) / 10 : 0;
    const [side, x] = number > 0 ? ["a", 0] : ["b", -width];
    draw(bar, "rect", { class: "bar-full", x: -50, width: 100, height: 6 });
    draw(bar, "rect", { class: `duel-bar-${side}`, x, width, height: 6 });
    draw(bar, "path", { class: "bar-mark", d: "M0 -1V7" });
    return box;
  }

  async function fill(made, link, verdicts, place) {
    let video;
    try {
      video = await data.video(place);
    } catch (error) {
      made.querySelector(".duel-label").textContent = TEXT.unreadable;
      return;
    }
    const labels = video.labels || TEXT.noHazard;
    link.href = video.href;
    made.querySelector(".duel-id").textContent = video.shown;
    made.querySelector(".duel-label").textContent = labels;
    const frame = made.querySelector(".duel-picture");
    if (video.card) {
      const picture = add(frame, "img");
      picture.loading = "lazy";
      picture.decoding = "async";
      picture.alt = TEXT.picture(video.shown, labels);
      [picture.width, picture.height] = [400, 225];
      picture.src = video.card;
    } else add(frame, "span", TEXT.noPicture, "sub");
    if (!video.labels) {
      verdicts.forEach(({ verdict, detected }) => {
        verdict.textContent = detected ? TEXT.rightlySilent : TEXT.falseAlarm;
      });
    }
  }

  function captions(made) {
    if (!made.isConnected || made.dataset.told) return;
    made.dataset.told = "yes";
    const place = Number(made.dataset.place);
    const { a, b } = view;
    const boxes = made.querySelectorAll(".duel-caption");
    [a, b].forEach(async ({ slug }, number) => {
      const box = boxes[number];
      try {
        const found = await data.caption(slug, place);
        box.textContent = found ? found[0] : TEXT.silent;
        box.classList.toggle("duel-silent", !found);
        if (found && found[1] > 1) add(box, "span", TEXT.closest(found[1]), "sub");
      } catch (error) {
        box.textContent = TEXT.unreadable;
      }
    });
  }

  const observer = new IntersectionObserver((entries) => {
    entries.filter((entry) => entry.isIntersecting).forEach(({ target }) => {
      observer.unobserve(target);
      captions(target);
    });
  }, { rootMargin: "600px 0px" });

  // To a row by its number; rows before it that are not there yet are made.
  function go(number) {
    if (number < 0 || number >= view.order.length) return;
    if (number >= list.children.length) extend(Math.ceil((number + 1 - list.children.length) / PAGE) * PAGE);
    const link = list.children[number].querySelector(".duel-video");
    if (!link.href) link.tabIndex = 0; // not loaded yet
    link.focus();
  }

  list.addEventListener("focusin", (event) => {
    const made = event.target.closest(".duel-row");
    if (!made) return;
    const before = list.querySelector(".duel-here");
    if (before) before.classList.remove("duel-here");
    made.classList.add("duel-here");
    current = Array.prototype.indexOf.call(list.children, made);
    moved(Number(made.dataset.place));
  });

  // A video that is opened from here is followed by the others of the list, in its order.
  list.addEventListener("click", (event) => {
    if (!event.target.closest(".duel-video[href]")) return;
    const links = list.querySelectorAll(".duel-video[href]");
    const ids = Array.from(links, (link) => link.getAttribute("href").split("#")[0]);
    const walk = { ids, from: location.href, title: count.textContent };
    try {
      sessionStorage.setItem("coooler-walk", JSON.stringify(walk));
    } catch (error) {
      // Then videos follow each other in the usual order.
    }
  });

  window.COOOLER_ROWS = {
    show,
    step: (by) => go(current < 0 && by < 0 ? 0 : current + by),
    to: (place) => go(view.order.indexOf(place)),
    link: () => (current < 0 ? null : list.children[current].querySelector(".duel-video")),
    onMove: (then) => {
      moved = then;
    },
  };
})();
