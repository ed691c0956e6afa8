// Every word that the leaderboard's scripts write.
(function () {
  "use strict";
  const { _ } = window.COOOLER_I18N;
  const METRIC = { besm: "BESM", sam: "SAM", detection: _("detection"), recall: _("hazard recall") };
  const TEXT = {
    ranked: (metric) => _("Ranked by {metric}; equal scores share a rank. Bands of systems that cannot be "
      + "told apart, and redrawn ranks, are those of BESM.", { metric: METRIC[metric] }),
    elsewhere: (now, published) => _("Detection and hazard recall are counted above {now}. Their intervals, "
      + "and any band, belong to the published threshold, {published}, and are not shown for another. "
      + "BESM and SAM do not depend on it.", { now, published }),
    above: (threshold) => _("Detected above {threshold}.", { threshold }),
    published: (value) => _("published {value}", { value }),
    none: "–",
    loading: _("Reading the data of this board."),
    unloaded: _("The data of this board could not be read; the table shows what is published."),
    unknown: (words) => _("This link names what this board does not have: {words}.", { words }),
    copied: {
      markdown: _("The table as Markdown copied."),
      latex: _("The table as LaTeX copied."),
      link: _("The link copied."),
    },
    byHand: _("The clipboard is closed to this page; the text is in the window for you to copy."),
    details: (name) => _("Details of {name}", { name }),
    detail: {
      above: (metric, threshold) => _("{metric} above {threshold}", { metric, threshold }),
      interval: (interval) => _("95 % interval {interval}", { interval }),
      place: _("Rank by BESM"),
      redrawn: _("Rank redrawn"),
      probes: _("Probes that speak"),
      noProbe: _("None"),
      best: _("Best video"),
      worst: _("Worst video"),
      signature: _("Signature"),
      page: (name) => _("All of {name}", { name }),
      besm: (value) => `BESM ${value}`,
    },
    notes: {
      interval: _("In brackets: 95 % intervals over the videos."),
      booktabs: _("needs {command}", { command: "\\usepackage{booktabs}" }),
      signature: (text) => _("Signature: {text}", { text }),
    },
  };

  window.COOOLER_WORDS = { TEXT };
})();
