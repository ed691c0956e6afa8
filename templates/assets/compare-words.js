// Every word that the compare page's scripts write, and differences as words.
(function () {
  "use strict";
  const { _, plural, whole, fixed, percent } = window.COOOLER_I18N;

  // A difference with its sign; none for what rounds to zero.
  function signed(value, digits = 4) {
    const size = Math.abs(value).toFixed(digits);
    const sign = value < 0 ? "\u2212" : "+";
    return (Number(size) === 0 ? "" : sign) + fixed(Math.abs(value), digits);
  }
  const isRate = (key) => key === "detection_rate" || key === "hazard_recall" || key === "detection";
  const points = (key, number) => (isRate(key) ? _("{number} points", { number }) : number);
  const value = (key, number) => (isRate(key) ? percent(number) : fixed(number, 4));
  const difference = (key, number) => (isRate(key) ? signed(number * 100, 1) : signed(number));
  const p = (number) => (number < 0.001 ? `< ${fixed(0.001, 3)}` : fixed(number, 3));
  const size = (key, number) => points(key, difference(key, Math.abs(number)).replace("+", ""));
  const videos = (n) => plural(n, "{n} video", "{n} videos");

  const TEXT = {
    metric: {
      besm: "BESM",
      sam: "SAM",
      best: _("best similarity"),
      detection: _("detection rate"),
      detection_rate: _("Detection rate"),
      hazard_recall: _("Hazard recall"),
    },
    title: { besm: "BESM", sam: "SAM", best: _("Best similarity"), detection: _("Detection rate") },
    range: (low, high) => _("{low} to {high}", { low, high }),
    none: "–",
    // Names go to {one} and {other} as elements, later.
    ahead: (metric, by, high, low) =>
      _("{one} is ahead of {other} by {by} in {metric}: {high} against {low}.", { metric, by, high, low }),
    level: (metric, both) => _("{one} and {other} have the same {metric}, {both}.", { metric, both }),
    chance: (number) => _("Chance alone makes a difference this large with p {p}:",
      { p: number < 0.001 ? p(number) : `= ${p(number)}` }),
    apart: _("the two can be told apart."),
    notApart: _("the two cannot be told apart."),
    untested: (tested) => _("The paired tests come with this page for the {tested} best systems only; the "
      + "command “coooler compare” makes them for any two.", { tested: whole(tested) }),
    noTest: _("Best similarity is what detection goes by; there is no test of it alone."),
    tally: (wins, losses, ties) => plural(
      wins,
      "A is better in {n} video, B in {losses}; they are equal in {ties}.",
      "A is better in {n} videos, B in {losses}; they are equal in {ties}.",
      { losses: whole(losses), ties: whole(ties) },
    ),
    detected: _("detected"),
    missed: _("not detected"),
    rightlySilent: _("rightly silent"),
    falseAlarm: _("false alarm"),
    noHazard: _("No hazard"),
    silent: _("(says nothing)"),
    closest: (count) => plural(count, "closest of {n} caption", "closest of {n} captions"),
    picture: (video, labels) => _("A keyframe of {video}: {labels}", { video, labels }),
    noPicture: _("No picture"),
    onlyA: _("only A"),
    onlyB: _("only B"),
    same: _("same"),
    unreadable: _("could not be loaded"),
    count(shown, all, of) {
      const count = all === of ? videos(of)
        : plural(of, "{part} of {n} video", "{part} of {n} videos", { part: whole(all) });
      return shown === all ? count
        : _("{count}; the first {shown} are shown", { count, shown: whole(shown) });
    },
    more: (next, left) =>
      plural(next, "Show {n} more ({left} left)", "Show {n} more ({left} left)", { left: whole(left) }),
    nothing: _("No video is of this kind."),
    axis: (metric, n) =>
      plural(n, "{metric}, A − B, in {n} video", "{metric}, A − B, in {n} videos", { metric }),
    betterA: (name) => _("A better: {name}", { name }),
    betterB: (name) => _("B better: {name}", { name }),
    mean: (number) => _("mean {number}", { number }),
    chart: (metric, a, b) => _("Bar chart: {metric} of {a} minus that of {b} in every video, largest first",
      { metric, a, b }),
    summary: (wins, losses, ties) => plural(
      wins,
      "A is better in {n} video, B in {losses}; {ties} equal.",
      "A is better in {n} videos, B in {losses}; {ties} equal.",
      { losses: whole(losses), ties: whole(ties) },
    ),
    extreme: (letter, most, video) => _("{letter} is furthest ahead in {video}, {most}.",
      { letter, most, video }),
    band: _("The grey band is the 95 % interval of the mean."),
    below: _("All numbers are in the list below."),
    swapped: (a, b) => _("Swapped: A is now {a}, B {b}.", { a, b }),
    copied: _("The link is copied; it holds systems, score, filter and order."),
    notCopied: (link) => _("This browser does not let pages copy. The link: {link}", { link }),
    exported: (name) => _("Saved as {name}.", { name }),
    unknown: (names) =>
      _("The link names what is not here: {names}. The nearest is shown instead.", { names }),
    unloaded: _("The data of this page could not be loaded. Reload it, or get the whole folder of the site "
      + "again."),
    all: (total) => _("all {total}", { total }),
    some: (n, total) => _("{n} of {total}", { n, total }),
    noneOf: _("none"),
    rest: (n) => plural(n, "and {n} more", "and {n} more"),
    sets: (n) => plural(
      n,
      "{n} more set of systems, with fewer videos, not shown.",
      "{n} more sets of systems, with fewer videos, not shown.",
    ),
    solves: (n, row, column) => plural(
      n,
      "{n} video that {row} detects and {column} does not",
      "{n} videos that {row} detects and {column} does not",
      { row, column },
    ),
  };

  function add(parent, kind, words = "", className = "") {
    const made = document.createElement(kind);
    made.textContent = words;
    if (className) made.className = className;
    return parent.appendChild(made);
  }

  window.COOOLER_WORDS = { TEXT, add, whole, percent, points, value, difference, p, size };
})();
