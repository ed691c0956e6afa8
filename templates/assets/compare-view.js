// What is said of two systems as wholes: in words, as a table of tests, as a chart.
(function () {
  "use strict";
  const { TEXT, add, whole, points, value, difference, p, size } = window.COOOLER_WORDS;
  const data = window.COOOLER_COMPARE;
  const chart = window.COOOLER_CHART;
  const page = (id) => document.getElementById(id);
  const TESTED_BY = { besm: "besm", sam: "sam", detection: "detection_rate" };
  const CURSOR = "M0 47l-5 -7h10z";
  let found = null; // as compare.js makes it
  let made = null; // the chart's picture
  let width = 0;
  let picked = () => {};

  function show(next) {
    found = next;
    showWords();
    showTests();
    showChart();
  }

  // The test of the chosen score; null where there is none.
  function test() {
    const key = TESTED_BY[found.metric];
    return found.tests && key ? found.tests[key] : null;
  }

  function named(parent, letter) {
    add(parent, "b", found[letter].name);
    parent.append(" ");
    add(parent, "span", letter.toUpperCase(), `duel-mark duel-${letter}`);
  }

  // A sentence with the names of two at {one} and {other}.
  function tell(parent, sentence, letters) {
    sentence.split(/\{(one|other)\}/).forEach((part, number) => {
      if (number % 2) named(parent, letters[part]);
      else parent.append(part);
    });
  }

  function showWords() {
    const words = page("duel-words");
    const { metric } = found;
    const index = data.index();
    const number = index.metrics.indexOf(TESTED_BY[metric]);
    const [a, b] = number < 0 ? found.means : [found.a.cards[number], found.b.cards[number]];
    words.textContent = "";
    const name = TEXT.metric[metric];
    if (Math.abs(a - b) < 1e-9) tell(words, TEXT.level(name, value(metric, a)), { one: "a", other: "b" });
    else {
      const [high, low] = [Math.max(a, b), Math.min(a, b)].map((number) => value(metric, number));
      const letters = a > b ? { one: "a", other: "b" } : { one: "b", other: "a" };
      tell(words, TEXT.ahead(name, size(metric, a - b), high, low), letters);
    }
    const tested = test();
    if (tested) {
      words.append(` ${TEXT.chance(tested.p_randomisation)} `);
      add(words, "b", tested.p_randomisation < index.significant ? TEXT.apart : TEXT.notApart);
    } else words.append(` ${number < 0 ? TEXT.noTest : TEXT.untested(index.tested)}`);
    words.append(` ${TEXT.tally(...["a-better", "b-better", "equal"].map(found.count))}`);
  }

  function showTests() {
    const body = page("duel-tests").tBodies[0];
    body.textContent = "";
    data.index().metrics.forEach((key, number) => {
      const [a, b] = [found.a.cards[number], found.b.cards[number]];
      if (a === null) return; // without a hazard there is no recall
      const row = add(body, "tr", "", TESTED_BY[found.metric] === key ? "duel-chosen" : "");
      add(row, "th", TEXT.metric[key]).scope = "row";
      const cells = [value(key, a), value(key, b), points(key, difference(key, a - b))];
      const tested = found.tests && found.tests[key];
      if (tested) {
        const { interval, p_randomisation: chance, wins, losses, ties } = tested;
        cells.push(TEXT.range(difference(key, interval.low), difference(key, interval.high)), p(chance));
        cells.push(...[wins, losses, ties].map(whole));
      } else cells.push(...new Array(5).fill(TEXT.none));
      cells.forEach((text) => add(row, "td", text, "n"));
    });
  }

  function showChart() {
    const { a, b, metric, places, differences, means } = found;
    const { scale } = data.index();
    const tested = test();
    const about = {
      values: places.map((video) => differences[video] / scale),
      a: a.name,
      b: b.name,
      key: metric,
      metric: TEXT.title[metric],
      mean: means[0] - means[1],
      interval: tested && tested.interval,
    };
    const plot = page("duel-plot");
    width = plot.clientWidth;
    made = chart.scene(about, Math.max(280, width));
    const picture = chart.onPage(made);
    picture.setAttribute("role", "img");
    picture.setAttribute("aria-label", TEXT.chart(about.metric, about.a, about.b));
    picture.setAttribute("aria-describedby", "duel-summary");
    plot.replaceChildren(picture);
    summarise(about.values, tested);
  }

  async function summarise(values, tested) {
    const now = found;
    const counts = ["a-better", "b-better", "equal"].map(found.count);
    const words = [TEXT.summary(...counts)];
    if (found.metric !== "detection") {
      const ends = [0, values.length - 1];
      const videos = await Promise.all(ends.map((end) => data.video(found.places[end]))).catch(() => []);
      if (now !== found) return;
      ends.forEach((end, number) => {
        if (!counts[number] || !videos.length) return;
        words.push(TEXT.extreme("AB"[number], difference(found.metric, values[end]), videos[number].shown));
      });
    }
    if (tested) words.push(TEXT.band);
    page("duel-summary").textContent = [...words, TEXT.below].join(" ");
  }

  // Marks a video in the chart.
  function mark(video) {
    const picture = page("duel-plot").firstElementChild;
    const old = picture.querySelector(".duel-cursor");
    if (old) old.remove();
    const cursor = document.createElementNS(picture.namespaceURI, "path");
    cursor.setAttribute("class", "duel-cursor");
    cursor.setAttribute("d", CURSOR);
    const x = chart.left + (found.places.indexOf(video) + 0.5) * made.step;
    cursor.setAttribute("transform", `translate(${x} 0)`);
    picture.append(cursor);
  }

  page("duel-plot").addEventListener("click", (event) => {
    const frame = page("duel-plot").firstElementChild.getBoundingClientRect();
    const x = ((event.clientX - frame.left) * made.width) / frame.width;
    const place = chart.placeAt(made, x, found.places.length);
    if (place >= 0) picked(found.places[place]);
  });
  new ResizeObserver(() => {
    const now = page("duel-plot").clientWidth;
    if (found && now && now !== width) showChart();
  }).observe(page("duel-plot"));

  window.COOOLER_VIEW = {
    show,
    mark,
    svg: () => chart.file(made),
    png: () => chart.png(made),
    onPick: (then) => {
      picked = then;
    },
  };
})();
