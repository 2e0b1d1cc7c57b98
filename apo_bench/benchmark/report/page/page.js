"use strict";
// The trials of a condition: unpacked when the first one is opened, shown a hundred at a time.
(() => {
  const STEP = 100;
  let kept = null;

  async function unpacked() {
    if (kept === null) {
      const letters = atob(document.getElementById("trials").textContent.trim());
      const bytes = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
      kept = JSON.parse(await new Response(stream).text());
    }
    return kept;
  }

  function made(name, text, more) {
    const element = document.createElement(name);
    if (text !== undefined && text !== null) element.textContent = text;
    return Object.assign(element, more || {});
  }

  // As a person writes it: 0.000 mm, and p < 0.001.
  function written(name, x, digits) {
    if (x === null) return "–";
    return name === "p_value" && x < 0.001 ? "< 0.001" : x.toFixed(digits);
  }

  function trial(found, i) {
    const word = (name) => found.words[name][found.columns[name][i]];
    const seed = found.columns.seed[i];
    const numbers = found.numbers.map(([name, , digits]) => written(name, found.columns[name][i], digits));
    return { seed, numbers, verdict: word("verdict"), why: word("why"), sentence: word("sentence"),
      predicted: word("failure_prediction"), command: `${word("command")} --seed ${seed}` };
  }

  // Tables that go on to the right fade there.
  function fade(box) {
    box.classList.toggle("cut", box.scrollLeft + box.clientWidth < box.scrollWidth - 2);
  }
  const sizes = new ResizeObserver((entries) => { for (const entry of entries) fade(entry.target); });

  function watch(box) {
    sizes.observe(box);
    box.addEventListener("scroll", () => fade(box), { passive: true });
  }

  async function copied(text) {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {
      const area = made("textarea", null, { value: text });
      area.style.position = "fixed";
      area.style.opacity = "0";
      document.body.append(area);
      area.select();
      const done = document.execCommand("copy");
      area.remove();
      return done;
    }
  }

  function copyButton(text) {
    const button = made("button", "copy", { type: "button", className: "copy" });
    button.dataset.command = text;
    button.setAttribute("aria-label", `copy the command: ${text}`);
    return button;
  }

  function line(found, cell, one) {
    const row = made("tr");
    const again = made("td");
    again.append(copyButton(one.command));
    const seed = row.appendChild(made("th", one.seed, { scope: "row", className: "number" }));
    const picture = found.pictures[`${cell}:${one.seed}`];
    if (picture !== undefined) {
      seed.append(" ", made("a", "picture", { href: `#picture-${picture}` }));
    }
    row.append(again, made("td", one.verdict), made("td", one.why || "–"), made("td", one.sentence, { className: "wide" }));
    row.append(made("td", one.predicted || "–"));
    for (const x of one.numbers) row.append(made("td", x, { className: "number" }));
    row.appendChild(made("td")).append(made("code", one.command));
    return row;
  }

  function head(found) {
    const row = made("tr");
    const words = ["seed", "again", "verdict", "stage: code", "in words", "predicted"];
    for (const text of words) row.append(made("th", text, { scope: "col" }));
    for (const [, label] of found.numbers) row.append(made("th", label, { scope: "col", className: "number" }));
    row.append(made("th", "command of the same trial", { scope: "col" }));
    const top = made("thead");
    top.append(row);
    return top;
  }

  function fill(found, cell, panel, button) {
    const first = cell === 0 ? 0 : found.ends[cell - 1];
    const all = [];
    for (let i = first; i < found.ends[cell]; i += 1) all.push(i);
    const failures = all.filter((i) => !["right", "right, not as demonstrated", "excluded"].includes(trial(found, i).verdict));
    panel.replaceChildren(made("h4", button.dataset.title));
    const tools = made("div", null, { className: "tools" });
    const only = made("input", null, { type: "checkbox" });
    const label = made("label");
    label.append(only, ` failures only (${failures.length} of ${all.length})`);
    const count = found.counts[cell];
    if (all.length < count) label.append(`; the first ${all.length} of ${count} trials, trials.jsonl has all`);
    const close = made("button", "close", { type: "button" });
    close.addEventListener("click", () => shut(button, panel));
    tools.append(label, close);
    const body = made("tbody");
    const table = made("table");
    table.append(head(found), body);
    const scroll = made("div", null, { className: "scroll tall", tabIndex: 0 });
    scroll.setAttribute("role", "region");
    scroll.setAttribute("aria-label", "trials of the condition");
    scroll.append(table);
    const more = made("button", null, { type: "button", className: "more" });
    const show = () => {
      const chosen = only.checked ? failures : all;
      const shown = body.childElementCount;
      body.append(...chosen.slice(shown, shown + STEP).map((i) => line(found, cell, trial(found, i))));
      const left = chosen.length - body.childElementCount;
      more.hidden = left <= 0;
      more.textContent = `show ${Math.min(STEP, left)} more of ${left}`;
      fade(scroll);
    };
    only.addEventListener("change", () => { body.replaceChildren(); show(); });
    more.addEventListener("click", show);
    show();
    panel.append(tools, scroll, more);
    watch(scroll);
  }

  function panelOf(button) {
    const box = button.closest(".scroll");
    let panel = box.nextElementSibling;
    if (!panel || !panel.classList.contains("trials")) {
      panel = made("section", null, { className: "trials", hidden: true });
      panel.setAttribute("aria-live", "polite");
      box.after(panel);
    }
    return panel;
  }

  function shut(button, panel) {
    panel.hidden = true;
    button.setAttribute("aria-expanded", "false");
    button.focus();
  }

  async function open(button) {
    const panel = panelOf(button);
    if (button.getAttribute("aria-expanded") === "true") return shut(button, panel);
    for (const other of button.closest("table").querySelectorAll("button.cell[aria-expanded='true']")) {
      other.setAttribute("aria-expanded", "false");
    }
    button.setAttribute("aria-expanded", "true");
    panel.hidden = false;
    try {
      fill(await unpacked(), Number(button.dataset.cell), panel, button);
    } catch (error) {
      panel.replaceChildren(made("p", "This browser cannot unpack the rows; they stand in trials.jsonl beside this page."));
    }
    panel.scrollIntoView({ block: "nearest" });
  }

  document.addEventListener("click", async (event) => {
    const cell = event.target.closest("button.cell");
    if (cell) return open(cell);
    const copy = event.target.closest("button.copy");
    if (!copy) return;
    copy.textContent = (await copied(copy.dataset.command)) ? "copied" : "not copied";
    setTimeout(() => { copy.textContent = "copy"; }, 1500);
  });

  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    const panel = event.target.closest(".trials");
    const box = panel ? panel.previousElementSibling : event.target.closest(".scroll");
    const button = box && box.querySelector("button.cell[aria-expanded='true']");
    if (button) shut(button, panelOf(button));
  });

  function linked() {
    const number = location.hash.match(/^#cell-(\d+)$/);
    const cell = number && document.querySelector(`button.cell[data-cell="${number[1]}"]`);
    if (cell && cell.getAttribute("aria-expanded") !== "true") open(cell);
  }
  window.addEventListener("hashchange", linked);
  window.addEventListener("beforeprint", () => {
    for (const box of document.querySelectorAll("details")) box.open = true;
  });
  for (const box of document.querySelectorAll(".scroll")) watch(box);
  linked();
})();
