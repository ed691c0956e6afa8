// Every word that the leaderboard's scripts write, and numbers as words.
(function () {
  "use strict";
  // As Python prints it: of two texts equally near, the one that ends in an even digit.
  function percent(share) {
    const value = share * 100;
    return `${(value % 1 === 0.25 ? value - 0.05 : value).toFixed(1)}\u202f%`;
  }

  const METRIC = { besm: "BESM", sam: "SAM", detection: "detection", recall: "hazard recall" };
  const TEXT = {
    metric: METRIC,
    ranked: (metric) => `Ranked by ${METRIC[metric]}; equal scores share a rank. `
      + "Bands of systems that cannot be told apart, and redrawn ranks, are those of BESM. ",
    elsewhere: (now, published) => `Detection and hazard recall are counted above ${now}. `
      + `Their intervals, and any band, belong to the published threshold, ${published}, `
      + "and are not shown for another. BESM and SAM do not depend on it.",
    above: (now) => `Detected above ${now}.`,
    published: (value) => `published ${value}`,
    none: "–",
    loading: "Reading the data of this board.",
    unloaded: "The data of this board could not be read; the table shows what is published.",
    unknown: (words) => `This link names what this board does not have: ${words}.`,
    copied: (what) => `${what} copied.`,
    byHand: "The clipboard is closed to this page; the text is in the window for you to copy.",
    names: { markdown: "The table as Markdown", latex: "The table as LaTeX", link: "The link" },
    details: (name) => `Details of ${name}`,
    detail: {
      above: (metric, threshold) => `${metric} above ${threshold}`,
      interval: "95 % interval",
      place: "Rank by BESM",
      redrawn: "Rank redrawn",
      first: "first in",
      probes: "Probes that speak",
      noProbe: "None",
      best: "Best video",
      worst: "Worst video",
      signature: "Signature",
      page: (name) => `All of ${name}`,
      besm: (value) => ` BESM ${value}`,
    },
    notes: {
      interval: "In brackets: 95 % intervals over the videos.",
      booktabs: "needs \\usepackage{booktabs}",
      signature: (text) => `Signature: ${text}`,
    },
  };

  window.COOOLER_WORDS = { TEXT, percent };
})();
