/* What the theme leaves out for keyboards and screen readers. */
document.addEventListener("DOMContentLoaded", () => {
  document.querySelectorAll("p.caption[role=heading]").forEach((e) => e.setAttribute("aria-level", "2"));
  document.querySelectorAll("pre, article table.docutils").forEach((e) => e.setAttribute("tabindex", "0"));
});
