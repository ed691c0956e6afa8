// What the visitor set on a video's page, kept in the address, so that a link shows the same.
(function () {
  "use strict";
  const WAIT_MS = 200; // browsers refuse addresses that change too often
  let parts = location.search.slice(1).split("&").filter(Boolean);
  let timer = 0;

  const address = () => {
    const query = parts.length ? `?${parts.join("&")}` : "";
    return location.href.split(/[?#]/)[0] + query + location.hash;
  };

  function remember() {
    try {
      history.replaceState(null, "", address());
    } catch (error) {
      // Where the address cannot be changed, the button still copies it.
    }
  }

  window.COOOLER_ADDRESS = {
    // The values of a list, or null when the address says nothing of it.
    read(name) {
      const part = parts.find((one) => one.startsWith(`${name}=`));
      if (part === undefined) return null;
      try {
        return part.slice(name.length + 1).split(",").filter(Boolean).map(decodeURIComponent);
      } catch (error) {
        return null;
      }
    },
    write(name, values) {
      parts = parts.filter((one) => !one.startsWith(`${name}=`));
      if (values) parts.push(`${name}=${values.map(encodeURIComponent).join(",")}`);
      clearTimeout(timer);
      timer = setTimeout(remember, WAIT_MS);
    },
    address,
  };
})();
