// Every word that the failures page's scripts write.
(function () {
  "use strict";
  const { _, plural, whole, fixed } = window.COOOLER_I18N;
  const percent = (done, all) => `${whole(all ? Math.floor((done / all) * 100) : 100)}\u202f%`;
  const failures = (n) => plural(n, "{n} failure", "{n} failures");

  const TEXT = {
    facets: {
      kind: _("Kind"),
      system: _("System"),
      score: _("Similarity"),
      label: _("Truth label"),
      size: _("Hazard’s size"),
      stages: _("Stages"),
      video: _("Video"),
    },
    find: {
      kind: _("Find: kind"),
      system: _("Find: system"),
      score: _("Find: similarity"),
      label: _("Find: truth label"),
      size: _("Find: hazard’s size"),
      stages: _("Find: stages"),
      video: _("Find: video"),
    },
    found: (shown, all) => (shown === all ? failures(all)
      : plural(all, "{shown} of {n} failure", "{shown} of {n} failures", { shown: whole(shown) })),
    capped: (most) =>
      _("The first {n} can be scrolled to; filter to see the others.", { n: whole(most) }),
    loading: (done, all) =>
      _("Loading failures: {part}. Numbers grow until all are here.", { part: percent(done, all) }),
    reading: (done, all) => _("Searching captions: {part} read.", { part: percent(done, all) }),
    unloaded: _("Some data could not be loaded, so that numbers are too low. Load the page again."),
    unreadable: _("could not be loaded"),
    unknown: (what) => _("The address asks for what is not here: {what}.", { what }),
    copied: _("Link copied."),
    notCopied: (link) => _("The browser does not let this page copy. The link: {link}", { link }),
    more: (n) => plural(n, "Show {n} more", "Show {n} more"),
    findNone: _("Nothing of this name."),
    chosen: (facet, value) => _("{facet}: {value}", { facet, value }),
    remove: (words) => _("{words}, remove", { words }),
    filters: (n) => (n ? plural(n, "Filters ({n} chosen)", "Filters ({n} chosen)") : _("Filters")),
    said: _("Caption:"),
    silent: _("Said nothing"),
    truth: _("Truth:"),
    evidence: _("Evidence:"),
    noHazard: _("No hazard"),
    similarity: _("best similarity"),
    noPicture: _("No picture"),
    picture: (video, labels) => _("A keyframe of {video}: {labels}", { video, labels }),
    wait: "…",
    printed: (shown, all) => plural(
      all,
      "Printed: the first {shown} of {n} failure.",
      "Printed: the first {shown} of {n} failures.",
      { shown: whole(shown) },
    ),
  };

  function add(parent, tag, text, kind) {
    const made = document.createElement(tag);
    if (text) made.textContent = text;
    if (kind) made.className = kind;
    return parent.appendChild(made);
  }

  window.COOOLER_FAILURE_WORDS = { TEXT, whole, fixed, add };
})();
