// Runs before the first paint: the remembered theme, and a mark that scripts run.
(function () {
  "use strict";
  var root = document.documentElement;
  root.classList.add("js");
  try {
    var kept = localStorage.getItem("coooler-theme");
    if (kept === "light" || kept === "dark") root.dataset.theme = kept;
  } catch (error) {
    // Storage may be forbidden; the system's theme is fine then.
  }
})();
