// Texts and values as Python counts, judges and prints them: the page words a fault as `coooler check` does.
(function () {
  "use strict";
  const SHOWN_CHARS = 80;
  // str.isspace() and \s of Python; JavaScript's own \s differs (U+001C to U+001F, U+0085, U+FEFF).
  const BLANK = "\\t-\\r\\x1c-\\x20\\x85\\xa0\\u1680\\u2000-\\u200a\\u2028\\u2029\\u202f\\u205f\\u3000";
  const ALL_BLANK = new RegExp("^[" + BLANK + "]*$");
  const LEADING = new RegExp("^[" + BLANK + "]+");
  const BLANK_CHAR = new RegExp("[" + BLANK + "]");
  const UNSEEN = /[\p{Cc}\p{Cf}\p{Cs}\p{Co}\p{Cn}\p{Zl}\p{Zp}]/gu;
  const NOT_PRINTABLE = /[\p{C}\p{Zl}\p{Zp}]|(?! )\p{Zs}/gu;
  const PRINTED = /[^\p{C}\p{Z}]/u;
  const LONE = /\p{Cs}+/u;

  // A float of Python; ints are JavaScript numbers, or BigInt beyond 2**53.
  class Float {
    constructor(value) {
      this.value = value;
    }
  }

  // Code points, not UTF-16 units.
  function size(text) {
    let count = text.length;
    for (let place = 0; place < text.length - 1; place += 1) {
      if (text.codePointAt(place) > 0xffff) {
        count -= 1;
        place += 1;
      }
    }
    return count;
  }

  function head(text, limit) {
    if (text.length <= limit) return text;
    let end = 0;
    for (let count = 0; count < limit && end < text.length; count += 1) {
      end += text.codePointAt(end) > 0xffff ? 2 : 1;
    }
    return text.slice(0, end);
  }

  function tail(text, limit) {
    return Array.from(text.slice(-2 * limit)).slice(-limit).join("");
  }

  function isBlank(text) {
    return ALL_BLANK.test(text);
  }

  function strip(text) {
    let end = text.length;
    while (end && BLANK_CHAR.test(text[end - 1])) end -= 1;
    return text.slice(0, end).replace(LEADING, "");
  }

  function commas(number) {
    return String(number).replace(/\B(?=(\d{3})+$)/g, ",");
  }

  function hex(number, digits) {
    return number.toString(16).padStart(digits, "0");
  }

  function escaped(char) {
    const code = char.codePointAt(0);
    if (char === "\n") return "\\n";
    if (char === "\r") return "\\r";
    if (char === "\t") return "\\t";
    if (code < 0x100) return "\\x" + hex(code, 2);
    return code < 0x10000 ? "\\u" + hex(code, 4) : "\\U" + hex(code, 8);
  }

  // One line: characters that nobody sees as escapes, cut at `limit`.
  function visible(text, limit = SHOWN_CHARS) {
    const shown = head(text, limit);
    return shown.replace(UNSEEN, escaped) + (shown.length < text.length ? "..." : "");
  }

  function isInt(value) {
    return typeof value === "number" || typeof value === "bigint";
  }

  function typeName(value) {
    if (value === null) return "NoneType";
    if (typeof value === "string") return "str";
    if (typeof value === "boolean") return "bool";
    if (isInt(value)) return "int";
    if (value instanceof Float) return "float";
    return value instanceof Map ? "dict" : "list";
  }

  function floatText(value) {
    if (Number.isNaN(value)) return "nan";
    if (!Number.isFinite(value)) return value > 0 ? "inf" : "-inf";
    const [digits, power] = value.toExponential().split("e");
    const exponent = Number(power);
    if (value !== 0 && (exponent < -4 || exponent >= 16)) {
      return digits + "e" + (exponent < 0 ? "-" : "+") + String(Math.abs(exponent)).padStart(2, "0");
    }
    const text = Object.is(value, -0) ? "-0" : String(value);
    return text.includes(".") ? text : text + ".0";
  }

  function stringText(text) {
    const quote = text.includes("'") && !text.includes('"') ? '"' : "'";
    const inside = text.replace(/\\/g, "\\\\").replace(NOT_PRINTABLE, escaped);
    return quote + (quote === "'" ? inside.replace(/'/g, "\\'") : inside) + quote;
  }

  // The middle of a long text left out, as Python's reprlib does.
  function cut(text, limit, whole) {
    if (size(text) <= limit) return text;
    const before = Math.floor((limit - 3) / 2);
    const after = limit - 3 - before;
    const long = whole === undefined ? text : stringText(head(whole, before) + tail(whole, after));
    return head(long, before) + "..." + tail(long, after);
  }

  function inOrder(a, b) {
    const left = Array.from(a);
    const right = Array.from(b);
    for (let place = 0; place < Math.min(left.length, right.length); place += 1) {
      if (left[place] !== right[place]) return left[place].codePointAt(0) - right[place].codePointAt(0);
    }
    return left.length - right.length;
  }

  // A value in short, as Python's reprlib.repr prints it.
  function short(value, level = 6) {
    if (value === null) return "None";
    if (typeof value === "boolean") return value ? "True" : "False";
    if (isInt(value)) return cut(String(value), 40);
    if (value instanceof Float) return floatText(value.value);
    if (typeof value === "string") return cut(stringText(head(value, 30)), 30, value);
    if (value instanceof Map) {
      if (!value.size) return "{}";
      if (level <= 0) return "{...}";
      const keys = Array.from(value.keys()).sort(inOrder).slice(0, 4);
      const pairs = keys.map((key) => short(key, level - 1) + ": " + short(value.get(key), level - 1));
      return "{" + pairs.concat(value.size > 4 ? ["..."] : []).join(", ") + "}";
    }
    if (level <= 0 && value.length) return "[...]";
    const items = value.slice(0, 6).map((item) => short(item, level - 1));
    return "[" + items.concat(value.length > 6 ? ["..."] : []).join(", ") + "]";
  }

  // A cell as a fault quotes it.
  function show(value) {
    if (typeof value === "string") {
      if (isBlank(value)) return value ? "only blanks" : "an empty cell";
      const count = value.length > SHOWN_CHARS ? size(value) : 0;
      return (count > SHOWN_CHARS ? commas(count) + " characters: " : "") + "'" + visible(value) + "'";
    }
    if (value === null) return "nothing (null)";
    if (value instanceof Float && Number.isNaN(value.value)) return "NaN";
    return visible(short(value)) + " (" + typeName(value) + ")";
  }

  // The first surrogates that stand alone, as the bytes that Python shows; "" without any.
  function brokenBytes(text) {
    const found = LONE.exec(text);
    if (!found) return "";
    const asBytes = found[0].charCodeAt(0) >= 0xdc80 && found[0].charCodeAt(0) <= 0xdcff;
    const bytes = Array.from(found[0]).flatMap((char) => {
      const code = char.codePointAt(0);
      if (asBytes && code >= 0xdc80 && code <= 0xdcff) return [code - 0xdc00];
      return [0xe0 | (code >> 12), 0x80 | ((code >> 6) & 0x3f), 0x80 | (code & 0x3f)];
    });
    return "b'" + bytes.slice(0, 8).map((byte) => "\\x" + hex(byte, 2)).join("") + "'";
  }

  window.COOOLER_CHECK = {
    BLANK,
    Float,
    brokenBytes,
    commas,
    head,
    hex,
    inOrder,
    isBlank,
    isInt,
    show,
    size,
    strip,
    typeName,
    visible,
    isPrinted: (text) => PRINTED.test(text),
  };
})();
