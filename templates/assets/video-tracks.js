// Boxes by track: each chip draws its track or not; what is hovered or focused stands out.
(function () {
  "use strict";
  const address = window.COOOLER_ADDRESS;
  const chips = Array.from(document.querySelectorAll("#tracks input"));
  const isHazard = (chip) => chip.parentNode.classList.contains("hazard");
  const others = chips.filter((chip) => !isHazard(chip));
  const boxes = document.getElementById("show-boxes");
  const traffic = document.getElementById("show-traffic");

  function draw() {
    const off = new Set(chips.filter((chip) => !chip.checked).map((chip) => chip.value));
    document.querySelectorAll(".boxes g").forEach((box) => {
      box.toggleAttribute("hidden", off.has(box.dataset.track));
    });
    if (!traffic) return;
    const shown = others.filter((chip) => chip.checked).length;
    traffic.checked = shown > 0;
    traffic.indeterminate = shown > 0 && shown < others.length;
  }

  function change() {
    const shown = chips.filter((chip) => chip.checked).map((chip) => chip.value);
    address.write("tracks", shown.length < chips.length ? shown : null);
    address.write("boxes", boxes.checked ? null : ["off"]);
    draw();
  }

  function choose(wanted) {
    chips.forEach((chip) => {
      chip.checked = wanted(chip);
    });
  }

  chips.forEach((chip) => chip.addEventListener("change", change));
  boxes.addEventListener("change", change);
  if (traffic) {
    traffic.addEventListener("change", () => {
      const on = traffic.checked;
      choose((chip) => (isHazard(chip) ? chip.checked : on));
      change();
    });
  }
  document.querySelectorAll(".crops a[data-frame]").forEach((link) => {
    link.addEventListener("click", () => {
      const track = link.closest("[data-lights]").dataset.lights;
      boxes.checked = true;
      choose((chip) => chip.checked || chip.value === track);
      change();
    });
  });

  // The pointer goes before the focus.
  let hovered = null;
  let focused = null;
  function light() {
    const track = (hovered || focused || { dataset: {} }).dataset.lights;
    document.querySelectorAll(".boxes g").forEach((box) => {
      box.classList.toggle("lit", box.dataset.track === track);
    });
  }
  const lights = (event) => event.target instanceof Element && event.target.closest("[data-lights]");
  document.addEventListener("pointerover", (event) => {
    const next = event.pointerType === "touch" ? null : lights(event) || null;
    if (next === hovered) return;
    hovered = next;
    light();
  });
  document.addEventListener("focusin", (event) => {
    focused = lights(event) || null;
    light();
  });
  document.addEventListener("focusout", () => {
    focused = null;
    light();
  });

  const asked = address.read("tracks");
  if (asked) choose((chip) => asked.includes(chip.value));
  if (address.read("boxes")) boxes.checked = false;
  draw();
})();
