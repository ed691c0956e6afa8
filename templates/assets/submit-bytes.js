// A file's bytes: what they look like, gzip unpacked within a bound, and text in pieces of whole lines.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_BYTES = 512 * 2 ** 20;
  const HEAD_BYTES = 8192;
  const PIECE_BYTES = 2 ** 18;
  const NEW_LINE = 10;
  const NAMES = {
    csv: "a CSV file",
    jsonl: "a JSON Lines file",
    parquet: "a Parquet file",
    coool: "COOOL results (CSV)",
    "2coool": "2COOOL results (CSV)",
    scripts: "results of the paper's scripts (JSON)",
    coco: "COCO caption results (JSON)",
  };
  const CSV_KINDS = ["csv", "coool", "2coool"];
  const ENDINGS = {
    ".csv": CSV_KINDS,
    ".json": ["jsonl", "scripts", "coco"],
    ".jsonl": ["jsonl"],
    ".ndjson": ["jsonl"],
    ".parquet": ["parquet"],
    ".pq": ["parquet"],
  };
  const ONE_OF = "a Parquet, CSV or JSON Lines file";
  const UNPACK = "Unpack it first and give the file inside.";
  const PACKED = /\.(gz|gzip|zst|zstd|zip)$/i;
  const PACKINGS = { "\x1f\x8b": "gz", "\x28\xb5\x2f\xfd": "zst", "PK\x03\x04": "zip", "PK\x05\x06": "zip" };
  const PACKING_WORDS = { gz: "a gzip archive", zst: "a zstd archive", zip: "a zip archive" };
  const WORKBOOK = "an Excel workbook (.xlsx)";
  const SIGNS = [
    ["PAR1", "parquet"],
    ["\xd0\xcf\x11\xe0", "an old Excel workbook (.xls)"],
    ["\x1f\x8b", "a gzip archive"],
    ["BZh", "a bzip2 archive"],
    ["\xfd7zXZ", "an xz archive"],
    ["\x28\xb5\x2f\xfd", "a zstd archive"],
    ["7z\xbc\xaf", "a 7-Zip archive"],
    ["ARROW1", "an Arrow IPC (Feather) file"],
    ["%PDF", "a PDF file"],
    ["\x89PNG", "a PNG image"],
    ["\xff\xd8\xff", "a JPEG image"],
    ["\x93NUMPY", "a NumPy file"],
    ["SQLite format 3", "an SQLite database"],
    ["\xff\xfe", "text in UTF-16"],
    ["\xfe\xff", "text in UTF-16"],
  ];
  const JSON_LIST = "a JSON list";
  const TEXT_STARTS = { "{": "jsonl", "[": JSON_LIST, "<": "an HTML or XML file" };
  const COCO = /"(?:image_id|caption)"[ \t-\r]*:|^[ \t-\r]*\[[ \t-\r]*\][ \t-\r]*$/;
  const SCRIPTS = /^\{[ \t-\r]*"(?:[^"\\]|\\[^\n])*"[ \t-\r]*:[ \t-\r]*\[/;
  const OUR_KEY = /"video_id"[ \t-\r]*:/;
  const LINE_END = /[\n\v\f\r\x1c-\x1e\x85\u2028\u2029]/;
  const MARKS_2COOOL = [
    "caption before incident",
    "reason of incident",
    "incident detection",
    "incident window start frame",
  ];
  const strict = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

  function latin(bytes) {
    return Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
  }

  function textHead(bytes) {
    return latin(withoutMark(bytes.subarray(0, HEAD_BYTES))).replace(/^[ \t-\r]+/, "");
  }

  // `csv`, `jsonl`, `parquet`, or in words what else it looks like.
  function looksLike(bytes) {
    const head = latin(bytes.subarray(0, HEAD_BYTES));
    for (const [sign, name] of SIGNS) if (head.startsWith(sign)) return name;
    if (head.startsWith("PK\x03\x04")) {
      return head.includes("[Content_Types].xml") || head.includes("xl/") ? WORKBOOK : "a zip archive";
    }
    if (head.slice(257, 262) === "ustar") return "a tar archive";
    if (/^\x80[\x02-\x05]/.test(head)) return "a Python pickle";
    const odd = head.match(/[\x00-\x08\x0b\x0e-\x1f]/g);
    if (odd && odd.length > head.length * 0.1) return "binary data";
    return TEXT_STARTS[textHead(bytes)[0]] || "csv";
  }

  // Which CSV it is, by its header.
  function csvFormat(bytes) {
    const head = Uint8Array.from(textHead(bytes), (char) => char.charCodeAt(0));
    const line = new TextDecoder().decode(head).split(LINE_END)[0];
    const names = check.headerOf(line).map((name) => check.strip(name).toLowerCase());
    if (names[0] === "id" && names.some((name) => name.startsWith("hazard_track_"))) return "coool";
    const isVideos = names.includes("video") && !names.includes("video_id");
    return isVideos && MARKS_2COOOL.some((mark) => names.includes(mark)) ? "2coool" : "csv";
  }

  // The ending as Python's PurePath.suffix gives it, in lower case.
  function suffix(name) {
    const place = name.lastIndexOf(".");
    return place > 0 && place < name.length - 1 ? name.slice(place).toLowerCase() : "";
  }

  function isEmpty(bytes) {
    return bytes.every((byte) => byte === 32 || (byte >= 9 && byte <= 13));
  }

  // One of the keys of NAMES; a fault stops the check when it is none of them, or not what the name says.
  function predictionFormatOf(bytes, name, faults) {
    const formats = ENDINGS[suffix(name)];
    const expected = formats ? NAMES[formats[0]] : ONE_OF;
    let found = looksLike(bytes);
    const head = found === "jsonl" || found === JSON_LIST ? textHead(bytes) : "";
    if (found === "csv") found = csvFormat(bytes);
    else if (found === JSON_LIST && COCO.test(head)) found = "coco";
    else if (found === "jsonl" && SCRIPTS.test(head) && !OUR_KEY.test(head)) found = "scripts";
    if (!Object.hasOwn(NAMES, found)) {
      const mend = found.includes("archive") ? UNPACK : "Export the table as " + expected + ".";
      faults.stop(found, expected, mend);
    }
    if (formats && !formats.includes(found)) {
      const mend = "Give the file the ending of its format, or the format of its ending.";
      faults.stop("what looks like " + NAMES[found], expected + ", as its ending says", mend);
    }
    return found;
  }

  // How many bytes the UTF-8 sequence at `place` has; 0 when it is none.
  function sequence(bytes, place) {
    const first = bytes[place];
    if (first < 0x80) return 1;
    const count = first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : first < 0xf5 ? 4 : 0;
    if (!count || place + count > bytes.length) return 0;
    const low = { 0xe0: 0xa0, 0xf0: 0x90 }[first] || 0x80;
    const high = { 0xed: 0x9f, 0xf4: 0x8f }[first] || 0xbf;
    if (bytes[place + 1] < low || bytes[place + 1] > high) return 0;
    for (let next = place + 2; next < place + count; next += 1) if ((bytes[next] & 0xc0) !== 0x80) return 0;
    return count;
  }

  // The place of the first byte that is not UTF-8, or -1.
  function firstBad(bytes) {
    let place = 0;
    while (place < bytes.length) {
      const count = sequence(bytes, place);
      if (!count) return place;
      place += count;
    }
    return -1;
  }

  // Text, or null when it is not UTF-8.
  function decode(bytes) {
    try {
      return strict.decode(bytes);
    } catch (error) {
      if (error instanceof TypeError) return null;
      throw error;
    }
  }

  // Text in which each byte that is not UTF-8 is a surrogate, U+DC80 to U+DCFF.
  function decodeLoosely(bytes) {
    const text = decode(bytes);
    if (text !== null) return text;
    const parts = [];
    let from = 0;
    let place = 0;
    while (place < bytes.length) {
      const count = sequence(bytes, place);
      if (!count) {
        parts.push(strict.decode(bytes.subarray(from, place)), String.fromCharCode(0xdc00 + bytes[place]));
        from = place + 1;
      }
      place += count || 1;
    }
    return parts.join("") + strict.decode(bytes.subarray(from));
  }

  function withoutMark(bytes) {
    return bytes[0] === 0xef && bytes[1] === 0xbb && bytes[2] === 0xbf ? bytes.subarray(3) : bytes;
  }

  // Pieces of about 256 KB that end with a line feed (the last one need not).
  function* pieces(bytes) {
    let from = 0;
    while (from < bytes.length) {
      let end = from + PIECE_BYTES;
      if (end < bytes.length) {
        const before = bytes.lastIndexOf(NEW_LINE, end - 1) + 1;
        const after = before > from ? before : bytes.indexOf(NEW_LINE, end) + 1;
        end = after || bytes.length;
      }
      yield bytes.subarray(from, end);
      from = end;
    }
  }

  function packingOf(bytes) {
    const head = latin(bytes.subarray(0, 4));
    const sign = Object.keys(PACKINGS).find((start) => head.startsWith(start));
    return sign === undefined ? "" : PACKINGS[sign];
  }

  // The unpacked bytes of a gzip file; a bomb is not unpacked to its end. Rejects damaged data.
  async function gunzip(blob, faults) {
    const reader = blob.stream().pipeThrough(new DecompressionStream("gzip")).getReader();
    const parts = [];
    let size = 0;
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      size += value.length;
      if (size > MAX_BYTES) {
        await reader.cancel();
        const limit = MAX_BYTES / 2 ** 20 + " MB";
        const found = PACKING_WORDS.gz + " that unpacks to more than " + limit;
        faults.stop(found, "at most " + limit + ", unpacked", "Leave out what is no prediction.");
      }
      parts.push(value);
    }
    return new Uint8Array(await new Blob(parts).arrayBuffer());
  }

  async function unpacked(blob, faults) {
    try {
      return await gunzip(blob, faults);
    } catch (error) {
      if (!(error instanceof TypeError)) throw error;
      const why = " that cannot be unpacked (" + check.visible(error.message, 200) + ")";
      const found = PACKING_WORDS.gz + why;
      return faults.stop(found, ONE_OF + ", packed or not", "Pack it again, or give the file inside.");
    }
  }

  function refuseEmpty(bytes, faults) {
    if (isEmpty(bytes)) faults.stop("an empty file", ONE_OF, "Write the table again.");
  }

  // {bytes, name, packing} of a File: `packing` is `gz` when it was unpacked, `zst` or `zip` when it was not.
  async function contentOf(file, faults) {
    const limit = MAX_BYTES / 2 ** 20;
    if (file.size > MAX_BYTES) {
      const mend = "Leave out what is no prediction, or use Parquet.";
      const found = check.commas(Math.round(file.size / 2 ** 20)) + " MB";
      faults.stop(found, ONE_OF + " of at most " + limit + " MB", mend);
    }
    let bytes = new Uint8Array(await file.arrayBuffer());
    refuseEmpty(bytes, faults);
    const packing = packingOf(bytes);
    const name = file.name.replace(PACKED, "") || file.name;
    if (packing === "zip" && looksLike(bytes) === WORKBOOK) {
      faults.stop(WORKBOOK, ONE_OF, "Export the table as " + ONE_OF + ".");
    }
    if (packing === "gz") {
      bytes = await unpacked(file, faults);
      const within = packingOf(bytes);
      if (within) {
        const found = PACKING_WORDS[within] + " in " + PACKING_WORDS.gz;
        faults.stop(found, ONE_OF + ", packed once at most", "Unpack it once and give the file inside.");
      }
      refuseEmpty(bytes, faults);
    }
    return { bytes, name, packing };
  }

  Object.assign(check, {
    contentOf,
    decode,
    decodeLoosely,
    firstBad,
    pieces,
    predictionFormatOf,
    withoutMark,
  });
  check.limits.MAX_BYTES = MAX_BYTES;
})();
