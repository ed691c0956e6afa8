// Every word that the failures page's scripts write, and numbers as words.
(function () {
  "use strict";
  const whole = (n) => n.toLocaleString("en");
  const plural = (n, word) => `${whole(n)} ${word}${n === 1 ? "" : "s"}`;
  const percent = (done, all) => `${all ? Math.floor((done / all) * 100) : 100}\u202f%`;

  const TEXT = {
    facets: {
      kind: "Kind",
      system: "System",
      score: "Similarity",
      label: "Truth label",
      size: "Hazard’s size",
      stages: "Stages",
      video: "Video",
    },
    search: "Search",
    found: (shown, all) => `${shown === all ? "" : `${whole(shown)} of `}${plural(all, "failure")}`,
    capped: (most) => `The first ${whole(most)} can be scrolled to; filter to see the others.`,
    loading: (done, all) => `Loading failures: ${percent(done, all)}. Numbers grow until all are here.`,
    reading: (done, all) => `Searching captions: ${percent(done, all)} read.`,
    unloaded: "Some data could not be loaded, so that numbers are too low. Load the page again.",
    unreadable: "could not be loaded",
    unknown: (what) => `The address asks for what is not here: ${what}.`,
    copied: "Link copied.",
    notCopied: (link) => `The browser does not let this page copy. The link: ${link}`,
    more: (n) => `Show ${whole(n)} more`,
    find: (facet) => `Find: ${facet.toLowerCase()}`,
    findNone: "Nothing of this name.",
    remove: "remove",
    filters: (n) => (n ? `Filters (${n} chosen)` : "Filters"),
    said: "Caption",
    silent: "Said nothing",
    truth: "Truth",
    evidence: "Evidence",
    noHazard: "No hazard",
    similarity: "best similarity",
    noPicture: "No picture",
    picture: (video, labels) => `A keyframe of ${video}: ${labels}`,
    wait: "…",
    printed: (shown, all) => `Printed: the first ${whole(shown)} of ${plural(all, "failure")}.`,
  };

  function add(parent, tag, text, kind) {
    const made = document.createElement(tag);
    if (text) made.textContent = text;
    if (kind) made.className = kind;
    return parent.appendChild(made);
  }

  window.COOOLER_FAILURE_WORDS = { TEXT, whole, add };
})();
