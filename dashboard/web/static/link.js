// Press the button for the person, but not while the browser only renders the page in advance.
(() => {
  "use strict";
  const send = () => document.getElementById("link").requestSubmit();
  if (document.prerendering) document.addEventListener("prerenderingchange", send, { once: true });
  else send();
})();
