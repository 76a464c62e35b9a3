const value = cell => { const number = parseFloat(cell.textContent); return Number.isNaN(number) || cell.className ? cell.textContent : number; };
for (const table of document.querySelectorAll("table.sortable")) {
  table.tHead.addEventListener("click", event => {
    const head = event.target.closest("th"), column = head.cellIndex;
    const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
    const rows = [...table.tBodies[0].rows].sort((a, b) => {
      const x = value(a.cells[column]), y = value(b.cells[column]);
      return sign * (typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y)));
    });
    table.tBodies[0].append(...rows);
  });
}
document.addEventListener("click", event => {
  if (!event.target.matches("button.case")) return;
  const id = event.target.textContent, rerun = document.getElementById("rerun");
  rerun.hidden = false;
  rerun.querySelector("code").textContent = rerun.dataset.command.replaceAll("CASE", id);
});
