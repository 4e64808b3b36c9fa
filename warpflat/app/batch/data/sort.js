const heads = [...document.querySelectorAll("th")], body = document.querySelector("tbody");
function compare(a, b) {
  if (!a || !b) return !a - !b;
  return isNaN(a) || isNaN(b) ? a.localeCompare(b, undefined, { numeric: true }) : a - b;
}
heads.forEach((head, column) => head.addEventListener("click", () => {
  const up = head.ariaSort !== "ascending", value = (row) => row.cells[column].dataset.value;
  heads.forEach((each) => each.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
  const rows = [...body.rows].sort((a, b) => {
    const empty = !value(a) - !value(b);
    return empty || (up ? 1 : -1) * compare(value(a), value(b));
  });
  body.append(...rows);
}));
