// The duty: a strip of steps that are added, moved and drawn longer by hand, their trace below, a table of them.
import { DutyPlot, LEFT, RIGHT, headings } from "./duty_plot.js";
import { button, element, fixed, put, significant } from "./numbers.js";

const NARROWEST = 53; // px of a step, where there is room
const SHORTEST = 5; // px of a step whose edge is drawn
const FAR = 5; // px, from which on a press is a drag
const STEP = 1.1; // factor of a time, by key
const KEYS = "arrow keys select, Alt and arrow keys move a step, Shift and arrow keys change its time, Delete removes it, Enter shows it alone";

// heading, what it is, text of a cell
const COLUMNS = [
  ["how", "How the step was carried out", (s) => s.how ?? "", "words"],
  ["K", "Largest shaft torque of the step over the mean torque of a start under full torque", (s) => fixed(s.k_dyn, 3)],
  ["largest\nN m", "Largest shaft torque", (s) => significant(s.largest, 4)],
  ["smallest\nN m", "Smallest shaft torque; negative: the load drives", (s) => significant(s.smallest, 4)],
  ["damage\n%", "Share of the step in the damage of a cycle, from the second cycle on", (s) => fixed(s.damage, 1)],
  ["contacts", "How often gaps between motor and load closed", (s) => String(s.contacts ?? "\u2013")],
  ["impacts\nJ", "Kinetic energy of all impacts", (s) => significant(s.impact_energy, 3), "number spare"],
  ["time\ns", "Time of the step; of a stop until all masses stand", (s) => significant(s.time, 4)],
  ["limits", "Limit that is exceeded or nearest, and the margin", () => "", "words"],
];
const FACTS = [
  ["worst step", "", (v) => (v.worst === undefined ? "\u2013" : `${v.worst + 1}, ${v.steps[v.worst].do}`)],
  ["peak torque", "N m", (v) => significant(v.peak_torque, 5)],
  ["mean torque", "N m", (v) => significant(v.base, 5)],
  ["cycle", "s", (v) => significant(v.cycle_time, 4)],
];

