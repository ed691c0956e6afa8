// The table as it is shown, as Markdown or LaTeX. Outside text is escaped as the downloads do it.
(function () {
  "use strict";
  const { TEXT } = window.COOOLER_WORDS;
  const SPECIAL = /[&<>"\\`*_[\]|~#@:$]|(?<=www)\./gi;
  const LATEX = {
    "\\": "\\textbackslash{}",
    "~": "\\textasciitilde{}",
    "^": "\\textasciicircum{}",
    "<": "\\textless{}",
    ">": "\\textgreater{}",
    "|": "\\textbar{}",
    "⟨": "$\\langle$",
    "⟩": "$\\rangle$",
    "–": "--",
    "\u202f": "\\,",
  };
  "#$%&_{}".split("").forEach((char) => {
    LATEX[char] = `\\${char}`;
  });
  const latex = (text) => Array.from(text, (char) => LATEX[char] || char).join("");
  const escaped = (text) => text.replace(SPECIAL, (char) => `&#${char.codePointAt(0)};`);

  // `table` is { title, columns: [{ text, number }], rows: [[text]], notes: [text] }.
  function markdown(table) {
    const line = (cells) => `| ${cells.map(escaped).join(" | ")} |`;
    return [
      `# ${escaped(table.title)}`,
      "",
      line(table.columns.map((column) => column.text)),
      `|${table.columns.map((column) => (column.number ? "---:" : "---")).join("|")}|`,
      ...table.rows.map(line),
      ...table.notes.flatMap((note) => ["", escaped(note)]),
      "",
    ].join("\n");
  }

  function tabular(table) {
    const line = (cells) => `${cells.map(latex).join(" & ")} \\\\`;
    return [
      `% ${table.title}: ${TEXT.notes.booktabs}`,
      ...table.notes.map((note) => `% ${note}`),
      `\\begin{tabular}{${table.columns.map((column) => (column.number ? "r" : "l")).join("")}}`,
      "\\toprule",
      line(table.columns.map((column) => column.text)),
      "\\midrule",
      ...table.rows.map(line),
      "\\bottomrule",
      "\\end{tabular}",
      "",
    ].join("\n");
  }

  // To the clipboard, or where that is closed into a window to copy from.
  async function copy(what, text, say) {
    try {
      await navigator.clipboard.writeText(text);
      say(TEXT.copied[what]);
    } catch (error) {
      const dialog = document.getElementById("board-dialog");
      const field = dialog.querySelector("textarea");
      field.value = text;
      dialog.showModal();
      field.focus();
      field.select();
      say(TEXT.byHand);
    }
  }

  window.COOOLER_COPY = { markdown, latex: tabular, copy };
})();
