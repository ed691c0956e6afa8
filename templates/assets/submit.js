// The submit page: takes a file by choice or drop, checks it without a request, says what is wrong with it.
(function () {
  "use strict";
  const { _, plural, whole } = window.COOOLER_I18N;
  const check = window.COOOLER_CHECK;
  const truth = window.COOOLER_SUBMIT;
  const FIRST_SHOWN = 200;
  const SLICE_MS = 25;
  const FORMATS = {
    csv: "CSV",
    jsonl: "JSON Lines",
    coool: _("COOOL results"),
    "2coool": _("2COOOL results"),
    coco: _("COCO caption results"),
  };
  const place = (id) => document.getElementById(id);
  const input = place("file");
  const drop = place("drop");
  const result = place("result");
  let latest = 0; // the number of the check that may speak
  let report = null; // what the last check said

  // Run the steps of a check in slices, so that the page stays alive; null when another check began.
  function drive(steps, number) {
    return new Promise(function (resolve, reject) {
      function slice() {
        if (number !== latest) {
          resolve(null);
          return;
        }
        const until = performance.now() + SLICE_MS;
        try {
          do {
            const { done, value } = steps.next();
            if (done) {
              resolve(value);
              return;
            }
            place("progress").value = value;
          } while (performance.now() < until);
        } catch (error) {
          reject(error);
          return;
        }
        setTimeout(slice, 0);
      }
      slice();
    });
  }

  async function start(file) {
    latest += 1;
    const number = latest;
    result.hidden = true;
    place("said").textContent = "";
    place("busy-text").textContent = _("Reading {file} …", { file: check.visible(file.name, 100) });
    place("progress").value = 0;
    place("busy").hidden = false;
    let found;
    try {
      const steps = check.steps(file, truth);
      found = await drive(await steps, number);
    } catch (error) {
      const closed = _("This page cannot read it ({problem}).", { problem: error.message });
      found = { format: "", predictions: 0, videos: 0, warnings: [], faults: [], closed };
    }
    if (number !== latest || !found) return;
    place("busy").hidden = true;
    report = { file: check.visible(file.name, 1000), ...found };
    show();
  }

  function show() {
    const faulty = report.faults.length > 0;
    const { file } = report;
    let mark = "✓";
    let title = _("{file} is good", { file });
    let text = sums();
    if (report.closed) {
      mark = "–";
      title = _("{file} is not checked", { file });
      text = report.closed + " " + _("This command does the same check: coooler check {file}", { file });
    } else if (faulty) {
      const more = report.faults[report.faults.length - 1].more || 0;
      const n = report.faults.length - (more ? 1 : 0) + more;
      mark = "✕";
      title = plural(n, "{file} has {n} fault", "{file} has {n} faults", { file });
      text = counts();
    } else if (report.warnings.length) {
      const n = report.warnings.length;
      title = plural(n, "{file} is good, with {n} warning", "{file} is good, with {n} warnings", { file });
    }
    result.className = "result " + (report.closed ? "closed" : faulty ? "faulty" : "good");
    place("result-title").textContent = mark + " " + title;
    place("result-text").textContent = text;
    place("warnings").replaceChildren(...report.warnings.map((warning) => made("li", warning)));
    place("warnings").hidden = !report.warnings.length;
    place("result-tools").hidden = Boolean(report.closed);
    place("tools-said").textContent = "";
    place("faults").hidden = !faulty;
    place("fault-rows").replaceChildren();
    addRows(FIRST_SHOWN);
    result.hidden = false;
    place("said").textContent = title + ". " + text;
  }

  // What a good file holds.
  function sums() {
    const n = truth.ids.length;
    const values = {
      predictions: plural(report.predictions, "{n} prediction", "{n} predictions"),
      videos: whole(report.videos),
      format: FORMATS[report.format],
    };
    return plural(
      n,
      "{predictions} for {videos} of {n} video ({format}).",
      "{predictions} for {videos} of {n} videos ({format}).",
      values,
    );
  }

  // How many faults each column has, the most first.
  function counts() {
    const byColumn = new Map();
    for (const fault of report.faults) {
      const name = fault.column || (fault.row === null ? _("the file") : _("whole rows"));
      if (!fault.more) byColumn.set(name, (byColumn.get(name) || 0) + 1);
    }
    const parts = Array.from(byColumn).sort((a, b) => b[1] - a[1]);
    const list = parts.map(([name, count]) => name + " " + whole(count)).join(", ");
    const { more } = report.faults[report.faults.length - 1];
    return more ? _("By column: {list}; {more} more are not listed.", { list, more: whole(more) })
      : _("By column: {list}.", { list });
  }

  function made(tag, text, name) {
    const element = document.createElement(tag);
    element.textContent = text;
    if (name) element.className = name;
    return element;
  }

  function cell(label, text, name) {
    const element = made("td", text, name);
    element.dataset.label = label;
    element.setAttribute("role", "cell");
    return element;
  }

  // Fill the table up to `limit` faults.
  function addRows(limit) {
    const body = place("fault-rows");
    for (const fault of report.faults.slice(body.rows.length, limit)) {
      const row = document.createElement("tr");
      row.setAttribute("role", "row");
      const at = fault.row === null ? _("whole file") : _("row {number}", { number: whole(fault.row) });
      const where = cell("", at, "row");
      if (fault.line !== null && fault.line !== fault.row) {
        where.append(made("span", " " + _("line {number}", { number: whole(fault.line) }), "sub"));
      }
      row.append(
        where,
        cell(_("Column"), fault.column || "", "column"),
        cell(_("Found"), fault.found, "found"),
        cell(_("Expected"), fault.expected, "expected"),
        cell(_("Mend"), fault.mend, "mend"),
      );
      body.append(row);
    }
    const left = report.faults.length - body.rows.length;
    place("more").hidden = left <= 0;
    place("more").textContent = plural(left, "Show the other {n}", "Show the other {n}");
  }

  function asText() {
    const lines = report.faults.map(function (fault) {
      const row = fault.row === null ? "" : ", row " + fault.row;
      const column = fault.column === null ? "" : ", column " + fault.column;
      const words = ": found " + fault.found + "; expected " + fault.expected + ". " + fault.mend;
      return "  " + report.file + row + column + words;
    });
    const warnings = report.warnings.map((warning) => "  warning: " + warning);
    return [place("result-title").textContent.slice(2) + ".", ...lines, ...warnings].join("\n") + "\n";
  }

  function asJson() {
    const faults = report.faults.map(function ({ row, column, found, expected, mend }) {
      return { file: report.file, row, column, found, expected, mend };
    });
    const about = {
      file: report.file,
      format: report.format,
      predictions: report.predictions,
      videos_with_predictions: report.videos,
      n_videos: truth.ids.length,
      warnings: report.warnings,
      faults,
    };
    return JSON.stringify(about, null, 2) + "\n";
  }

  // Without a clipboard (a page over plain http), the text goes through a field that is selected.
  function copiedBySelection(text) {
    const field = document.createElement("textarea");
    field.value = text;
    document.body.append(field);
    field.select();
    const done = document.execCommand("copy");
    field.remove();
    place("copy").focus();
    return done;
  }

  async function copy() {
    let done = false;
    try {
      await navigator.clipboard.writeText(asText());
      done = true;
    } catch (error) {
      done = copiedBySelection(asText());
    }
    place("tools-said").textContent = done ? _("Copied.")
      : _("The browser forbids copying; download it instead.");
  }

  function save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([asJson()], { type: "application/json" }));
    link.download = "check.json";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    place("tools-said").textContent = _("Saved as {name}.", { name: link.download });
  }

  function more() {
    const before = place("fault-rows").rows.length;
    addRows(report.faults.length);
    const next = place("fault-rows").rows[before];
    next.tabIndex = -1;
    next.focus();
  }

  function carriesFile(event) {
    return event.dataTransfer && Array.from(event.dataTransfer.types).includes("Files");
  }

  input.addEventListener("change", function () {
    if (input.files.length) start(input.files[0]);
  });
  // The same file, mended, must be a change again.
  input.addEventListener("click", function () {
    input.value = "";
  });
  document.addEventListener("dragover", function (event) {
    if (!carriesFile(event)) return;
    event.preventDefault();
    drop.classList.add("over");
  });
  document.addEventListener("dragleave", function (event) {
    if (!event.relatedTarget) drop.classList.remove("over");
  });
  document.addEventListener("drop", function (event) {
    if (!carriesFile(event)) return;
    event.preventDefault();
    drop.classList.remove("over");
    const file = event.dataTransfer.files[0];
    if (!file) return;
    input.value = "";
    start(file);
  });
  place("copy").addEventListener("click", copy);
  place("save").addEventListener("click", save);
  place("more").addEventListener("click", more);
})();
