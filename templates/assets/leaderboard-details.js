// What a row opens to, and the data files behind it: loaded once, by script tags, also under file://.
(function () {
  "use strict";
  const { TEXT } = window.COOOLER_WORDS;
  const words = TEXT.detail;
  const waiting = new Map();
  const asked = new Map();

  // Every data file calls this with its number and its value.
  window.COOOLER_BOARD = (number, value) => {
    const give = waiting.get(number);
    if (give) give(value);
  };

  function load(number) {
    if (!asked.has(number)) {
      const promise = new Promise((resolve, reject) => {
        const script = document.createElement("script");
        waiting.set(number, resolve);
        script.onload = script.onerror = () => reject(new Error(`${number}`)); // no effect once it came
        script.src = `data/board/${number}.js`;
        document.head.append(script);
      });
      asked.set(number, promise);
      promise.catch(() => asked.delete(number)); // so that it is asked for again
    }
    return asked.get(number);
  }

  function made(tag, className, ...content) {
    const element = document.createElement(tag);
    if (className) element.className = className;
    element.append(...content);
    return element;
  }

  function link(href, text) {
    const element = made("a", "", text);
    element.href = href;
    return element;
  }

  // One term with its value; the value is text or elements.
  const fact = (term, ...value) => made("div", "", made("dt", "", term), made("dd", "", ...value));

  function video(term, [href, name, value]) {
    return fact(term, link(href, name), made("span", "sub", ` ${words.besm(value)}`));
  }

  // What the page came with; of what depends on the threshold it says which.
  const published = document.getElementById("board-threshold-text");
  const above = published ? published.textContent : "";
  const counted = ["detection", "recall"];
  const termOf = ({ column, text }) => (above && counted.includes(column) ? words.above(text, above) : text);

  // `row` is a row as leaderboard.js knows it, `more` its part of the data file or null.
  function content(row, more, signature) {
    const figures = row.measures
      .filter((measure) => measure.interval)
      .map((measure) => {
        const interval = made("span", "sub", ` ${words.interval(measure.interval)}`);
        return fact(termOf(measure), measure.value, interval);
      });
    const facts = made("dl", "board-facts", ...figures);
    facts.append(fact(words.place, row.rank), fact(words.redrawn, ...row.redrawn));
    if (more && more.best) facts.append(video(words.best, more.best), video(words.worst, more.worst));
    const parts = [facts];
    if (more) {
      const probes = more.probes.map(([name, value, sentence]) =>
        made("li", "", made("b", "probe-speaks", name), ` ${value}. ${sentence}`));
      parts.push(made("p", "board-head", words.probes));
      parts.push(probes.length ? made("ul", "board-probes", ...probes) : made("p", "sub", words.noProbe));
    } else parts.push(made("p", "sub", TEXT.unloaded));
    if (signature) parts.push(made("p", "board-head", words.signature), made("code", "", signature));
    parts.push(made("p", "board-more", link(row.href, words.page(row.name))));
    return made("div", "board-inside", ...parts);
  }

  // A button in the row's first cell that opens a row below it; `changed` is called after each turn.
  function attach(row, signature, changed) {
    const id = `detail-${row.slug}`;
    const button = made("button", "board-open");
    button.type = "button";
    button.setAttribute("aria-expanded", "false");
    button.setAttribute("aria-label", TEXT.details(row.name));
    const cell = document.createElement("td");
    const below = made("tr", "board-detail", cell);
    below.id = id;
    let filled = false;

    function fit() {
      cell.colSpan = Array.from(row.element.cells).filter((one) => !one.hidden).length;
    }

    async function turn(open) {
      row.open = open;
      button.setAttribute("aria-expanded", `${open}`);
      if (!open) {
        button.removeAttribute("aria-controls");
        below.remove();
        changed();
        return;
      }
      button.setAttribute("aria-controls", id);
      fit();
      row.element.after(below);
      changed();
      if (filled) return;
      const board = await load(row.part).catch(() => null);
      filled = board !== null;
      cell.replaceChildren(content(row, board && board.systems[row.slug], signature));
    }

    button.addEventListener("click", () => turn(!row.open));
    row.element.cells[0].prepend(button);
    return { below, turn, fit };
  }

  window.COOOLER_DETAILS = { load, attach };
})();
