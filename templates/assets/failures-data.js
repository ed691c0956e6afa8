// The failures page's data: shards, each loaded once by a script tag, so that file:// works too.
// Numbers of failures are kept in columns; a failure is known by its place in them.
(function () {
  "use strict";
  const AT_ONCE = 16;
  const waiting = new Map();
  const asked = new Map();
  const queue = [];
  let running = 0;
  let index = null;
  let columns = null;
  const videos = []; // [path name, id as shown, card]
  const hazards = [null]; // [video, label, size, label as shown, description], from 1
  const parts = []; // of texts: {name, start, loaded}
  let texts = [];
  let lower = [];

  // Every data file calls this with its name and its value.
  window.COOOLER_FAILURES = (name, value) => {
    if (name === "failures") index = value;
    const give = waiting.get(name);
    if (give) give(value);
  };

  function load(name, first = false) {
    const full = `failures/${name}`;
    if (!asked.has(full)) {
      asked.set(full, new Promise((resolve, reject) => {
        const job = { full, resolve, reject };
        if (first) queue.unshift(job);
        else queue.push(job);
      }));
      asked.get(full).catch(() => asked.delete(full)); // so that it is asked for again
      pump();
    }
    return asked.get(full);
  }

  function pump() {
    while (running < AT_ONCE && queue.length) {
      const { full, resolve, reject } = queue.shift();
      const script = document.createElement("script");
      running += 1;
      waiting.set(full, resolve);
      script.onload = script.onerror = () => {
        script.remove();
        waiting.delete(full);
        running -= 1;
        reject(new Error(full)); // no effect when the value came
        pump();
      };
      script.src = `data/${full}.js`;
      document.head.append(script);
    }
  }

  // All shards of a list, each handed to `take(rows, start)`; resolves to the number of those that failed.
  async function each(name, ends, take) {
    const found = ends.map((end, number) => load(`${name}/${number}`).then((rows) => {
      take(rows, number ? ends[number - 1] : 0);
      return 0;
    }, () => 1));
    return (await Promise.all(found)).reduce((sum, one) => sum + one, 0);
  }

  const last = (ends) => (ends.length ? ends[ends.length - 1] : 0);

  function prepare() {
    const { failures, systems } = index;
    columns = {
      length: failures,
      ready: new Uint8Array(failures),
      kind: new Uint8Array(failures),
      stages: new Uint8Array(failures),
      score: new Uint8Array(failures),
      size: new Uint8Array(failures),
      label: new Uint32Array(failures),
      system: new Uint16Array(failures),
      video: new Uint32Array(failures),
      hazard: new Uint32Array(failures),
      rank: new Uint32Array(failures),
      units: new Uint16Array(failures),
      said: new Uint32Array(failures),
      evidence: new Uint32Array(failures),
    };
    let total = 1;
    systems.forEach(([slug, , , ends]) => {
      ends.forEach((end, number) => {
        const start = total + (number ? ends[number - 1] : 0);
        parts.push({ name: `texts/${slug}/${number}`, start, loaded: false });
      });
      total += last(ends);
    });
    texts = new Array(total).fill("");
    lower = new Array(total).fill("");
  }

  // Everything but texts: videos and hazards first, then the failures of one system after the other.
  async function begin(then) {
    prepare();
    const { systems, ranges } = index;
    const none = index.sizes.length - 1;
    let failed = await each("videos", index.videos, (rows, start) => rows.forEach((row, place) => {
      videos[start + place] = row;
    }));
    failed += await each("hazards", index.hazards, (rows, start) => rows.forEach((row, place) => {
      hazards[start + place + 1] = row;
    }));
    if (failed) return failed;
    const all = systems.reduce((sum, [, , ends]) => sum + ends.length, 0);
    let done = 0;
    let base = 0;
    let words = 0;
    then(0, all);
    const found = systems.map(([slug, , ends, ofTexts], system) => {
      const [firstRow, firstText] = [base, words];
      base += last(ends);
      words += last(ofTexts);
      return each(`rows/${slug}`, ends, (rows, start) => {
        rows.forEach((row, place) => put(row, firstRow + start + place, system, firstText));
        done += 1;
        then(done, all);
      });
    });
    function put([video, kind, hazard, rank, units, stages, said, evidence], at, system, firstText) {
      columns.video[at] = video;
      columns.kind[at] = kind;
      columns.hazard[at] = hazard;
      columns.rank[at] = rank;
      columns.units[at] = units;
      columns.stages[at] = stages;
      columns.said[at] = said ? firstText + said : 0;
      columns.evidence[at] = evidence ? firstText + evidence : 0;
      columns.system[at] = system;
      columns.score[at] = Math.min(Math.floor(units / index.range), ranges.length - 1);
      columns.label[at] = hazard ? hazards[hazard][1] : 0;
      columns.size[at] = hazard ? hazards[hazard][2] : none;
      columns.ready[at] = 1;
    }
    return (await Promise.all(found)).reduce((sum, one) => sum + one, failed);
  }

  async function read(part, first) {
    if (part.loaded) return;
    const rows = await load(part.name, first);
    rows.forEach((text, place) => {
      texts[part.start + place] = text;
      lower[part.start + place] = text.toLowerCase();
    });
    part.loaded = true;
  }

  // A text by its number; null while it is not here.
  function text(number) {
    return partOf(number).loaded ? texts[number] : null;
  }

  function partOf(number) {
    let low = 0;
    let high = parts.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (parts[middle].start <= number) low = middle;
      else high = middle - 1;
    }
    return parts[low];
  }

  // All texts, for a search in them; resolves to the number of shards that failed.
  async function everyText(then) {
    let done = parts.filter((part) => part.loaded).length;
    const missing = parts.filter((part) => !part.loaded).map((part) => read(part).then(() => {
      done += 1;
      then(done, parts.length);
      return 0;
    }, () => 1));
    return (await Promise.all(missing)).reduce((sum, one) => sum + one, 0);
  }

  // The hazards that a failure is about: its own, or for a caption's failure all of the video.
  let ofVideo = null;
  function hazardsOf(at) {
    if (columns.hazard[at]) return [hazards[columns.hazard[at]]];
    if (!ofVideo) {
      ofVideo = videos.map(() => []);
      hazards.slice(1).forEach((hazard) => ofVideo[hazard[0]].push(hazard));
    }
    return ofVideo[columns.video[at]];
  }

  window.COOOLER_FAILURE_DATA = {
    index: () => index,
    path: (place) => `videos/${videos[columns.video[place]][0]}.html`,
    columns: () => columns,
    videos,
    hazards,
    begin,
    text,
    want: (number) => read(partOf(number), true),
    lower: () => lower,
    everyText,
    hasTexts: () => parts.every((part) => part.loaded),
    hazardsOf,
  };
})();
