// The faults of one file, collected, counted and put in order.
(function () {
  "use strict";
  const check = window.COOOLER_CHECK;
  const MAX_DETAILED_FAULTS = 1_000;

  // Thrown when nothing more can be read.
  class Stop extends Error {}

  // The faults of one file: of each column 1,000 in detail, of the rest the count.
  class Faults {
    constructor() {
      this.kept = new Map();
      this.more = 0;
      this.lineOf = () => null; // the line of a row
    }

    add(row, column, found, expected, mend, line = null) {
      if (!this.kept.has(column)) this.kept.set(column, []);
      const ofColumn = this.kept.get(column);
      const fault = { row, column, found, expected, mend, line };
      if (ofColumn.length < MAX_DETAILED_FAULTS) ofColumn.push(fault);
      else this.more += 1;
    }

    stop(found, expected, mend, line = null) {
      this.add(null, null, found, expected, mend, line);
      throw new Stop(found);
    }

    stopIfAny() {
      if (this.kept.size) throw new Stop("faults");
    }

    // In the order of the rows.
    list() {
      const { lineOf } = this;
      const faults = Array.from(this.kept.values()).flat();
      faults.sort((a, b) => (a.row || 0) - (b.row || 0));
      const more = this.more + Math.max(0, faults.length - MAX_DETAILED_FAULTS);
      const shown = faults.slice(0, MAX_DETAILED_FAULTS).map(function (fault) {
        const known = fault.row === null || fault.line !== null;
        return known ? fault : { ...fault, line: lineOf(fault.row) };
      });
      if (more) {
        const found = check.commas(more) + " more faults";
        const mend = "Mend the faults above and check again.";
        shown.push({ row: null, column: null, found, expected: "none", mend, line: null, more });
      }
      return shown;
    }
  }

  Object.assign(check, { Faults, Stop });
})();