export class Duty {
  constructor(place, figure, files, theme, say) {
    Object.assign(this, { say, theme, asked: -1, blocks: [], widths: [] });
    const kinds = element("span", { class: "duty-add", role: "group", "aria-label": "Add a step behind the selected one" });
    const act = (sign, title, what) => button(sign, title, what);
    this.tools = {
      earlier: act("\u25c2", "Move the step earlier (Alt+Left)", () => this.move(-1)),
      later: act("\u25b8", "Move the step later (Alt+Right)", () => this.move(1)),
      remove: act("\u00d7", "Remove the step (Delete)", () => this.remove()),
      alone: act("step alone", "Show the selected step alone (Enter)", () => this.toggle()),
    };
    this.kinds = kinds;
    this.bar = element("div", { class: "duty-bar" }, kinds, element("span", { role: "group", "aria-label": "The selected step" }, ...Object.values(this.tools)));
    this.strip = element("div", { class: "duty-strip", role: "listbox", "aria-orientation": "horizontal", "aria-label": `Steps of the duty: ${KEYS}`, onkeydown: (event) => this.key(event) });
    this.marker = element("div", { class: "duty-marker", hidden: true });
    this.canvas = element("canvas", { role: "img", "aria-label": "Torques and speeds of all steps; the table below has their figures" });
    this.status = element("p", { class: "duty-status", role: "status" });
    this.note = element("p", { class: "duty-note" });
    this.refused = element("p", { class: "duty-note wrong", role: "alert", hidden: true });
    this.body = element("tbody");
    const heads = this.heads = COLUMNS.map(([text, meaning, , kind]) => element("th", { scope: "col", class: kind ?? "number", title: meaning }, text === "K" ? "K" : text, ...(text === "K" ? [element("sub", {}, "dyn")] : [])));
    const table = element("table", { "aria-label": "Steps" }, element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "step"), ...heads)), this.body);
    this.trace = element("div", { class: "duty-trace" }, this.canvas, this.status);
    place.append(this.bar, this.strip, this.trace, this.refused, element("div", { class: "duty-table" }, table));
    this.plot = new DutyPlot(this.canvas, theme, (index) => this.select(index));
    this.name = element("div", { class: "name" });
    this.value = element("output", { class: "k-dyn duty-k", "aria-live": "off" });
    this.facts = FACTS.map(([label, unit]) => element("div", {}, element("dt", {}, label), element("dd"), element("dd", { class: "unit" }, unit)));
    const head = element("div", { class: "head" }, element("div", { class: "caption" }, "K", element("sub", {}, "dyn")), this.value);
    figure.append(element("div", { class: "of" }, this.name), head, element("dl", {}, ...this.facts));
    const save = (name, text, kind) => () => this.save(name, text(), kind);
    const own = { "aria-label": null }; // its text
    this.files = [
      button("Duty TOML", "The duty as a file, which Load a file reads again", save("duty.toml", () => this.view.toml, "application/toml"), own),
      button("Steps CSV", "The table of steps as CSV", save("steps.csv", () => this.csv(), "text/csv"), own),
      button("Trace CSV", "The points that are drawn as CSV", save("duty-trace.csv", () => this.plot.csv(this.view), "text/csv"), own),
      button("PNG", "The trace as it is seen, as PNG", () => this.canvas.toBlob((blob) => this.save("duty.png", blob, "image/png")), own)];
    files.append(...this.files);
    files.after(this.note);
  }

  // ---- what the server says

  show(view) {
    this.view = view;
    if (!this.kinds.childElementCount) {
      this.kinds.append("add", ...Object.entries(view.kinds).map(([kind, meaning]) => button(kind, `Add behind the selected step: ${meaning}`, () => this.add(kind), { "aria-label": `add ${kind}` })));
    }
    // a step that was added a moment ago may not be among those of this view
    if (!(this.asked > this.stamp)) this.selected = view.selected;
    if (!view.trace) this.alone = false;
    put(this.status, view.trouble || (view.waits ? "Computing ..." : ""));
    this.status.classList.toggle("wrong", Boolean(view.trouble));
    this.status.hidden = Boolean(view.trace);
    put(this.name, `Duty, ${view.strategy}`);
    put(this.value, view.trace ? fixed(view.k_dyn, 3) : "\u2013");
    this.value.dataset.value = view.k_dyn ?? "";
    this.value.classList.toggle("none", !view.trace);
    FACTS.forEach(([, unit, text], index) => {
      put(this.facts[index].children[1], text(view));
      put(this.facts[index].children[2], unit.replace("N m", view.units.torque));
    });
    this.heads.forEach((head, index) => COLUMNS[index][0].endsWith("N m") && put(head, COLUMNS[index][0].replace("N m", view.units.torque)));
    this.files.forEach((file, index) => (file.disabled = index ? !view.trace : !view.toml));
    put(this.note, [...(view.notes ?? []), "Each step as it was carried out with the largest torque of all cycles and repetitions; short ones are drawn wider."].join(" "));
    this.note.hidden = !view.trace;
    this.body.parentNode.classList.toggle("unlimited", view.steps.every(({ limits }) => !limits));
    this.build();
    this.rows();
    this.lay();
  }

  // the server knows what was pressed before this stamp; `mistake` belongs to no field, `step` is selected
  answered(stamp, mistake, step) {
    this.stamp = stamp;
    if (this.view && !(this.asked > stamp) && step !== this.selected) {
      this.selected = step;
      this.mark();
      this.draw();
    }
    put(this.refused, mistake);
    this.refused.hidden = !mistake;
  }

  build() {
    const { steps } = this.view;
    const focused = this.strip.contains(document.activeElement);
    while (this.blocks.length > steps.length) this.blocks.pop().block.remove();
    while (this.blocks.length < steps.length) {
      const index = this.blocks.length;
      const [title, figure, length] = [element("b"), element("span", { class: "figure-of" }), element("span", { class: "length" })];
      const edge = element("i", { class: "duty-edge", "aria-hidden": "true", title: "Drag: another time", onpointerdown: (event) => this.stretch(event, index) });
      const worst = element("span", { class: "unseen" }); // for those who hear the page
      const block = element("div", { class: "duty-step", role: "option", onpointerdown: (event) => this.press(event, index), ondblclick: () => this.toggle() }, title, figure, length, worst, edge);
      this.blocks.push({ block, title, figure, length, worst });
      this.strip.append(block);
    }
    this.strip.append(this.marker);
    steps.forEach((step, index) => {
      const { block, title, figure, length, worst } = this.blocks[index];
      const times = step.repeat > 1 ? ` \u00d7${step.repeat}` : "";
      put(title, `${step.do}${times}`);
      put(figure, step.k_dyn === undefined ? "" : `K ${fixed(step.k_dyn, 2)}`);
      put(length, step.time === undefined ? "" : `${significant(step.time, 3)} s`);
      block.dataset.do = step.do;
      block.classList.toggle("worst", index === this.view.worst);
      block.classList.toggle("wrong", index === this.view.wrong || step.kept === false);
      put(worst, index === this.view.worst ? "worst step" : "");
      block.title = `${index + 1} ${this.view.kinds[step.do]}`;
    });
    this.mark();
    if (focused) this.blocks[this.place].block.focus();
  }

  // the selected step among those that are shown
  get place() {
    return Math.min(this.selected, this.view.steps.length - 1);
  }

  mark() {
    this.blocks.forEach(({ block }, index) => {
      block.setAttribute("aria-selected", String(index === this.place));
      block.tabIndex = index === this.place ? 0 : -1;
    });
    [...this.body.children].forEach((row, index) => {
      const chosen = index === this.place;
      if (chosen && !row.classList.contains("selected")) row.scrollIntoView({ block: "nearest" });
      row.classList.toggle("selected", chosen);
    });
    const last = this.view.steps.length - 1;
    this.tools.earlier.disabled = this.selected === 0;
    this.tools.later.disabled = this.selected === last;
    this.tools.remove.disabled = last === 0;
    this.tools.alone.disabled = !this.view.trace;
    this.tools.alone.setAttribute("aria-pressed", String(Boolean(this.alone)));
  }

  rows() {
    const { steps, worst } = this.view;
    while (this.body.childElementCount > steps.length) this.body.lastElementChild.remove();
    while (this.body.childElementCount < steps.length) {
      const index = this.body.childElementCount;
      const name = element("th", { scope: "row" }, element("button", { type: "button", onclick: () => this.select(index) }));
      this.body.append(element("tr", { onclick: () => this.select(index) }, name, ...COLUMNS.map(([, , , kind]) => element("td", { class: kind ?? "number" }))));
    }
    steps.forEach((step, index) => {
      const row = this.body.children[index];
      put(row.firstElementChild.firstElementChild, `${index + 1} ${step.do}${step.repeat > 1 ? ` \u00d7${step.repeat}` : ""}${index === worst ? ", worst" : ""}`);
      COLUMNS.forEach(([, , text], column) => put(row.children[column + 1], text(step)));
      const [margin, limit] = (step.limits ?? "").split(/(?=,)/); // which limit it is, where there is room
      row.lastElementChild.replaceChildren(margin, element("span", { class: "spare" }, limit ?? ""));
      row.lastElementChild.title = step.limits ?? "";
      row.classList.toggle("worst", index === worst);
      row.classList.toggle("wrong", step.kept === false);
    });
    this.mark();
  }

  // widths by time, none too narrow to be pressed; an edge that is held keeps the others where they are
  lay() {
    const width = this.strip.clientWidth - LEFT - RIGHT;
    if (!this.view || width <= 0) return;
    const lengths = this.view.steps.map(({ length }) => Math.max(length, 1e-9));
    if (this.held) this.widths = this.held.widths;
    else {
      const least = Math.min(NARROWEST, width / lengths.length);
      const narrow = new Set();
      for (let before = -1; before !== narrow.size; ) {
        before = narrow.size;
        const free = width - least * narrow.size;
        const sum = lengths.reduce((found, length, index) => found + (narrow.has(index) ? 0 : length), 0);
        lengths.forEach((length, index) => (!narrow.has(index) && (length / sum) * free < least ? narrow.add(index) : 0));
        this.widths = lengths.map((length, index) => (narrow.has(index) ? least : (length / sum) * free));
      }
    }
    let x = LEFT;
    this.blocks.forEach(({ block }, index) => {
      Object.assign(block.style, { left: `${x}px`, width: `${this.widths[index]}px` });
      x += this.widths[index];
    });
    this.draw();
  }

  draw() {
    if (this.view) this.plot.draw(this.view, this.widths, this.place, Boolean(this.alone));
  }

  // ---- what a hand does

  select(index) {
    if (!this.view.steps[index]) return;
    if (index !== this.selected) {
      this.selected = index;
      this.asked = this.say({ what: "duty_step", index });
      this.mark();
      this.draw();
    }
  }

  add(kind) {
    const index = this.selected + 1;
    this.selected = index;
    this.asked = this.say({ what: "duty_add", index, do: kind });
  }

  move(by) {
    const to = this.selected + by;
    if (to < 0 || to >= this.view.steps.length) return;
    this.drop(this.selected, to);
  }

  drop(index, to) {
    this.selected = to;
    this.asked = this.say({ what: "duty_move", index, to });
  }

  remove() {
    if (this.view.steps.length < 2) return;
    const index = this.selected;
    this.selected = Math.min(index, this.view.steps.length - 2);
    this.asked = this.say({ what: "duty_remove", index });
  }

  toggle() {
    this.alone = !this.alone && Boolean(this.view.trace);
    this.mark();
    this.draw();
  }

  key(event) {
    const last = this.view.steps.length - 1;
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const acts = {
      Home: () => this.go(0),
      End: () => this.go(last),
      Delete: () => this.remove(),
      Backspace: () => this.remove(),
      Enter: () => this.toggle(),
      Escape: () => (this.alone = true, this.toggle()),
    };
    if (event.ctrlKey || event.metaKey || !(by || acts[event.key])) return;
    event.preventDefault();
    if (!by) acts[event.key]();
    else if (event.altKey) this.move(by);
    else if (event.shiftKey) this.time(this.place, this.view.steps[this.place].length * STEP ** by);
    else this.go(Math.min(Math.max(this.selected + by, 0), last));
  }

  go(index) {
    this.select(index);
    this.blocks[index].block.focus();
  }

  time(index, time) {
    this.asked = this.say({ what: "duty_time", index, time });
  }

  // a press selects, a drag moves the step
  press(event, index) {
    if (event.button !== 0) return;
    this.select(index);
    const { block } = this.blocks[index];
    const begin = event.clientX;
    let to = null;
    this.follow(block, event, (moved) => {
      const by = moved.clientX - begin;
      if (to === null && Math.abs(by) < FAR) return;
      block.classList.add("dragged");
      block.style.transform = `translateX(${by}px)`;
      const at = moved.clientX - this.strip.getBoundingClientRect().left;
      let [x, place] = [LEFT, 0];
      const others = this.widths.map((width, other) => [width, other]).filter(([, other]) => other !== index);
      let mark = LEFT;
      this.widths.forEach((width, other) => {
        if (other !== index && at > x + width / 2) [place, mark] = [place + 1, x + width];
        x += width;
      });
      to = Math.min(place, others.length);
      this.marker.hidden = false;
      this.marker.style.left = `${mark - 1}px`;
    }, (dropped) => {
      this.marker.hidden = true;
      block.classList.remove("dragged");
      block.style.transform = "";
      if (dropped && to !== null && to !== index) this.drop(index, to);
    });
  }

  // the edge of a step is drawn: its time follows
  stretch(event, index) {
    if (event.button !== 0) return;
    event.stopPropagation();
    this.select(index);
    const [begin, width, length] = [event.clientX, this.widths[index], this.view.steps[index].length];
    this.held = { widths: [...this.widths] };
    this.follow(event.target, event, (moved) => {
      const now = Math.max(width + moved.clientX - begin, SHORTEST);
      this.held.widths[index] = now;
      this.lay();
      this.time(index, (length * now) / width);
    }, () => {
      this.held = null;
      this.lay();
    });
  }

  follow(part, event, move, end) {
    part.setPointerCapture(event.pointerId);
    const stop = ({ type }) => {
      for (const [kind, act] of Object.entries(acts)) part.removeEventListener(kind, act);
      end(type === "pointerup");
    };
    const acts = { pointermove: move, pointerup: stop, pointercancel: stop };
    for (const [kind, act] of Object.entries(acts)) part.addEventListener(kind, act);
  }

  // ---- files

  csv() {
    const quoted = (text) => `"${String(text ?? "").replaceAll('"', '""')}"`;
    const [angle, torque] = headings(this.view);
    const columns = [["step", (s, i) => i + 1], ["do", (s) => quoted(s.do)], ["repeat", (s) => s.repeat], ["how", (s) => quoted(s.how)], ["k_dyn", (s) => s.k_dyn], [`largest_torque_${torque}`, (s) => s.largest], [`smallest_torque_${torque}`, (s) => s.smallest], ["contacts", (s) => s.contacts], ["impact_energy_J", (s) => s.impact_energy], ["damage_percent", (s) => s.damage], ["time_s", (s) => s.time], ["start_time_s", (s) => s.start_time], [`angle_${angle}`, (s) => s.angle], ["limits", (s) => quoted(s.limits)]];
    const lines = this.view.steps.map((step, index) => columns.map(([, value]) => value(step, index) ?? "").join(","));
    return `${[columns.map(([head]) => head).join(","), ...lines].join("\n")}\n`;
  }

  save(name, content, type) {
    const stem = document.title.replace(/^softstart: /, "").replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || "machine";
    const link = element("a", { href: URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type })), download: `${stem}-${name}` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
}
