// The rows of the leaderboard as the page came with them, best first.
(function () {
  "use strict";
  const clean = (text) => text.replace(/\s*\n\s*/g, " ").trim();
  window.COOOLER_ROWS = (table, ...given) =>
    Array.from(table.tBodies[0].rows, (element, place) => row(element, place, ...given));

  function row(element, place, columns, titles, measures) {
    const cells = {};
    columns.forEach((column, number) => {
      const cell = element.cells[number];
      const range = cell.querySelector(".range");
      const interval = range && Array.from(range.childNodes)
        .filter((node) => node.nodeType === Node.TEXT_NODE).map((node) => clean(node.data)).join("");
      cells[column] = {
        cell,
        nodes: Array.from(cell.childNodes),
        value: Number(cell.dataset.value),
        text: clean(range ? cell.firstChild.data : cell.textContent),
        interval: interval || "",
      };
    });
    const link = element.querySelector("th a");
    const { redrawn } = cells;
    return {
      element,
      place,
      cells,
      slug: element.dataset.slug,
      part: Number(element.dataset.part),
      name: link.textContent,
      href: link.getAttribute("href"),
      rank: cells.rank.text,
      redrawn: [redrawn.text, ` (${redrawn.interval})`],
      measures: measures.map((column) => ({
        column,
        text: titles[columns.indexOf(column)],
        value: cells[column].text,
        interval: cells[column].interval,
      })),
      open: false,
      values: {},
      texts: {},
    };
  }
})();
