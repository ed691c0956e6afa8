// Every word that the compare page's scripts write, and numbers as words.
(function () {
  "use strict";
  const whole = (n) => n.toLocaleString("en");
  const plural = (n, word) => `${whole(n)} ${word}${n === 1 ? "" : "s"}`;

  // A difference with its sign; none for what rounds to zero.
  function signed(value, digits = 4) {
    const text = Math.abs(value).toFixed(digits);
    if (Number(text) === 0) return text;
    return (value < 0 ? "\u2212" : "+") + text;
  }
  // Rounded as Python does it, so that script and page never differ in the last digit.
  const ONE_DIGIT = { minimumFractionDigits: 1, maximumFractionDigits: 1, roundingMode: "halfEven" };
  const percent = (value) => `${(value * 100).toLocaleString("en", ONE_DIGIT)}\u202f%`;
  const isRate = (key) => key === "detection_rate" || key === "hazard_recall" || key === "detection";
  const value = (key, number) => (isRate(key) ? percent(number) : number.toFixed(4));
  const difference = (key, number) => (isRate(key) ? signed(number * 100, 1) : signed(number));
  const p = (number) => (number < 0.001 ? "< 0.001" : number.toFixed(3));
  const size = (key, number) => difference(key, Math.abs(number)).replace("+", "")
    + (isRate(key) ? ` ${TEXT.points}` : "");

  const TEXT = {
    metric: {
      besm: "BESM",
      sam: "SAM",
      best: "best similarity",
      detection: "detection rate",
      detection_rate: "Detection rate",
      hazard_recall: "Hazard recall",
    },
    points: "points",
    range: (low, high) => `${low} to ${high}`,
    none: "–",
    ahead: (metric, by) => ` by ${by} in ${metric}: `,
    isAhead: " is ahead of ",
    level: (metric, both) => ` have the same ${metric}, ${both}.`,
    and: " and ",
    against: (one, other) => `${one} against ${other}.`,
    chance: (number) => " Chance alone makes a difference this large with"
      + ` p ${number < 0.001 ? "" : "= "}${p(number)}:`,
    apart: " the two can be told apart.",
    notApart: " the two cannot be told apart.",
    untested: (tested) => ` The paired tests come with this page for the ${tested} best systems only;`
      + " the command “coooler compare” makes them for any two.",
    noTest: " Best similarity is what detection goes by; there is no test of it alone.",
    tally: (wins, losses, ties) => ` A is better in ${plural(wins, "video")}, B in ${whole(losses)};`
      + ` they are equal in ${whole(ties)}.`,
    detected: "detected",
    missed: "not detected",
    rightlySilent: "rightly silent",
    falseAlarm: "false alarm",
    noHazard: "No hazard",
    silent: "(says nothing)",
    closest: (count) => `closest of ${count} captions`,
    picture: (video, labels) => `A keyframe of ${video}: ${labels}`,
    noPicture: "No picture",
    onlyA: "only A",
    onlyB: "only B",
    same: "same",
    unreadable: "could not be loaded",
    count: (shown, all, videos) => (all < videos ? `${whole(all)} of ` : "") + plural(videos, "video")
      + (shown < all ? `; the first ${whole(shown)} are shown` : ""),
    more: (next, left) => `Show ${whole(next)} more (${whole(left)} left)`,
    nothing: "No video is of this kind.",
    axis: (metric, videos) => `${metric}, A − B, in ${plural(videos, "video")}`,
    betterA: (name) => `A better: ${name}`,
    betterB: (name) => `B better: ${name}`,
    mean: (text) => `mean ${text}`,
    chart: (metric, a, b) => `Bar chart: ${metric} of ${a} minus that of ${b} in every video, largest first`,
    summary: (wins, losses, ties) => `A is better in ${plural(wins, "video")}, B in ${whole(losses)};`
      + ` ${whole(ties)} equal.`,
    extreme: (letter, most, video) => ` ${letter} is furthest ahead in ${video}, ${most}.`,
    band: " The grey band is the 95 % interval of the mean.",
    below: " All numbers are in the list below.",
    swapped: (a, b) => `Swapped: A is now ${a}, B ${b}.`,
    copied: "The link is copied; it holds systems, score, filter and order.",
    notCopied: (link) => `This browser does not let pages copy. The link: ${link}`,
    exported: (name) => `Saved as ${name}.`,
    unknown: (names) => `The link names what is not here: ${names}. The nearest is shown instead.`,
    unloaded: "The data of this page could not be loaded."
      + " Reload it, or get the whole folder of the site again.",
    all: (n) => `all ${n}`,
    some: (n, of) => `${n} of ${of}`,
    noneOf: "none",
    rest: (n) => `and ${whole(n)} more`,
    sets: (n) => `${plural(n, "more set")} of systems, with fewer videos, not shown.`,
    solves: (n, row, column) => `${plural(n, "video")} that ${row} detects and ${column} does not`,
  };

  function add(parent, kind, words = "", className = "") {
    const made = document.createElement(kind);
    made.textContent = words;
    if (className) made.className = className;
    return parent.appendChild(made);
  }

  window.COOOLER_WORDS = { TEXT, add, whole, signed, percent, isRate, value, difference, p, size };
})();
