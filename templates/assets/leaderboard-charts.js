// Loads plotly, which is large, when the charts come near what is in view, or some time after the page.
(function () {
  "use strict";
  const REST_MS = 1500;
  const place = document.querySelector("[data-scripts]");
  let asked = false;

  function load() {
    if (asked) return;
    asked = true;
    place.dataset.scripts.split(" ").forEach((address) => {
      const script = document.createElement("script");
      script.src = address;
      script.async = false; // in this order
      document.head.append(script);
    });
  }

  function watch() {
    const near = new IntersectionObserver((seen) => {
      if (!seen.some((one) => one.isIntersecting)) return;
      near.disconnect();
      load();
    }, { rootMargin: "600px 0px" });
    near.observe(place);
    const saving = navigator.connection && navigator.connection.saveData;
    if (!saving && window.requestIdleCallback) setTimeout(() => requestIdleCallback(load), REST_MS);
  }

  if (document.readyState === "complete") watch();
  else addEventListener("load", watch);
})();
