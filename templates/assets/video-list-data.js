// The data of all videos for the search of their lists: shards, each loaded once by a script tag, so that
// file:// works too. Nothing is loaded before something is asked for.
(function () {
  "use strict";
  const AT_ONCE = 16;
  const waiting = new Map();
  const { root } = document.getElementById("list-tools").dataset;
  let index = null;
  let rows = [];
  let keys = [];
  let asked = null;

  // Every data file calls this with its name and its value.
  window.COOOLER_VIDEOS = (name, value) => {
    const give = waiting.get(name);
    if (give) give(value);
  };

  function load(name) {
    return new Promise((resolve, reject) => {
      const script = document.createElement("script");
      waiting.set(name, resolve);
      script.onload = script.onerror = () => {
        script.remove();
        waiting.delete(name);
        reject(new Error(name)); // no effect when the value came
      };
      script.src = `${root}data/${name}.js`;
      document.head.append(script);
    });
  }

  // What a search looks through; a row's parts are said in sitegen/page_videos.py.
  function keyOf([name, shown, , , labels, words]) {
    return [shown || name, labels || "", ...(words || [])].join(" ").toLowerCase();
  }

  async function all(tell) {
    index = await load("videos");
    rows = new Array(index.videos);
    keys = new Array(index.videos);
    const { ends } = index;
    let next = 0;
    let done = 0;
    async function worker() {
      while (next < ends.length) {
        const number = next;
        next += 1;
        const start = number ? ends[number - 1] : 0;
        (await load(`videos/all/${number}`)).forEach((row, place) => {
          rows[start + place] = row;
          keys[start + place] = keyOf(row);
        });
        done += 1;
        tell(done, ends.length);
      }
    }
    await Promise.all(Array.from({ length: AT_ONCE }, worker));
  }

  window.COOOLER_VIDEO_LIST = {
    // Resolves when everything is here; after a failure the next call begins again.
    begin(tell) {
      if (!asked) {
        asked = all(tell);
        asked.catch(() => {
          asked = null;
        });
      }
      return asked;
    },
    index: () => index,
    row: (place) => rows[place],
    // The places of the videos that have every word, the state and the label, in order.
    find(words, state, label) {
      const found = [];
      for (let place = 0; place < rows.length; place += 1) {
        const row = rows[place];
        if (state >= 0 && row[7] !== state) continue;
        if (label && !row[6].includes(label)) continue;
        const key = keys[place];
        if (words.every((word) => key.includes(word))) found.push(place);
      }
      return found;
    },
  };
})();
