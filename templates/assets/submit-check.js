// The check of a predictions file: the same faults and warnings, in the same order, as `coooler check` gives.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const { _ } = window.COOOLER_I18N;
  const COLUMNS = ["video_id", "rank", "description", "label", "track_ids", "frame_indices"];
  const REQUIRED = COLUMNS.slice(0, 3);
  const SHOWN_NAMES = 20;
  const STEP = 5_000;
  const BAD = Symbol("a cell whose fault is noted");
  const CLOSED = {
    parquet: _("It looks like a Parquet file, which a page cannot open by itself."),
    scripts: _("It looks like the JSON of the paper's scripts, whose answers only the command reads."),
    zip: _("It looks like a zip archive, which this page does not open."),
    zst: _("It looks like a zstd archive, which a page cannot open by itself."),
  };

  // Thrown for a file that is recognised, but cannot be opened here.
  class Closed extends Error {}

  // The clean values of a column, BAD where a fault was noted; equal texts and numbers are checked once.
  function* cleanColumn(sheet, name, test, faults, missing = BAD) {
    const cells = sheet.cells[name];
    if (!cells) return sheet.rows.map(() => (faults.kept.has(name) ? BAD : missing));
    const seen = new Map();
    const clean = [];
    for (let place = 0; place < cells.length; place += 1) {
      const value = cells[place];
      const keep = typeof value === "string" || check.isInt(value);
      let result = keep ? seen.get(value) : undefined;
      if (result === undefined) {
        result = missing !== BAD && check.isMissing(value) ? missing : check.judged(test, value);
        if (keep) seen.set(value, result);
      }
      if (result instanceof check.Wrong) {
        faults.add(sheet.rows[place], name, result.found, result.expected, result.mend);
        result = BAD;
      }
      clean.push(result);
      if (place % STEP === STEP - 1) yield place / cells.length;
    }
    return clean;
  }

  function missingColumns(sheet, faults) {
    if (!sheet.columns.length && faults.kept.size) return;
    const spelled = new Map(
      sheet.columns.map((name) => [check.strip(name).toLowerCase().replace(/[ -]/g, "_"), name]),
    );
    for (const name of REQUIRED) {
      if (sheet.columns.includes(name)) continue;
      const near = spelled.get(name);
      const columns = sheet.columns.slice(0, SHOWN_NAMES).map((column) => check.visible(column));
      const found = "no such column, but the columns " + columns.join(", ");
      const mend = near ? "Rename '" + check.visible(near) + "' to '" + name + "'." : "Add the column.";
      faults.add(null, name, found, "a column `" + name + "`", mend);
    }
  }

  function some(names) {
    const rest = names.length - SHOWN_NAMES;
    return names.slice(0, SHOWN_NAMES).join(", ") + (rest > 0 ? " and " + check.commas(rest) + " more" : "");
  }

  function unknownColumns(names) {
    if (!names.length) return [];
    return ["Ignored unknown columns: " + some(names.map((name) => check.visible(name))) + "."];
  }

  function* unique(sheet, videos, ranks, faults) {
    const firstRow = new Map();
    for (let place = 0; place < videos.length; place += 1) {
      const row = sheet.rows[place];
      if (videos[place] !== BAD && ranks[place] !== BAD) {
        const key = ranks[place] + " " + videos[place];
        const before = firstRow.get(key);
        if (before === undefined) {
          firstRow.set(key, row);
        } else {
          const again = "rank '" + ranks[place] + "' again in video '" + check.visible(videos[place]);
          const found = again + "' (first in row " + before + ")";
          faults.add(row, "rank", found, "each rank once in a video", "Renumber or remove the row.");
        }
      }
      if (place % STEP === STEP - 1) yield place / videos.length;
    }
  }

  // Part of a whole: the shares that `steps` yields, between `from` and `to`.
  function* within(steps, from, to) {
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value;
      yield from + value * (to - from);
    }
  }

  // The videos of the predictions in a file with our columns, one for each, and the warnings.
  function* ofSheet(bytes, read, known, faults) {
    const sheet = yield* within(read(bytes, COLUMNS, faults), 0, 0.5);
    missingColumns(sheet, faults);
    const ids = new check.VideoIds(known, sheet.cells.video_id || []);
    const videos = yield* within(cleanColumn(sheet, "video_id", (id) => ids.test(id), faults), 0.5, 0.6);
    const ranks = yield* within(cleanColumn(sheet, "rank", (rank) => check.whole(rank, 1), faults), 0.6, 0.7);
    yield* within(cleanColumn(sheet, "description", check.description, faults), 0.7, 0.8);
    yield* within(cleanColumn(sheet, "label", check.label, faults, null), 0.8, 0.85);
    yield* within(cleanColumn(sheet, "track_ids", check.trackIds, faults, []), 0.85, 0.9);
    yield* within(cleanColumn(sheet, "frame_indices", check.frameIndices, faults, []), 0.9, 0.95);
    yield* within(unique(sheet, videos, ranks, faults), 0.95, 1);
    faults.stopIfAny();
    const unknown = sheet.columns.filter((name) => !COLUMNS.includes(name));
    return { videos, warnings: [...unknownColumns(unknown), ...ids.warnings()] };
  }

  // The same of a file in the form of another challenge: {column, rows, predictions, warnings}.
  function* ofCaptions(bytes, read, known, faults) {
    const captions = yield* within(read(bytes, faults), 0, 1);
    check.limitRows(captions.predictions.length, faults);
    const ids = new check.VideoIds(known, captions.rows.keys());
    const meant = new Map();
    for (const [raw, row] of captions.rows) {
      meant.set(raw, check.checked((id) => ids.test(id), raw, faults, row, captions.column));
    }
    faults.stopIfAny();
    const videos = captions.predictions.map((raw) => meant.get(raw));
    return { videos, warnings: [...captions.warnings, ...ids.warnings()] };
  }

  function missingVideos(videos, truth) {
    const predicted = new Set(videos);
    const asked = truth.hazards ? truth.ids.filter((_, place) => truth.hazards[place] === "1") : truth.ids;
    const missing = asked.filter((id) => !predicted.has(id)).sort(check.inOrder);
    if (!missing.length) return [];
    const told = " videos with a hazard have no prediction and count as 0: ";
    const kept = " videos have no prediction; each of them that has a hazard counts as 0: ";
    return [missing.length + " of " + asked.length + (truth.hazards ? told : kept) + some(missing) + "."];
  }

  function* run(content, truth, faults, report) {
    report.format = check.predictionFormatOf(content.bytes, content.name, faults);
    if (Object.hasOwn(CLOSED, report.format)) throw new Closed(report.format);
    const sheets = { csv: check.readCsv, jsonl: check.readJsonLines };
    const outside = { coool: check.readCoool, "2coool": check.readTwoCoool, coco: check.readCoco };
    const known = new Set(truth.ids);
    const read = sheets[report.format] || outside[report.format];
    const found = yield* (report.format in sheets ? ofSheet : ofCaptions)(content.bytes, read, known, faults);
    report.warnings = found.warnings;
    if (!found.videos.length) report.warnings.push("The file holds no prediction.");
    report.warnings.push(...missingVideos(found.videos, truth));
    report.predictions = found.videos.length;
    report.videos = new Set(found.videos).size;
  }

  // Checks a file (a File) against the truth's ids. Resolves to the steps of the check: they yield how much
  // is done, in [0, 1], and return {format, predictions, videos, warnings, faults, closed}.
  async function steps(file, truth) {
    const report = { format: "", predictions: 0, videos: 0, warnings: [], closed: "" };
    const faults = new check.Faults();
    let content = null;
    let refused = null;
    try {
      content = await check.contentOf(file, faults);
      if (CLOSED[content.packing]) throw new Closed(content.packing);
    } catch (error) {
      refused = error;
    }
    return (function* () {
      try {
        if (refused) throw refused;
        yield* run(content, truth, faults, report);
      } catch (error) {
        if (error instanceof Closed) report.closed = CLOSED[error.message];
        else if (!(error instanceof check.Stop)) throw error;
      }
      return { ...report, faults: faults.list() };
    })();
  }

  Object.assign(check, { some, steps, unknownColumns });
})();
