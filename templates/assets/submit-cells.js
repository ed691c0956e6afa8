// What one cell may hold, and which video an id means; the words of a fault are those of `coooler check`.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_TEXT_CHARS = 2_000;
  const MAX_ID_CHARS = 128;
  const MAX_LIST_ITEMS = 10_000;
  const MAX_WHOLE = 2 ** 31 - 1;
  const MAX_ID_NUMBER = 10n ** 18n;
  const SUGGESTIONS = 20;
  const WHOLE = /^([+-]?[0-9]{1,18})(?:\.0*)?$/;
  const NUMBER = /^[0-9]{1,18}$/;
  const LAST_NUMBER = /[0-9]{1,18}$/;
  const LIST_GAP = new RegExp("[" + check.BLANK + ";,]+");

  // A cell that cannot be accepted.
  class Wrong {
    constructor(found, expected, mend) {
      this.found = found;
      this.expected = expected;
      this.mend = mend;
    }
  }

  function text(value, expected = "text") {
    if (typeof value !== "string") throw new Wrong(check.show(value), expected, "Write it as text.");
    if (value.includes("\0")) {
      throw new Wrong("a NUL character in " + check.show(value), expected, "Remove the NUL character.");
    }
    const broken = check.brokenBytes(value);
    if (broken) {
      const found = broken + ", which is not UTF-8, in " + check.show(value);
      throw new Wrong(found, "text in UTF-8", "Save the file as UTF-8.");
    }
    const stripped = check.strip(value);
    if (!check.isPrinted(stripped)) {
      throw new Wrong(check.show(value), expected, "Fill it in, or leave the row out.");
    }
    if (stripped.length > MAX_TEXT_CHARS && check.size(stripped) > MAX_TEXT_CHARS) {
      const most = "at most " + check.commas(MAX_TEXT_CHARS) + " characters";
      throw new Wrong(check.show(value), most, "Shorten it to " + most + ".");
    }
    return stripped;
  }

  function description(value) {
    const expected = "a description in words";
    const clean = text(value, expected);
    if (clean.toLowerCase() === "nan") {
      const mend = "This is how a missing value is written; leave the row out.";
      throw new Wrong(check.show(value), expected, mend);
    }
    return clean;
  }

  function numberAsId(value) {
    const number = BigInt(value);
    const size = number < 0n ? -number : number;
    if (size <= MAX_ID_NUMBER) return String(number);
    return (number < 0n ? "-0x" : "0x") + size.toString(16);
  }

  function identifier(value, expected) {
    const cell = check.isInt(value) ? numberAsId(value) : value;
    const clean = text(cell, expected);
    if (check.size(clean) > MAX_ID_CHARS) {
      throw new Wrong(check.show(cell), "at most " + MAX_ID_CHARS + " characters", "Use a shorter id.");
    }
    return clean;
  }

  function whole(value, minimum) {
    let number = null;
    if (typeof value === "string") {
      const found = WHOLE.exec(check.strip(value));
      if (found) number = Number(found[1]);
    } else if (value instanceof check.Float) {
      if (Number.isInteger(value.value)) number = value.value;
    } else if (check.isInt(value)) {
      number = Number(value);
    }
    if (number === null || number < minimum || number > MAX_WHOLE) {
      const mend = minimum ? "Ranks count 1, 2, 3, ... in each video." : "Frames count from 0.";
      throw new Wrong(check.show(value), "a whole number from " + minimum, mend);
    }
    return number + 0;
  }

  function split(value) {
    let inside = value;
    if (value.startsWith("[")) {
      try {
        return check.parseJson(value);
      } catch (error) {
        if (!(error instanceof check.Malformed || error instanceof check.Unreadable)) throw error;
        inside = value.replace(/^\[/, "").replace(/\]$/, "");
      }
    }
    const items = inside.split(LIST_GAP).filter(Boolean);
    return items.map((item) => item.replace(/^['"]+/, "").replace(/['"]+$/, ""));
  }

  function listing(value) {
    const list = typeof value === "string" ? split(check.strip(value)) : value;
    if (!Array.isArray(list)) {
      throw new Wrong(check.show(list), "a list", 'Write it as a JSON list such as ["7", "9"], or as 7;9.');
    }
    if (list.length > MAX_LIST_ITEMS) {
      const most = "at most " + check.commas(MAX_LIST_ITEMS) + " items";
      throw new Wrong(check.commas(list.length) + " items", most, "Shorten the list.");
    }
    return list;
  }

  function trackIds(value) {
    return listing(value).map((item) => identifier(item, "track ids"));
  }

  function frameIndices(value) {
    return listing(value).map((item) => whole(item, 0));
  }

  function isMissing(value) {
    return value === null || (typeof value === "string" && check.isBlank(value));
  }

  // The clean value of a cell, or what is wrong with it.
  function judged(test, value) {
    try {
      return test(value);
    } catch (error) {
      if (error instanceof Wrong) return error;
      throw error;
    }
  }

  // The clean value of a cell, or null after its fault is noted.
  function checked(test, value, faults, row, column) {
    const result = judged(test, value);
    if (!(result instanceof Wrong)) return result;
    faults.add(row, column, result.found, result.expected, result.mend);
    return null;
  }

  function withoutZeros(digits) {
    return digits.replace(/^0+(?=.)/, "");
  }

  // The check of a file's video ids. Where none of `ids`, all that the file holds, is among the `known` ones,
  // a plain number is taken as the one video whose id ends in it.
  class VideoIds {
    constructor(known, ids) {
      this.known = known;
      this.ids = ids;
      this.numbers = null;
      this.suggested = 0;
      this.taken = new Map();
      this.byNumber = new Map();
    }

    test(value) {
      const clean = identifier(value, "a video id");
      const video = this.known.has(clean) ? clean : this.ofNumber(value, clean);
      const before = this.taken.get(video);
      if (before === undefined) {
        this.taken.set(video, clean);
      } else if (before !== clean) {
        const also = "', as '" + check.visible(before) + "' is";
        const found = check.show(value) + ", which is taken as '" + video + also;
        throw new Wrong(found, "one id for each video", "Correct one of the two, or the video map.");
      }
      return video;
    }

    ofNumber(value, clean) {
      let same = [];
      if (NUMBER.test(clean)) {
        if (!this.numbers) this.numbers = this.findNumbers();
        same = this.numbers.get(withoutZeros(clean)) || [];
        if (same.length === 1) {
          this.byNumber.set(clean, same[0]);
          return same[0];
        }
      }
      const expected = "one of the truth's " + this.known.size + " video ids";
      throw new Wrong(check.show(value), expected, this.mend(clean, same));
    }

    findNumbers() {
      const numbers = new Map();
      for (const id of this.ids) if (this.known.has(check.strip(asText(id)))) return numbers;
      for (const video of Array.from(this.known).sort(check.inOrder)) {
        const found = LAST_NUMBER.exec(video);
        if (!found) continue;
        const number = withoutZeros(found[0]);
        if (!numbers.has(number)) numbers.set(number, []);
        numbers.get(number).push(video);
      }
      return numbers;
    }

    mend(video, same) {
      if (same.length) {
        const such = "'" + same[0] + "' and '" + same[1] + "'; give a video map.";
        return same.length + " ids end in this number, such as " + such;
      }
      let near = null;
      if (this.suggested < SUGGESTIONS) {
        this.suggested += 1;
        near = check.closest(video, this.known, 0.8);
      }
      return near === null ? "Correct the id, or leave the row out." : "Did you mean '" + near + "'?";
    }

    warnings() {
      if (!this.byNumber.size) return [];
      const [first, video] = this.byNumber.entries().next().value;
      const more = this.byNumber.size - 1;
      const rest = more ? ", and " + check.commas(more) + " more by their numbers" : " by its number";
      return ["Took video '" + check.visible(first) + "' as '" + video + "'" + rest + "."];
    }
  }

  function asText(value) {
    if (typeof value === "boolean") return value ? "True" : "False";
    return typeof value === "string" || check.isInt(value) ? String(value) : "";
  }

  Object.assign(check, {
    MAX_LIST_ITEMS,
    MAX_WHOLE,
    VideoIds,
    Wrong,
    checked,
    description,
    frameIndices,
    identifier,
    isMissing,
    judged,
    label: (value) => text(value),
    limits: { MAX_TEXT_CHARS, MAX_ID_CHARS, MAX_LIST_ITEMS, MAX_WHOLE },
    trackIds,
    whole,
  });
})();
