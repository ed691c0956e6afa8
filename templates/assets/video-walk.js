// A walk through the list that the visitor came from: {ids, from, title}, left by the page with the list.
(function () {
  "use strict";
  const { _ } = window.COOOLER_I18N;
  const TEXT = {
    where: (n, total, title) => _("{n} of {total} in “{title}”", { n, total, title }),
    previous: _("Previous:"),
    next: _("Next:"),
  };
  const KEY = "coooler-walk";
  const PATH = /^videos\/([A-Za-z0-9._-]{1,120})\.html$/;
  const root = new URL("../", location.href);
  const bar = document.getElementById("walk");

  // The list, when there is one with this very video in it; what is not as it should be is none.
  function read() {
    try {
      const walk = JSON.parse(sessionStorage.getItem(KEY));
      const ids = Array.from(new Set(walk.ids)).filter((path) => PATH.test(path));
      const from = new URL(walk.from, root);
      const place = ids.indexOf(`videos/${location.pathname.split("/").pop()}`);
      if (place < 0 || !from.href.startsWith(root.href)) return null;
      return { ids, place, from: from.href, title: String(walk.title).slice(0, 120) };
    } catch (error) {
      return null;
    }
  }

  function neighbour(item, path, id, hint) {
    item.replaceChildren();
    if (!path) return;
    const link = document.createElement("a");
    link.id = id;
    link.rel = id === "previous" ? "prev" : "next";
    link.href = new URL(path, root).href;
    const spoken = document.createElement("span");
    spoken.className = "sr";
    spoken.textContent = `${hint} `;
    const arrow = document.createElement("span");
    arrow.setAttribute("aria-hidden", "true");
    arrow.textContent = id === "previous" ? "← " : " →";
    const name = PATH.exec(path)[1];
    link.append(...(id === "previous" ? [arrow, spoken, name] : [spoken, name, arrow]));
    item.append(link);
  }

  const walk = read();
  if (!walk) return;
  const before = document.getElementById("before");
  const after = document.getElementById("after");
  const place = document.querySelector(".crumbs .place");
  const usual = [before, after].map((item) => Array.from(item.childNodes));
  neighbour(before, walk.ids[walk.place - 1], "previous", TEXT.previous);
  neighbour(after, walk.ids[walk.place + 1], "following", TEXT.next);
  document.getElementById("walk-text").textContent = TEXT.where(walk.place + 1, walk.ids.length, walk.title);
  document.getElementById("walk-back").href = walk.from;
  place.hidden = true;
  bar.hidden = false;
  document.getElementById("walk-leave").addEventListener("click", () => {
    sessionStorage.removeItem(KEY);
    before.replaceChildren(...usual[0]);
    after.replaceChildren(...usual[1]);
    place.hidden = false;
    bar.hidden = true;
    document.getElementById("main").focus();
  });
})();
