// JSON as Python's json.loads reads it: NaN passes, ints stay ints, a fault has Python's words and place.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_DEPTH = 900; // Python gives up near 1,000
  const MAX_DIGITS = 4300;
  const GAP = /[ \t\n\r]*/y;
  const NUMBER = /(-?(?:0|[1-9][0-9]*))(\.[0-9]+)?([eE][+-]?[0-9]+)?/y;
  const PLAIN = /[^"\\\x00-\x1f]*/y;
  const HIGH_END = /[\ud800-\udbff]$/;
  const LOW_START = /^[\udc00-\udfff]/;
  const ESCAPES = { '"': '"', "\\": "\\", "/": "/", b: "\b", f: "\f", n: "\n", r: "\r", t: "\t" };
  const WORDS = [
    ["null", null],
    ["true", true],
    ["false", false],
    ["NaN", new check.Float(NaN)],
    ["Infinity", new check.Float(Infinity)],
    ["-Infinity", new check.Float(-Infinity)],
  ];

  // Not JSON: `message` and the place in code points of the text and of its line; lines count from 1.
  class Malformed extends Error {
    constructor(message, text, place) {
      super(message);
      const before = text.slice(0, place);
      this.place = check.size(before);
      this.line = before.split("\n").length;
      this.inLine = check.size(before.slice(before.lastIndexOf("\n") + 1));
    }
  }

  // JSON, but too deep or with too long a number.
  class Unreadable extends Error {}

  // An object comes as a Map; `repeated` is the first key that it gives twice.
  class Reader {
    constructor(text) {
      this.text = text;
      this.place = 0;
      this.depth = 0;
      this.odd = new Set(); // NaN and the like, which are no JSON
    }

    fail(message, place) {
      throw new Malformed(message, this.text, place);
    }

    gap() {
      GAP.lastIndex = this.place;
      GAP.test(this.text);
      this.place = GAP.lastIndex;
    }

    enter(kind) {
      this.depth += 1;
      if (this.depth > MAX_DEPTH) {
        const where = " while decoding a JSON " + kind + " from a unicode string";
        throw new Unreadable("maximum recursion depth exceeded" + where);
      }
    }

    value() {
      const char = this.text[this.place];
      if (char === '"') {
        this.place += 1;
        return this.string();
      }
      if (char === "{") return this.object();
      if (char === "[") return this.array();
      if (char >= "0" && char <= "9") return this.number();
      for (const [word, value] of WORDS) {
        if (this.text.startsWith(word, this.place)) {
          this.place += word.length;
          if (value instanceof check.Float) this.odd.add(word);
          return value;
        }
      }
      return this.number();
    }

    number() {
      NUMBER.lastIndex = this.place;
      const found = NUMBER.exec(this.text);
      if (!found) this.fail("Expecting value", this.place);
      this.place = NUMBER.lastIndex;
      if (found[2] || found[3]) return new check.Float(Number(found[0]));
      const digits = found[1].replace("-", "").length;
      if (digits > MAX_DIGITS) {
        const limit = "Exceeds the limit (" + MAX_DIGITS + " digits) for integer string conversion: ";
        const hint = " digits; use sys.set_int_max_str_digits() to increase the limit";
        throw new Unreadable(limit + "value has " + digits + hint);
      }
      const number = Number(found[1]);
      return Number.isSafeInteger(number) ? number + 0 : BigInt(found[1]);
    }

    // `place` is behind the opening quote.
    string() {
      const begin = this.place - 1;
      const text = this.text;
      let result = "";
      for (;;) {
        PLAIN.lastIndex = this.place;
        const plain = PLAIN.exec(text)[0];
        // Two halves of Python's that would become one character here.
        if (HIGH_END.test(result) && LOW_START.test(plain)) throw new Unreadable("half a character");
        result += plain;
        const next = PLAIN.lastIndex;
        if (next === text.length) this.fail("Unterminated string starting at", begin);
        if (text[next] === '"') {
          this.place = next + 1;
          return result;
        }
        if (text[next] !== "\\") this.fail("Invalid control character at", next);
        if (next + 1 === text.length) this.fail("Unterminated string starting at", begin);
        const sign = text[next + 1];
        if (sign === "u") {
          result += String.fromCharCode(this.unit(next + 2));
          this.place = next + 6;
        } else if (Object.hasOwn(ESCAPES, sign)) {
          result += ESCAPES[sign];
          this.place = next + 2;
        } else {
          this.fail("Invalid \\escape", next);
        }
      }
    }

    // Four hex digits with something behind them; a pair of surrogates joins by itself in UTF-16.
    unit(place) {
      const digits = this.text.slice(place, place + 4);
      if (place + 4 >= this.text.length || !/^[0-9a-fA-F]{4}$/.test(digits)) {
        this.fail("Invalid \\uXXXX escape", place - 1);
      }
      return parseInt(digits, 16);
    }

    object() {
      this.enter("object");
      const result = new Map();
      this.place += 1;
      this.gap();
      if (this.text[this.place] !== "}") {
        for (;;) {
          if (this.text[this.place] !== '"') {
            this.fail("Expecting property name enclosed in double quotes", this.place);
          }
          this.place += 1;
          const key = this.string();
          this.gap();
          if (this.text[this.place] !== ":") this.fail("Expecting ':' delimiter", this.place);
          this.place += 1;
          this.gap();
          if (result.repeated === undefined && result.has(key)) result.repeated = key;
          result.set(key, this.value());
          this.gap();
          if (this.text[this.place] === "}") break;
          if (this.text[this.place] !== ",") this.fail("Expecting ',' delimiter", this.place);
          this.place += 1;
          this.gap();
        }
      }
      this.place += 1;
      this.depth -= 1;
      return result;
    }

    array() {
      const items = this.items();
      for (;;) {
        const { done, value } = items.next();
        if (done) return value;
      }
    }

    // The items of the list that starts here; yields the place where each of them starts.
    *items() {
      this.enter("array");
      const result = [];
      this.place += 1;
      this.gap();
      if (this.text[this.place] !== "]") {
        for (;;) {
          yield this.place;
          result.push(this.value());
          this.gap();
          if (this.text[this.place] === "]") break;
          if (this.text[this.place] !== ",") this.fail("Expecting ',' delimiter", this.place);
          this.place += 1;
          this.gap();
        }
      }
      this.place += 1;
      this.depth -= 1;
      return result;
    }

    begin() {
      if (this.text.startsWith("\ufeff")) this.fail("Unexpected UTF-8 BOM (decode using utf-8-sig)", 0);
      this.gap();
    }

    end() {
      this.gap();
      if (this.place !== this.text.length) this.fail("Extra data", this.place);
    }
  }

  // The value of a JSON text: null, true, false, text, int, Float, array or Map.
  function parseJson(text) {
    const reader = new Reader(text);
    reader.begin();
    const value = reader.value();
    reader.end();
    return value;
  }

  // The value of a whole file, read item by item when it is a list; yields the share that is read.
  // Returns {value, odd, starts}: which of NaN, Infinity, -Infinity it holds, and where its items start.
  function* parseJsonFile(text) {
    const reader = new Reader(text);
    const starts = [];
    reader.begin();
    let value;
    if (text[reader.place] === "[") {
      const items = reader.items();
      for (let step = items.next(); ; step = items.next()) {
        value = step.value;
        if (step.done) break;
        if (starts.length % 1000 === 999) yield step.value / text.length;
        starts.push(step.value);
      }
    } else {
      value = reader.value();
    }
    reader.end();
    return { value, odd: Array.from(reader.odd).sort(), starts };
  }

  Object.assign(check, { Malformed, Unreadable, parseJson, parseJsonFile });
})();
