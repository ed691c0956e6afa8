// The id that a mistyped one may mean: difflib.get_close_matches of Python, for one match.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;

  function placesOf(chars) {
    const places = new Map();
    chars.forEach((char, place) => {
      if (!places.has(char)) places.set(char, []);
      places.get(char).push(place);
    });
    return places;
  }

  // The longest block that a[aLow:aHigh] and b[bLow:bHigh] share, the first one in `a`, then in `b`, as
  // [place in a, place in b, size].
  function longest(a, places, aLow, aHigh, bLow, bHigh) {
    let best = [aLow, bLow, 0];
    let lengths = new Map();
    for (let i = aLow; i < aHigh; i += 1) {
      const next = new Map();
      for (const j of places.get(a[i]) || []) {
        if (j >= bLow && j < bHigh) {
          const size = (lengths.get(j - 1) || 0) + 1;
          next.set(j, size);
          if (size > best[2]) best = [i - size + 1, j - size + 1, size];
        }
      }
      lengths = next;
    }
    return best;
  }

  // 2 * matches / (length of a + length of b); `places` says where each character of b stands.
  function ratio(a, b, places) {
    let matches = 0;
    const open = [[0, a.length, 0, b.length]];
    while (open.length) {
      const [aLow, aHigh, bLow, bHigh] = open.pop();
      const [i, j, size] = longest(a, places, aLow, aHigh, bLow, bHigh);
      if (size) {
        matches += size;
        open.push([aLow, i, bLow, j], [i + size, aHigh, j + size, bHigh]);
      }
    }
    return a.length + b.length ? (2 * matches) / (a.length + b.length) : 1;
  }

  // The best ratio that the counts of characters allow.
  function bound(a, b, places) {
    const left = new Map();
    let shared = 0;
    for (const char of a) {
      const count = left.has(char) ? left.get(char) : (places.get(char) || []).length;
      left.set(char, count - 1);
      if (count > 0) shared += 1;
    }
    return a.length + b.length ? (2 * shared) / (a.length + b.length) : 1;
  }

  // The known text nearest to `word`, or null when none reaches `cutoff`.
  function closest(word, known, cutoff) {
    const b = Array.from(word);
    const places = placesOf(b);
    let best = null;
    let bestRatio = cutoff;
    for (const text of known) {
      const a = Array.from(text);
      if ((2 * Math.min(a.length, b.length)) / (a.length + b.length) < bestRatio) continue;
      if (bound(a, b, places) < bestRatio) continue;
      const found = ratio(a, b, places);
      if (found > bestRatio || (found === bestRatio && (best === null || check.inOrder(text, best) > 0))) {
        best = text;
        bestRatio = found;
      }
    }
    return best;
  }

  Object.assign(check, { closest });
})();
