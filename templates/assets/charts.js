// Draws the page's figures with plotly; colours named "--x" are looked up in the page's style.
(function () {
  "use strict";
  var figures = window.COOOLER_FIGURES || {};
  var i18n = window.COOOLER_I18N;
  var style;

  function coloured(value) {
    if (Array.isArray(value)) return value.map(coloured);
    if (value && typeof value === "object") {
      var copy = {};
      Object.keys(value).forEach(function (key) {
        copy[key] = coloured(value[key]);
      });
      return copy;
    }
    if (typeof value === "string" && /^--[a-z0-9-]+$/.test(value)) return style.getPropertyValue(value).trim();
    return value;
  }

  function axis(given) {
    return Object.assign(
      {
        gridcolor: "--line",
        linecolor: "--line-strong",
        zeroline: false,
        tickcolor: "--line-strong",
        automargin: true,
        fixedrange: true,
      },
      given
    );
  }

  function draw(place) {
    var figure = figures[place.dataset.figure];
    if (!figure || !window.Plotly) return;
    style = getComputedStyle(document.documentElement);
    var layout = Object.assign({}, figure.layout, {
      xaxis: axis(figure.layout.xaxis),
      yaxis: axis(figure.layout.yaxis),
      margin: { l: 48, r: 16, t: 12, b: 44 },
      height: 320,
      separators: i18n.fixed(0.5, 1)[1] + i18n.whole(1000)[1],
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: getComputedStyle(document.body).fontFamily, size: 13, color: "--ink" },
      hoverlabel: { bgcolor: "--surface", bordercolor: "--line-strong", font: { color: "--ink" } },
      legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 12 } },
    });
    window.Plotly.react(place, coloured(figure.data), coloured(layout), {
      displayModeBar: false,
      responsive: true,
      scrollZoom: false,
    });
  }

  function drawAll() {
    document.querySelectorAll("[data-figure]").forEach(draw);
  }

  drawAll();
  document.addEventListener("coooler:theme", drawAll);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
})();
