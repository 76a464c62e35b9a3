const value = cell => { const number = parseFloat(cell.textContent); return Number.isNaN(number) ? cell.textContent : number; };
for (const section of document.querySelectorAll("section.data")) {
  const table = section.querySelector("table"), body = table.tBodies[0], find = name => section.querySelector(`.${name}`);
  let rows = [...body.rows], from = 0;
  const texts = new Map(rows.map(row => [row, [...row.cells].map(cell => cell.textContent.toLowerCase()).join("\t")]));
  const found = () => {
    const words = find("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    return rows.filter(row => words.every(word => texts.get(row).includes(word)));
  };
  const show = () => {
    const hits = found(), size = Number(find("rows").value) || hits.length;
    from = Math.max(0, Math.min(from, size * Math.floor((hits.length - 1) / size)) || 0);
    body.replaceChildren(...hits.slice(from, from + size));
    find("count").textContent = hits.length ? `${from + 1} to ${Math.min(from + size, hits.length)} of ${hits.length} rows` : "no row";
    find("earlier").disabled = from === 0; find("later").disabled = from + size >= hits.length;
  };
  const move = by => { from += by * Number(find("rows").value); show(); };
  find("search").addEventListener("input", () => { from = 0; show(); });
  find("rows").addEventListener("change", () => { from = 0; show(); });
  find("earlier").addEventListener("click", () => move(-1));
  find("later").addEventListener("click", () => move(1));
  table.tHead.addEventListener("click", event => {
    if (!event.target.matches("button.sort")) return;
    const head = event.target.closest("th"), column = head.cellIndex;
    const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
    const text = head.classList.contains("text");
    rows.sort((a, b) => {
      const x = value(a.cells[column]), y = value(b.cells[column]), numbers = typeof x === "number" && typeof y === "number";
      return sign * (numbers && !(text && x === y) ? x - y : a.cells[column].textContent.localeCompare(b.cells[column].textContent));
    });
    show();
  });
  find("csv").addEventListener("click", event => {
    const quoted = cell => `"${cell.textContent.replaceAll('"', '""')}"`;
    const heads = [...table.tHead.rows[0].cells].map(head => quoted(head.querySelector("button")));
    const lines = [heads, ...found().map(row => [...row.cells].map(quoted))].map(line => line.join(","));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([lines.join("\r\n") + "\r\n"], { type: "text/csv" }));
    link.download = event.target.dataset.name; link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  show();
}
document.addEventListener("click", event => {
  if (!event.target.matches("button.case")) return;
  const id = event.target.textContent, rerun = document.getElementById("rerun");
  rerun.hidden = false;
  rerun.querySelector("code").textContent = rerun.dataset.command.replaceAll("CASE", id);
});
