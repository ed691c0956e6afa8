// The list of videos: its filter in the address, and handed on to the video that is opened.
(function () {
  "use strict";
  const KEY = "coooler-walk";
  const search = document.getElementById("search");
  const select = document.querySelector("[data-state-filter]");
  const given = new URLSearchParams(location.search);

  const words = () => search.value.trim();
  const state = () => (select ? select.value : "");

  function address() {
    const query = new URLSearchParams();
    if (state()) query.set("show", state());
    if (words()) query.set("q", words());
    const text = query.toString();
    return location.href.split(/[?#]/)[0] + (text ? `?${text}` : "");
  }

  let timer = 0;
  function remember() {
    clearTimeout(timer);
    timer = setTimeout(() => {
      try {
        history.replaceState(null, "", address());
      } catch (error) {
        // The filter is not in the address then.
      }
    }, 200);
  }

  function title() {
    const parts = [];
    if (state()) parts.push(select.selectedOptions[0].textContent);
    if (words()) parts.push(words());
    return parts.join(", ");
  }

  function leave() {
    const links = document.querySelectorAll(".card:not([hidden]) .card-link");
    const ids = Array.from(links, (link) => link.getAttribute("href"));
    try {
      if (title()) sessionStorage.setItem(KEY, JSON.stringify({ ids, from: address(), title: title() }));
      else sessionStorage.removeItem(KEY);
    } catch (error) {
      // Then videos follow each other in the usual order.
    }
  }

  search.value = given.get("q") || search.value;
  if (select && Array.from(select.options).some((option) => option.value === given.get("show"))) {
    select.value = given.get("show");
  }
  search.dispatchEvent(new Event("input", { bubbles: true }));
  search.addEventListener("input", remember);
  if (select) select.addEventListener("change", remember);
  document.querySelector(".cards").addEventListener("click", (event) => {
    if (event.target.closest(".card-link")) leave();
  });
})();
