// Predictions as COCO caption results: a JSON list. The reader gives what those of submit-outside.js give.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_JSON_MARKS = 16_000_000;
  const MARKS = [44, 91, 123]; // , [ {
  const STEP = 2_000;

  // The text of a JSON file, within the bounds.
  function jsonText(bytes, faults) {
    let marks = 0;
    for (const byte of bytes) if (MARKS.includes(byte)) marks += 1;
    if (marks > MAX_JSON_MARKS) {
      const expected = "at most " + check.commas(MAX_JSON_MARKS);
      faults.stop(check.commas(marks) + " commas and brackets", expected, "Leave out what is no prediction.");
    }
    const content = check.withoutMark(bytes);
    const text = check.decode(content);
    if (text !== null) return text;
    const bad = check.firstBad(content);
    let line = 1;
    for (const byte of content.subarray(0, bad)) if (byte === 10) line += 1;
    const found = "byte 0x" + check.hex(content[bad], 2) + " in line " + line + ", which is not UTF-8";
    return faults.stop(found, "text in UTF-8", "Save the file as UTF-8.", line);
  }

  // The lines where the items start, found when they are first asked for.
  function lineFinder(text, starts) {
    const lines = [];
    return function (row) {
      for (let place = 0, line = 1, at = 0; lines.length < starts.length; at += 1) {
        for (; place < starts[at]; place += 1) if (text[place] === "\n") line += 1;
        lines.push(line);
      }
      return row <= lines.length ? lines[row - 1] : null;
    };
  }

  function* jsonValue(bytes, faults) {
    const text = jsonText(bytes, faults);
    try {
      const read = yield* check.parseJsonFile(text);
      faults.lineOf = lineFinder(text, read.starts);
      return read;
    } catch (error) {
      if (error instanceof check.Malformed) {
        const found = error.message + " at line " + error.line + ", character " + (error.inLine + 1);
        const mend = "Mend the place, or write the file with a JSON library.";
        faults.stop(found, "JSON", mend, error.line);
      }
      if (!(error instanceof check.Unreadable)) throw error;
      const found = "JSON that cannot be read (" + check.visible(error.message) + ")";
      return faults.stop(found, "JSON", "Mend the file.");
    }
  }

  function* readCoco(bytes, faults) {
    const captions = { column: "image_id", rows: new Map(), predictions: [], warnings: [] };
    const others = new Set();
    const { value, odd } = yield* jsonValue(bytes, faults);
    const idOf = (id) => check.identifier(id, "an image id, the video's");
    check.limitRows(value.length, faults);
    for (let place = 0; place < value.length; place += 1) {
      if (place % STEP === STEP - 1) yield 1;
      const item = value[place];
      const row = place + 1;
      if (!(item instanceof Map)) {
        const found = "a JSON " + check.typeName(item);
        faults.add(row, null, found, 'an object {"image_id": ...}', "Use {...}.");
        continue;
      }
      if (item.repeated !== undefined) {
        faults.add(row, null, check.repeatedWords(item), "each key once", "Remove one of the two.");
        continue;
      }
      for (const key of item.keys()) if (key !== "image_id" && key !== "caption") others.add(key);
      const video = check.checked(idOf, item.get("image_id") ?? null, faults, row, "image_id");
      const caption = check.checked(check.description, item.get("caption") ?? null, faults, row, "caption");
      if (video === null) continue;
      if (!captions.rows.has(video)) captions.rows.set(video, row);
      if (caption !== null) captions.predictions.push(video);
    }
    if (odd.length && !faults.kept.size) {
      const found = odd.join(", ") + ", which is no JSON";
      faults.add(null, null, found, "numbers that JSON knows", "Leave the value out, or write null.");
    }
    captions.warnings = check.unknownColumns(Array.from(others).sort(check.inOrder));
    return captions;
  }

  Object.assign(check, { readCoco });
  check.limits.MAX_JSON_MARKS = MAX_JSON_MARKS;
})();
