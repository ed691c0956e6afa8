// A video's card from its row, as the page's own cards are.
(function () {
  "use strict";
  const { _ } = window.COOOLER_I18N;
  const { root } = document.getElementById("list-tools").dataset;
  const data = window.COOOLER_VIDEO_LIST;

  function add(parent, tag, kind, text) {
    const made = document.createElement(tag);
    made.className = kind;
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  }

  window.COOOLER_VIDEO_CARD = (row) => {
    const [name, shown, size, length, labels, words, , number, found, best] = row;
    const id = shown || name;
    const state = number === undefined ? "" : data.index().states[number];
    const item = document.createElement("li");
    item.className = "card";
    const link = add(item, "a", "card-link");
    link.href = `${root}videos/${name}.html`;
    const frame = add(link, "span", "card-picture");
    if (size) {
      const picture = add(frame, "img", "");
      picture.loading = "lazy";
      picture.decoding = "async";
      picture.alt = labels ? _("A keyframe of {video}: {labels}", { video: id, labels })
        : _("A keyframe of {video}", { video: id });
      [, picture.width, picture.height] = size;
      picture.src = root + size[0];
    } else add(frame, "span", "no-picture", _("No picture"));
    if (length) add(frame, "span", "length", length);
    add(link, "span", state ? "card-title" : "card-title as-is", state ? labels : id);
    if (!state) return item;
    add(link, "span", "card-id", id);
    const silence = [_("Nothing to report: silence is right here.")];
    (words || silence).forEach((text) => add(item, "p", "card-words", text));
    const total = data.index().systems;
    if (!total) return item;
    const line = add(item, "p", `card-state ${state}`, state === "clear"
      ? _("{n} of {total} rightly silent", { n: found, total })
      : _("{n} of {total} detected it", { n: found, total }));
    if (best) {
      line.append(` · ${_("best")} `);
      add(line, "b", "num", best);
    }
    return item;
  };
})();
