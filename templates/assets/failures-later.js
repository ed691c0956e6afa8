// Very many failures: the gallery's scripts and data come when they are asked for, by the button, a key, or
// an address that chooses something.
(function () {
  "use strict";
  const button = document.getElementById("fail-load");
  const scripts = button.dataset.scripts.split(" ");
  let asked = false;

  function load(source) {
    return new Promise((resolve, reject) => {
      const script = document.createElement("script");
      script.onload = resolve;
      script.onerror = () => {
        script.remove();
        reject(new Error(source));
      };
      script.src = source;
      document.head.append(script);
    });
  }

  async function begin() {
    if (asked) return;
    asked = true;
    button.parentNode.hidden = true;
    try {
      while (scripts.length) {
        await load(scripts[0]);
        scripts.shift();
      }
    } catch (error) {
      asked = false;
      button.parentNode.hidden = false; // to be tried again
      return;
    }
  }

  button.parentNode.hidden = false;
  button.addEventListener("click", begin);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("keys").open) return;
    if (event.key === "f" && !event.target.closest("input, select, textarea")) begin();
  });
  if (location.search.length > 1) begin();
})();
