// Names for what the theme and the gallery leave without one: screen readers have nothing else to read.
addEventListener("DOMContentLoaded", () => {
  for (const toggle of document.querySelectorAll("summary > .toctree-toggle")) toggle.parentElement.setAttribute("aria-label", "pages below");
  for (const link of document.querySelectorAll(".sphx-glr-thumbcontainer a")) link.setAttribute("aria-label", link.textContent);
});
