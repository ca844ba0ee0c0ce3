/* What the theme leaves out for keyboards, screen readers and narrow screens. */
document.addEventListener("DOMContentLoaded", () => {
  document.querySelectorAll("p.caption[role=heading]").forEach((e) => e.setAttribute("aria-level", "2"));
  document.querySelectorAll("pre, .table-wrapper").forEach((e) => e.setAttribute("tabindex", "0"));
  document.querySelectorAll("td span.pre").forEach((e) => { e.innerHTML = e.innerHTML.replace(/[_/](?=\w)|::(?=\w)/g, "$&<wbr>"); });
});
