// Predictions as other challenges have them in CSV: COOOL's results.csv, and 2COOOL's.
// Each reader gives {column, rows, predictions, warnings}: where the ids stand, the row where an id comes
// first, and the id of each prediction.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_SLOTS = 23;
  const CAPTION_2COOOL = "Caption Before Incident";
  const FRAME_ID = /^([^]+)_([0-9]{1,10})$/;
  const FLOAT = /^([0-9]{1,18})\.0+$/;
  const HEADER = "ID,Driver_State_Changed,Hazard_Track_1,Hazard_Name_1,Hazard_Track_2,Hazard_Name_2,...";

  function counted(count, one, many) {
    return check.commas(count) + " " + (count === 1 ? one : many);
  }

  function withoutZeros(clean) {
    const found = FLOAT.exec(clean);
    return found ? found[1] : clean;
  }

  // Cells checked once for each distinct text.
  class Cells {
    constructor(test, faults) {
      this.test = test;
      this.faults = faults;
      this.known = new Map();
    }

    clean(text, row, column) {
      if (!this.known.has(text)) this.known.set(text, check.judged(this.test, text));
      const result = this.known.get(text);
      if (!(result instanceof check.Wrong)) return result;
      this.faults.add(row, column, result.found, result.expected, result.mend);
      return null;
    }
  }

  // The names of the header without empty cells at the end; slots count from 0 or 1.
  function slotsOf(header, faults) {
    const names = header.map(check.strip);
    while (names.length && !names[names.length - 1]) names.pop();
    const plain = names.map((name) => name.toLowerCase());
    const first = plain.includes("hazard_track_0") ? 0 : 1;
    const count = Math.floor((names.length - 2) / 2);
    const expected = ["id", "driver_state_changed"];
    for (let slot = first; slot < first + Math.max(count, 1); slot += 1) {
      expected.push("hazard_track_" + slot, "hazard_name_" + slot);
    }
    if (plain.join(",") !== expected.join(",") || plain.length !== expected.length) {
      const end = Math.min(names.length, expected.length);
      const wrong = plain.slice(0, end).findIndex((name, place) => name !== expected[place]);
      const among = wrong < 0 ? "" : "'" + check.visible(names[wrong]) + "' among its columns";
      const found = "a header with " + (among || names.length + " columns");
      faults.stop(found, HEADER, "Write the header as the challenge does.");
    }
    if (count > MAX_SLOTS) {
      const found = check.commas(count) + " slots for hazards";
      faults.stop(found, "at most " + MAX_SLOTS, "Leave out the others.");
    }
    return names;
  }

  // The captions of one file of COOOL results, taken row by row.
  class CooolRows {
    constructor(faults) {
      this.faults = faults;
      this.header = null;
      this.row = 0;
      this.frameRows = new Map(); // video -> frame -> row
      this.videos = new Map(); // video -> track and caption -> {row, column, first, frames}
      this.untold = 0;
      this.tracks = new Cells((value) => withoutZeros(check.identifier(value, "a track id")), faults);
      this.names = new Cells(check.description, faults);
    }

    take(cells) {
      if (!this.header) {
        this.header = slotsOf(cells, this.faults);
        return;
      }
      this.row += 1;
      check.limitRows(this.row, this.faults);
      const width = this.header.length;
      const place = this.frame(cells[0]);
      if (check.strip(cells.slice(width).join(""))) {
        const expected = "at most " + width + ", as in the header";
        this.faults.add(this.row, null, cells.length + " cells", expected, check.QUOTE_IT);
        return;
      }
      const slots = cells.slice(2, width);
      if (!place || check.isBlank(slots.join(""))) return;
      for (let slot = 0; slot < slots.length; slot += 2) this.slot(slots, slot, place);
    }

    slot(slots, slot, [video, frame]) {
      const track = check.strip(slots[slot]);
      const column = this.header[slot + 3];
      if (slot + 1 === slots.length) {
        const found = "the track '" + check.visible(track) + "' without a cell for its caption";
        const where = this.header[slot + 2];
        if (track) this.faults.add(this.row, where, found, "a track and its caption", check.QUOTE_IT);
        return;
      }
      const name = check.strip(slots[slot + 1]);
      const cleanTrack = track ? this.tracks.clean(track, this.row, this.header[slot + 2]) : "";
      if (!name) {
        this.untold += cleanTrack ? 1 : 0;
        return;
      }
      const cleanName = this.names.clean(name, this.row, column);
      if (cleanTrack === null || cleanName === null) return;
      if (!this.videos.has(video)) this.videos.set(video, new Map());
      const seen = this.videos.get(video);
      const key = cleanTrack + "\0" + cleanName;
      if (!seen.has(key)) seen.set(key, { row: this.row, column, first: [frame, slot], frames: new Set() });
      const caption = seen.get(key);
      if (frame < caption.first[0] || (frame === caption.first[0] && slot < caption.first[1])) {
        caption.first = [frame, slot];
      }
      caption.frames.add(frame);
    }

    // Video and frame of an ID such as `video_0001_0`, or null after its fault is noted.
    frame(cell) {
      const found = FRAME_ID.exec(check.strip(cell));
      const frame = found ? Number(found[2]) : -1;
      if (!found || frame > check.limits.MAX_WHOLE) {
        const mend = "Write the video's id, '_', and the frame's number from 0.";
        this.faults.add(this.row, "ID", check.show(cell), "an ID such as 'video_0001_0'", mend);
        return null;
      }
      const video = found[1];
      if (!this.frameRows.has(video)) this.frameRows.set(video, new Map());
      const rows = this.frameRows.get(video);
      if (rows.has(frame)) {
        const first = "again (first in row " + rows.get(frame) + ")";
        const again = "frame " + frame + " of video '" + check.visible(video) + "' " + first;
        const expected = "each frame of a video once";
        this.faults.add(this.row, "ID", again, expected, "Renumber or remove the row.");
        return null;
      }
      rows.set(frame, this.row);
      return [video, frame];
    }

    captions() {
      const predictions = [];
      const most = check.limits.MAX_LIST_ITEMS;
      for (const [video, seen] of this.videos) {
        for (let count = 0; count < seen.size; count += 1) predictions.push(video);
        const long = Array.from(seen.values()).filter((caption) => caption.frames.size > most);
        const earlier = (a, b) => a.first[0] - b.first[0] || a.first[1] - b.first[1];
        long.sort((a, b) => b.frames.size - a.frames.size || earlier(a, b));
        for (const caption of long) {
          const frames = "a caption in " + check.commas(caption.frames.size) + " frames of video '";
          const expected = "at most " + check.commas(most) + " frames";
          const found = frames + check.visible(video) + "'";
          this.faults.add(caption.row, caption.column, found, expected, "Leave some out.");
        }
      }
      const rows = new Map();
      for (const [video, ofFrames] of this.frameRows) {
        let first = Infinity;
        for (const row of ofFrames.values()) first = Math.min(first, row);
        rows.set(video, first);
      }
      const places = counted(this.untold, "track in a frame has", "tracks in frames have");
      const warnings = this.untold ? [places + " no caption and thus no prediction."] : [];
      return { column: "ID", rows, predictions, warnings };
    }
  }

  function* readCoool(bytes, faults) {
    const rows = new CooolRows(faults);
    yield* check.csvRecords(bytes, true, faults, (cells) => rows.take(cells));
    return rows.captions();
  }

  // Where a column stands: the one of this name, else the only one that differs in case alone.
  function placeOf(header, name, faults) {
    const places = Array.from(header.keys());
    const exact = places.filter((place) => header[place] === name);
    const alike = places.filter((place) => header[place].toLowerCase() === name.toLowerCase());
    const same = exact.length ? exact : alike;
    if (same.length === 1) return same[0];
    if (same.length) {
      faults.add(null, name, same.length + " columns of this name", "one", "Remove or rename one.");
    } else {
      const columns = header.slice(0, 20).map((other) => check.visible(other)).join(", ");
      const mend = "Choose the column of the captions among these, or add it.";
      faults.add(null, name, "no such column, but the columns " + columns, "a column `" + name + "`", mend);
    }
    return -1;
  }

  function* readTwoCoool(bytes, faults) {
    const captions = { column: "video", rows: new Map(), predictions: [], warnings: [] };
    const videoOf = (value) => withoutZeros(check.identifier(value, "a video's number"));
    let header = null;
    let videoPlace = -1;
    let place = -1;
    let row = 0;
    let empty = 0;
    yield* check.csvRecords(bytes, true, faults, function (cells) {
      if (!header) {
        header = cells.map(check.strip);
        videoPlace = placeOf(header, "video", faults);
        place = placeOf(header, CAPTION_2COOOL, faults);
        faults.stopIfAny();
        captions.column = header[videoPlace];
        return;
      }
      row += 1;
      check.limitRows(row, faults);
      if (cells.length !== header.length) {
        const expected = header.length + " cells, as in the header";
        faults.add(row, null, cells.length + " cells", expected, check.QUOTE_IT);
        return;
      }
      const video = check.checked(videoOf, cells[videoPlace], faults, row, captions.column);
      const raw = cells[place];
      const missing = check.isMissing(raw);
      empty += missing ? 1 : 0;
      const caption = missing ? "" : check.checked(check.description, raw, faults, row, header[place]);
      if (video === null) return;
      if (captions.rows.has(video)) {
        const first = "again (first in row " + captions.rows.get(video) + ")";
        const again = "video '" + check.visible(video) + "' " + first;
        faults.add(row, captions.column, again, "one row for each video", "Remove one of the rows.");
        return;
      }
      captions.rows.set(video, row);
      if (caption) captions.predictions.push(video);
    });
    if (empty) {
      const said = counted(empty, "row has", "rows have") + " no text in '" + check.visible(header[place]);
      captions.warnings.push(said + "' and count as no prediction.");
    }
    return captions;
  }

  Object.assign(check, { readCoool, readTwoCoool });
  check.limits.MAX_SLOTS = MAX_SLOTS;
})();
