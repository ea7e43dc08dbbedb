"use strict";
(() => {
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const said = document.getElementById("said");

  // copy
  const copied = async (text) => {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {
      const area = document.createElement("textarea");
      area.value = text;
      area.className = "unseen";
      document.body.append(area);
      area.select();
      const done = document.execCommand("copy");
      area.remove();
      return done;
    }
  };
  document.addEventListener("click", async (event) => {
    const button = event.target.closest("button.copy");
    if (!button) return;
    const label = button.dataset.label ?? button.textContent;
    button.dataset.label = label;
    const done = await copied(button.dataset.text);
    button.focus();
    button.textContent = said.textContent = done ? "Copied" : "Not copied: select the text instead";
    setTimeout(() => { button.textContent = label; said.textContent = ""; }, 2000);
  });

  // the value of every curve at the sample nearest to the pointer, or to where the arrow keys are
  const plots = new WeakMap();
  const written = (value) => value === null ? "–" : String(Number(value.toPrecision(5))).replace("-", "−");
  const plotOf = (box) => {
    if (!plots.has(box)) {
      const data = JSON.parse(box.querySelector("script").textContent);
      const [low, high, log] = data.across;
      const scale = log ? Math.log : (value) => value;
      data.at = data.x.map((value) => (scale(value) - scale(low)) / (scale(high) - scale(low)));
      const figure = box.closest("figure");
      data.outputs = all(".legend output", figure);
      data.names = all(".legend .name", figure).map((name) => name.textContent);
      data.line = box.querySelector(".cursor");
      data.label = all("text.axis", box)[0].textContent;
      plots.set(box, data);
    }
    return plots.get(box);
  };
  const show = (box, index) => {
    const data = plotOf(box), i = Math.max(0, Math.min(data.x.length - 1, index));
    data.index = i;
    const place = data.at[i] * data.box[2];
    data.line.setAttribute("x1", place);
    data.line.setAttribute("x2", place);
    data.outputs.forEach((output, k) => { output.textContent = written(data.curves[k][i]); });
    const head = data.label.replace(/ \[.*\]$/, "") + " = " + written(data.x[i]);
    box.setAttribute("aria-valuenow", i);
    box.setAttribute("aria-valuetext", head + ": " + data.names.map((name, k) => name + " " + written(data.curves[k][i])).join(", "));
    box.title = head;
  };
  document.addEventListener("pointermove", (event) => {
    const box = event.target.closest?.(".plot");
    if (!box) return;
    const data = plotOf(box), frame = box.querySelector("svg").getBoundingClientRect();
    const units = (event.clientX - frame.left) / frame.width * box.querySelector("svg").viewBox.baseVal.width;
    const at = (units - data.box[0]) / data.box[2];
    let best = 0;
    data.at.forEach((value, i) => { if (Math.abs(value - at) < Math.abs(data.at[best] - at)) best = i; });
    show(box, best);
  });
  const STEPS = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10, Home: -1e9, End: 1e9 };
  document.addEventListener("keydown", (event) => {
    const box = event.target.closest?.(".plot");
    if (!box || !(event.key in STEPS)) return;
    event.preventDefault();
    show(box, (plotOf(box).index ?? 0) + STEPS[event.key]);
  });
  all(".plot").forEach((box) => {
    box.setAttribute("role", "slider");
    box.setAttribute("aria-valuemin", 0);
    box.setAttribute("aria-valuenow", 0);
    box.setAttribute("aria-valuetext", "arrow keys move along the curves");
    box.tabIndex = 0;
    box.addEventListener("focus", () => {
      const data = plotOf(box);
      box.setAttribute("aria-valuemax", data.x.length - 1);
      show(box, data.index ?? 0);
    });
  });

  // the table of results
  const table = document.querySelector(".results");
  if (table) {
    const body = table.tBodies[0], rows = [...body.rows], count = document.getElementById("shown");
    const inputs = ["filter", "status", "family"].map((id) => document.getElementById(id));
    const filter = () => {
      const [text, status, family] = inputs.map((input) => input.value);
      const words = text.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      rows.forEach((row) => {
        row.hidden = !(words.every((word) => row.dataset.text.includes(word))
          && (!status || row.dataset.status === status) && (!family || row.dataset.family === family));
        shown += !row.hidden;
      });
      count.textContent = shown === rows.length ? `${rows.length} results` : `${shown} of ${rows.length} results`;
    };
    inputs.forEach((input) => input.addEventListener("input", filter));
    inputs[0].form.addEventListener("submit", (event) => event.preventDefault());
    filter();
    const key = (row, column, numeric) => {
      const cell = row.cells[column];
      return numeric ? (cell.dataset.value === "" ? null : Number(cell.dataset.value)) : cell.textContent.trim().toLowerCase();
    };
    table.tHead.addEventListener("click", (event) => {
      const button = event.target.closest("button.sort");
      if (!button) return;
      const header = button.closest("th"), numeric = button.dataset.numeric === "1";
      const down = header.getAttribute("aria-sort") === "ascending";
      all("th", table.tHead).forEach((other) => other.setAttribute("aria-sort", "none"));
      header.setAttribute("aria-sort", down ? "descending" : "ascending");
      const keyed = rows.map((row, i) => [key(row, Number(button.dataset.column), numeric), i, row]);
      keyed.sort(([a, i], [b, j]) => {
        if (a === null || b === null || a === "" || b === "") return (a === null || a === "") - (b === null || b === "") || i - j;
        const order = numeric ? a - b : a.localeCompare(b);
        return (down ? -order : order) || i - j;
      });
      body.append(...keyed.map(([, , row]) => row));
      said.textContent = `sorted by ${button.textContent}, ${down ? "descending" : "ascending"}`;
    });
  }

  // one report at a time
  const title = document.title;
  const entered = () => {
    const target = location.hash && document.getElementById(location.hash.slice(1));
    const sheet = target?.closest?.(".sheet");
    document.title = sheet && !sheet.classList.contains("only") ? `${sheet.querySelector("h1").textContent} – ${title}` : title;
    if (target && (target === sheet || target.id === "index")) { target.focus({ preventScroll: true }); scrollTo(0, 0); }
  };
  addEventListener("hashchange", entered);
  entered();
})();
