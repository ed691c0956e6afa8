// The chart of the differences: shapes and texts first, which then become SVG or a canvas.
(function () {
  "use strict";
  const { TEXT, difference } = window.COOOLER_WORDS;
  const HEIGHT = 264;
  const SIDES = { left: 56, right: 10, top: 50, bottom: 30 };
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5]; // between two lines
  const LINES = 6;
  const LETTER_PX = 6.6; // about the width of a letter at this size

  const cut = (text, width) => {
    const limit = Math.max(8, Math.floor(width / LETTER_PX));
    return text.length > limit ? `${text.slice(0, limit - 1)}…` : text;
  };
  const round = (number) => Math.round(number * 100) / 100;

  // `values` (largest first) in [-1, 1]; `interval` of their mean may be null. Colours are variables
  // of the page's style, looked up only when the picture leaves the page.
  function scene({ values, a, b, key, metric, mean, interval }, width) {
    const [most, least] = [Math.max(values[0], 0), Math.min(values[values.length - 1], 0)];
    const tick = STEPS.find((step) => Math.ceil(most / step) - Math.floor(least / step) < LINES) || 0.5;
    const above = Math.max(1, Math.ceil(most / tick - 1e-9)); // lines above zero, and below
    const below = Math.max(1, Math.ceil(-least / tick - 1e-9));
    const inner = width - SIDES.left - SIDES.right;
    const scale = (HEIGHT - SIDES.top - SIDES.bottom) / (above + below);
    const y = (value) => round(SIDES.top + (above - value / tick) * scale);
    const step = inner / values.length;
    const gap = step > 4 ? step * 0.15 : 0;
    const right = width - SIDES.right;
    const shapes = [];
    const texts = [];
    const line = (at, look) => shapes.push({ d: `M${SIDES.left} ${y(at)}H${right}`, ...look });
    const text = (x, at, words, more) => texts.push({ x, y: at, words, fill: "--muted", ...more });
    for (let number = -below; number <= above; number += 1) {
      line(number * tick, { stroke: "--line" });
      const words = difference(key, number * tick).replace(/(\D\d\d)0+$/, "$1");
      text(SIDES.left - 8, y(number * tick) + 4, words, { anchor: "end" });
    }
    const bars = (keep) => values.map((value, place) => {
      if (!keep(value)) return "";
      const from = round(SIDES.left + place * step + gap / 2);
      return `M${from} ${y(0)}V${y(value)}h${round(Math.max(step - gap, 0.3))}V${y(0)}Z`;
    }).join("");
    if (interval) {
      const [low, high] = [Math.max(interval.low, -below * tick), Math.min(interval.high, above * tick)];
      const d = `M${SIDES.left} ${y(high)}H${right}V${y(low)}H${SIDES.left}Z`;
      shapes.push({ d, fill: "--muted", opacity: 0.18 });
    }
    shapes.push({ d: bars((value) => value > 0), fill: "--chart-1" });
    shapes.push({ d: bars((value) => value < 0), fill: "--chart-2" });
    line(0, { stroke: "--line-strong" });
    line(mean, { stroke: "--ink", dash: "5 4" });
    // Where there are no bars: above the line at the end, below it at the beginning.
    const [x, off, anchor] = mean >= 0 ? [right, -5, "end"] : [SIDES.left + 4, 14, "start"];
    text(x, y(mean) + off, TEXT.mean(difference(key, mean)), { anchor, fill: "--ink", halo: true });
    text(SIDES.left, 16, cut(TEXT.betterA(a), inner), { fill: "--chart-1", bold: true });
    text(SIDES.left, 34, cut(TEXT.betterB(b), inner), { fill: "--chart-2", bold: true });
    text(SIDES.left, HEIGHT - 8, cut(TEXT.axis(metric, values.length), inner), {});
    return { width, height: HEIGHT, shapes, texts, step };
  }

  // The place among the values under a point of the picture; -1 outside.
  function placeAt(made, x, count) {
    const place = Math.floor((x - SIDES.left) / made.step);
    return place >= 0 && place < count ? place : -1;
  }

  function node(parent, kind, attributes) {
    const made = document.createElementNS(NAMESPACE, kind);
    Object.entries(attributes).forEach(([name, value]) => {
      if (value !== undefined) made.setAttribute(name, value);
    });
    return parent.appendChild(made);
  }

  // An SVG element; `colour` turns the name of a variable into a colour.
  function svg(made, colour) {
    const root = document.createElementNS(NAMESPACE, "svg");
    const { width, height } = made;
    Object.entries({ viewBox: `0 0 ${width} ${height}`, width, height }).forEach(([name, value]) => {
      root.setAttribute(name, value);
    });
    made.shapes.forEach(({ d, fill, stroke, dash, opacity }) => {
      const look = { fill: fill ? colour(fill) : "none", stroke: stroke && colour(stroke), opacity };
      node(root, "path", { d, "stroke-dasharray": dash, ...look });
    });
    made.texts.forEach(({ x, y, words, anchor, fill, bold, halo }) => {
      const look = { fill: colour(fill), "font-size": 12, "font-weight": bold ? 600 : undefined };
      const edge = halo ? { stroke: colour("--surface"), "stroke-width": 3, "paint-order": "stroke" } : {};
      node(root, "text", { x, y, "text-anchor": anchor, ...look, ...edge }).textContent = words;
    });
    return root;
  }

  // On the page colours follow the theme by themselves.
  const onPage = (made) => svg(made, (name) => `var(${name})`);

  function colours() {
    const style = getComputedStyle(document.documentElement);
    return (name) => style.getPropertyValue(name).trim();
  }
  const font = () => getComputedStyle(document.body).fontFamily;

  // The picture as the text of an SVG file, which needs no style of ours.
  function file(made) {
    const colour = colours();
    const root = svg(made, colour);
    root.setAttribute("font-family", font());
    const ground = node(root, "rect", { width: made.width, height: made.height, fill: colour("--surface") });
    root.prepend(ground);
    return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(root)}\n`;
  }

  // The picture as PNG, twice as large: a promise of a Blob.
  function png(made) {
    const colour = colours();
    const canvas = document.createElement("canvas");
    canvas.width = made.width * 2;
    canvas.height = made.height * 2;
    const pen = canvas.getContext("2d");
    pen.scale(2, 2);
    pen.fillStyle = colour("--surface");
    pen.fillRect(0, 0, made.width, made.height);
    made.shapes.forEach(({ d, fill, stroke, dash, opacity }) => {
      const path = new Path2D(d);
      pen.globalAlpha = opacity === undefined ? 1 : opacity;
      pen.setLineDash(dash ? dash.split(" ").map(Number) : []);
      if (fill) {
        pen.fillStyle = colour(fill);
        pen.fill(path);
      }
      if (stroke) {
        pen.strokeStyle = colour(stroke);
        pen.stroke(path);
      }
    });
    pen.globalAlpha = 1;
    pen.setLineDash([]);
    made.texts.forEach(({ x, y, words, anchor, fill, bold, halo }) => {
      pen.font = `${bold ? 600 : 400} 12px ${font()}`;
      pen.textAlign = anchor || "start";
      if (halo) {
        pen.strokeStyle = colour("--surface");
        pen.lineWidth = 3;
        pen.strokeText(words, x, y);
        pen.lineWidth = 1;
      }
      pen.fillStyle = colour(fill);
      pen.fillText(words, x, y);
    });
    return new Promise((resolve) => {
      canvas.toBlob(resolve, "image/png");
    });
  }

  window.COOOLER_CHART = { scene, onPage, file, png, placeAt, left: SIDES.left };
})();
