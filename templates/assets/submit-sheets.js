// CSV and JSON Lines to raw cells by column, as csv.reader(strict=True) and json.loads of Python read them.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_ROWS = 2_000_000;
  const QUOTE_IT = 'Quote a cell that holds a comma: "a cat, running".';

  class Malformed extends Error {}

  // One record after the other out of physical lines; a quoted cell may go over several. `spaced` leaves out
  // blanks before a cell; without `strict`, what follows a closing quote is a part of the cell.
  class CsvReader {
    constructor({ spaced = false, strict = true } = {}) {
      this.spaced = spaced;
      this.strict = strict;
      this.lines = 0;
      this.start = 1; // the line where the latest record starts
      this.cells = [];
      this.open = null; // the text so far of a quoted cell whose end is on a later line
    }

    // The cells of the record that ends with this line, or null when it goes on. `end` is the line's ending.
    feed(line, end) {
      this.lines += 1;
      if (this.open === null) this.start = this.lines;
      if (this.open === null && line === "") return [];
      if (this.open === null && !line.includes('"') && !this.spaced) return line.split(",");
      let place = this.open === null ? 0 : this.quoted(line, 0, this.open, end);
      while (place >= 0 && place <= line.length) {
        if (this.spaced) while (line[place] === " ") place += 1;
        if (line[place] === '"') {
          place = this.quoted(line, place + 1, "", end);
        } else {
          place = this.plain(line, place, "");
        }
      }
      if (place < 0) return null;
      const cells = this.cells;
      this.cells = [];
      return cells;
    }

    // Read a cell on to the next comma: where the next cell starts, beyond the line after the last one.
    plain(line, place, before) {
      const comma = line.indexOf(",", place);
      const end = comma < 0 ? line.length : comma;
      this.cells.push(before + line.slice(place, end));
      return end + 1;
    }

    // The same for a quoted cell; -1 when the line ends before the quote does.
    quoted(line, place, before, end) {
      let text = before;
      for (;;) {
        const quote = line.indexOf('"', place);
        if (quote < 0) {
          this.open = text + line.slice(place) + end;
          return -1;
        }
        text += line.slice(place, quote);
        place = quote + 2;
        if (line[quote + 1] === '"') {
          text += '"';
        } else if (line[quote + 1] === "," || quote + 1 === line.length) {
          this.open = null;
          this.cells.push(text);
          return place;
        } else if (this.strict) {
          throw new Malformed("',' expected after '\"'");
        } else {
          return this.plain(line, quote + 1, text);
        }
      }
    }

    finish() {
      if (this.open !== null) throw new Malformed("unexpected end of data");
    }
  }

  // The lines of a text with their endings: \n, \r\n or \r.
  function* physicalLines(text) {
    const ending = /\r\n?|\n/g;
    let from = 0;
    for (let found = ending.exec(text); found; found = ending.exec(text)) {
      yield [text.slice(from, found.index), found[0]];
      from = ending.lastIndex;
    }
    if (from < text.length) yield [text.slice(from), ""];
  }

  function limitRows(count, faults) {
    const most = check.commas(MAX_ROWS);
    if (count > MAX_ROWS) {
      faults.stop("more than " + most + " rows", "at most " + most, "Leave out some predictions.");
    }
  }

  function headerHints(header, known, faults) {
    for (const name of [...known].sort()) {
      const count = header.filter((other) => other === name).length;
      if (count > 1) faults.add(null, name, count + " columns of this name", "one", "Remove or rename one.");
    }
    if (header.length !== 1) return;
    for (const [sign, word] of [[";", "semicolons"], ["\t", "tabs"], ["|", "bars"]]) {
      if (header[0].includes(sign)) {
        const mend = "Export the table with commas between the cells.";
        faults.stop(word + " between the cells", "commas", mend);
      }
    }
  }

  // Give each record, the header first, to `take`; blank lines are left out. Yields the share of the bytes
  // that is read. Where the CSV is broken the reading ends, and the fault is noted.
  function* csvRecords(bytes, spaced, faults, take) {
    const reader = new CsvReader({ spaced });
    const content = check.withoutMark(bytes);
    const starts = [];
    let done = 0;
    faults.lineOf = (row) => (row < starts.length ? starts[row] : null);
    try {
      for (const piece of check.pieces(content)) {
        for (const [line, end] of physicalLines(check.decodeLoosely(piece))) {
          const record = reader.feed(line, end);
          if (!record || !record.length) continue;
          starts.push(reader.start);
          take(record);
        }
        done += piece.length;
        yield done / content.length;
      }
      reader.finish();
    } catch (error) {
      if (!(error instanceof Malformed)) throw error;
      const expected = 'cells between commas, quoted with " where they hold commas, quotes or line ends';
      const mend = "Line " + reader.lines + ": close the quote, or double quotes inside quotes.";
      faults.add(starts.length || null, null, error.message, expected, mend, reader.start);
    }
  }

  // The names in the first line of a text, as a reader that is not strict takes them.
  function headerOf(line) {
    const reader = new CsvReader({ spaced: true, strict: false });
    const cells = reader.feed(line, "");
    return cells || [...reader.cells, reader.open];
  }

  // Yields the share of the bytes that is read; returns {columns, rows, cells}.
  function* readCsv(bytes, known, faults) {
    const rows = [];
    const uneven = [];
    const cells = {};
    let header = [];
    let places = [];
    let count = 0;
    yield* csvRecords(bytes, false, faults, function (record) {
      if (!header.length) {
        header = record.map(check.strip);
        const present = known.filter((name) => header.includes(name));
        places = present.map((name) => [name, header.indexOf(name)]);
        for (const name of present) cells[name] = [];
        return;
      }
      count += 1;
      limitRows(count, faults);
      if (record.length === header.length) {
        rows.push(count);
        for (const [name, place] of places) cells[name].push(record[place]);
      } else {
        uneven.push([count, record.length]);
      }
    });
    headerHints(header, known, faults);
    for (const [row, width] of uneven) {
      const found = width + " cells";
      faults.add(row, null, found, header.length + " cells, as in the header", QUOTE_IT);
    }
    return { columns: header, rows, cells };
  }

  function repeatedWords(record) {
    return "the key '" + check.visible(record.repeated) + "' twice in one object";
  }

  // A line's object, or null after its fault is noted.
  function jsonRecord(text, number, faults) {
    const expected = "one JSON object a line";
    try {
      const record = check.parseJson(text);
      if (record instanceof Map && record.repeated !== undefined) {
        faults.add(number, null, repeatedWords(record), "each key once", "Remove one of the two.");
        return null;
      }
      if (record instanceof Map) return record;
      faults.add(number, null, "a JSON " + check.typeName(record), expected, "Use {...}.");
    } catch (error) {
      if (error instanceof check.Malformed) {
        const at = " at character " + (error.place + 1) + " of '";
        const found = error.message + at + check.visible(text) + "'";
        faults.add(number, null, found, expected, "Mend the line, or write it with a JSON library.");
      } else if (error instanceof check.Unreadable) {
        const found = "JSON that cannot be read (" + check.visible(error.message) + ")";
        faults.add(number, null, found, expected, "Mend the line.");
      } else {
        throw error;
      }
    }
    return null;
  }

  // The lines of a piece as text, those that are not UTF-8 as bytes.
  function jsonLines(piece) {
    const text = check.decode(piece);
    if (text !== null) return text.split("\n");
    const lines = [];
    for (let from = 0; from <= piece.length; ) {
      const found = piece.indexOf(10, from);
      const line = piece.subarray(from, found < 0 ? piece.length : found);
      const decoded = check.decode(line);
      lines.push(decoded === null ? line : decoded);
      from = found < 0 ? piece.length + 1 : found + 1;
    }
    return lines;
  }

  function* readJsonLines(bytes, known, faults) {
    const content = check.withoutMark(bytes);
    const rows = [];
    const names = new Set();
    const cells = {};
    for (const name of known) cells[name] = [];
    let number = 0;
    let done = 0;
    faults.lineOf = (row) => row;
    for (const piece of check.pieces(content)) {
      const lines = jsonLines(piece);
      if (piece[piece.length - 1] === 10) lines.pop();
      for (const line of lines) {
        number += 1;
        if (typeof line === "string" && /^[ \t-\r]*$/.test(line)) continue;
        limitRows(rows.length + 1, faults);
        if (typeof line !== "string") {
          const bad = check.firstBad(line);
          const at = " at position " + (bad + 1) + ", which is not UTF-8";
          const found = "byte 0x" + check.hex(line[bad], 2) + at;
          faults.add(number, null, found, "text in UTF-8", "Save the file as UTF-8.");
          continue;
        }
        const record = jsonRecord(line, number, faults);
        if (!record) continue;
        rows.push(number);
        for (const name of record.keys()) names.add(name);
        for (const name of known) cells[name].push(record.has(name) ? record.get(name) : null);
      }
      done += piece.length;
      yield done / content.length;
    }
    for (const name of known) if (!names.has(name)) delete cells[name];
    return { columns: Array.from(names), rows, cells };
  }

  Object.assign(check, {
    QUOTE_IT,
    csvRecords,
    headerOf,
    limitRows,
    readCsv,
    readJsonLines,
    repeatedWords,
  });
  check.limits.MAX_ROWS = MAX_ROWS;
})();
