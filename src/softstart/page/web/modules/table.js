// Strategies side by side: one is selected, any may be drawn. They are in the order of a column, by K at first,
// whenever the drive has come to rest: no row moves under a hand.
import { button, element, fixed, put, significant } from "./numbers.js";

// key, heading, its index, the text of a cell, what it is
const COLUMNS = [
  ["name", "strategy", "", null, "Names in their alphabetical order"],
  ["k_dyn", "K", "dyn", (row) => fixed(row.k_dyn, 3), "Peak of the shaft torque over its mean while the drive accelerates"],
  ["duty", "K duty", "", (row) => fixed(row.duty, 3), "K of the worst step of the duty; a dash where the strategy cannot carry it out, or it takes too long here"],
  ["worn", "K worn", "", (row) => fixed(row.worn, 3), "K when wear has made the gap four times as wide, and the controller is as it was"],
  ["light", "K light", "", (row) => fixed(row.light, 3), "K with 0.4 times the load inertia, and the controller as it was"],
  ["soft", "K soft", "", (row) => fixed(row.soft, 3), "K at the soft end of a stiffness that is not known; the controller is set up for the stiff end"],
  ["peak_torque", "peak, N m", "", (row) => significant(row.peak_torque, 4), "Largest shaft torque"],
  ["start_time", "start, s", "", (row) => fixed(row.start_time, 4), "Time until the load has its target speed"],
  ["settled", "settled, s", "", (row) => fixed(row.settled, 4), "From when on the load keeps its target speed: within 2 % (strategies that hold the speed), not below 99.9 % (torque strategies)"],
  ["settled_lost", "later, s", "", (row) => fixed(row.settled_lost, 4), "How much later than with direct the load has settled"],
  ["overshoot", "overshoot, %", "", (row) => fixed(row.overshoot, 1), "By how much the load exceeds its target speed at most, under a strategy that holds the speed"],
  ["set_to", "set to", "", (row) => row.set_to ?? "", "Value of the time parameter with the lowest K of those that settle within the equal time; figure and plots are of the strategy as it is set by its fields"],
];
const FIGURES = COLUMNS.slice(1);
const PEAK = COLUMNS.findIndex(([key]) => key === "peak_torque");
const cells = () => FIGURES.map(([key]) => element("td", { class: "number", "data-key": key }));

export class Table {
  constructor(place, theme, say) {
    // `by`: key of the column that sorts; `asked`: stamp of what was selected last
    Object.assign(this, { theme, say, lines: new Map(), by: "k_dyn", asked: -1, body: element("tbody") });
    this.heads = COLUMNS.map(([key, text, sub, , meaning]) => element("th", { scope: "col", "data-key": key },
      element("button", { type: "button", title: `${meaning}; press to sort`, onclick: () => this.sort(key) }, text, ...(sub ? [element("sub", {}, sub)] : []))));
    const first = element("th", { scope: "col", class: "eye", "aria-label": "drawn" });
    const last = element("th", { scope: "col", class: "bar-head" }, "K (line: 1)");
    place.append(element("table", {}, this.equal(), element("thead", {}, element("tr", {}, first, ...this.heads, last)), this.body, this.foot()));
  }

  sort(key) {
    this.by = this.by === key ? "" : key;
    this.sorted = undefined;
    if (this.state) this.show(this.state);
  }

  // each strategy as it is set by its fields, or by its time parameter for the same time
  equal() {
    const ask = (on) => (this.equalAsked = this.say({ what: "at_time", text: on ? this.time.value.trim() || (this.time.value = "1.3x") : "" }));
    this.equalAsked = -1;
    this.on = element("input", { type: "checkbox", onchange: () => ask(this.on.checked) });
    this.time = element("input", {
      type: "text", value: "1.3x", spellcheck: "false", autocomplete: "off", "aria-label": "equal time",
      title: "A multiple of the settled time of direct, as 1.3x, or a time, as 300 ms", onchange: () => this.on.checked && ask(true),
    });
    const meaning = "Set each strategy by its time parameter for the lowest K of those that settle within this time";
    return element("caption", {}, element("label", { title: meaning }, this.on, " equal time"), " ", this.time);
  }

  // the switch as the server knows it, once it knows of what was pressed last
  switched({ at_time: time, stamp }) {
    this.body.parentNode.classList.toggle("equal", Boolean(time));
    if (this.equalAsked > stamp) return;
    this.equalAsked = -1;
    this.on.checked = Boolean(time);
    if (time && document.activeElement !== this.time) this.time.value = time;
  }

  // all values are those of the drive at rest
  rest() {
    this.sorted = undefined;
  }

  show(state) {
    this.state = state;
    this.arrange(state);
    this.switched(state);
    this.compare(state.reference);
    put(this.heads[PEAK].firstChild, `peak, ${state.torque}`);
    this.body.parentNode.classList.toggle("ends", Boolean(state.soft));
    this.body.parentNode.classList.toggle("held", [...state.rows.values()].some((row) => row.overshoot != null));
    const largest = Math.max(2, ...[...state.rows.values()].map((row) => row.k_dyn ?? 0));
    for (const name of state.order) {
      const line = this.lines.get(name);
      const row = state.rows.get(name);
      const selected = name === state.selected;
      if (this.asked <= state.stamp) { // as below: an older frame does not know what was pressed last
        line.tr.classList.toggle("selected", selected);
        if (line.radio.checked !== selected) line.radio.checked = selected;
      }
      line.mark.hidden = name !== state.recommended;
      line.tr.classList.toggle("recommended", name === state.recommended);
      line.out.hidden = !state.added.includes(name);
      line.changed.hidden = !state.changed.includes(name);
      if (line.asked <= state.stamp) line.asked = -1; // the server knows what was pressed last
      if (line.asked < 0) line.eye.checked = state.shown.includes(name);
      line.tr.style.setProperty("--colour", this.theme.strategy(state.colours[name]));
      if (!row || line.row === row) continue;
      line.row = row;
      line.cells.forEach((cell, index) => put(cell, FIGURES[index][3](row)));
      const words = [row.limits, row.flag].filter(Boolean); // a narrow column
      put(line.flag, words.join("\n"));
      line.flag.classList.toggle("two", words.length > 1);
      line.flag.classList.toggle("kept", !row.flag && row.limits.startsWith("kept"));
      line.tr.title = row.trouble;
      line.tr.classList.toggle("trouble", Boolean(row.trouble));
      line.bar.style.setProperty("--share", `${(100 * (row.k_dyn ?? 0)) / largest}%`);
      line.bar.style.setProperty("--one", `${100 / largest}%`);
    }
  }

  // the start that all are compared with
  foot() {
    this.name = element("span");
    this.compared = cells();
    const out = button("\u00d7", "Clear the reference", () => this.say({ what: "reference", on: false }), { class: "out", "aria-label": "clear the reference" });
    const title = element("td", { class: "title" }, element("div", {}, this.name, out));
    return (this.reference = element("tfoot", { hidden: true }, element("tr", {}, element("td"), title, ...this.compared, element("td"))));
  }

  compare(reference) {
    this.reference.hidden = !reference;
    if (!reference) return;
    this.name.textContent = this.name.title = `reference: ${reference.name}`;
    this.compared.forEach((cell, index) => (cell.textContent = FIGURES[index][3](reference)));
  }

  arrange(state) {
    const known = state.order.every((name) => state.rows.has(name));
    const wanted = `${known && this.by}|${state.order.join("|")}`;
    if (this.sorted === wanted) return;
    this.sorted = wanted;
    for (const [name, line] of this.lines) {
      if (state.order.includes(name)) continue;
      line.tr.remove();
      this.lines.delete(name);
    }
    const value = (name) => state.rows.get(name)?.[this.by] ?? Infinity;
    const focused = document.activeElement; // a row that is moved loses it
    const names = [...state.order];
    if (this.by === "name") names.sort();
    else if (this.by) names.sort((a, b) => value(a) - value(b) || 0);
    names.forEach((name, index) => {
      if (!this.lines.has(name)) this.lines.set(name, this.line(name));
      const { tr } = this.lines.get(name);
      if (this.body.children[index] !== tr) this.body.insertBefore(tr, this.body.children[index] ?? null);
    });
    if (this.body.contains(focused)) focused.focus();
    for (const head of this.heads) head.setAttribute("aria-sort", head.dataset.key === this.by ? "ascending" : "none");
  }

  line(name) {
    const select = () => {
      radio.checked = true;
      this.asked = this.say({ what: "select", name });
    };
    const eye = element("input", { type: "checkbox", "aria-label": `draw ${name}`, onchange: () => (line.asked = this.say({ what: "show", name, visible: eye.checked })) });
    const radio = element("input", { type: "radio", name: "strategy", value: name, id: `strategy-${this.lines.size}-${name}`, onchange: select });
    const flag = element("span", { class: "flag", title: "Whether the limits are kept, with the smallest margin; why it is never recommended: slow, not settled, K_dyn above that of direct start" });
    const bar = element("td", { class: "bar", "data-key": "flag" }, flag);
    const out = button("\u00d7", `Take ${name} out`, () => this.say({ what: "remove", name }), { class: "out", "aria-label": `take ${name} out`, hidden: true });
    const changed = element("span", { class: "changed", title: "with parameters of your own", hidden: true }, "\u2009*");
    const mark = element("span", { class: "mark", role: "img", title: "recommended", "aria-label": "recommended", hidden: true }, "\u2605");
    const line = { eye, radio, cells: cells(), bar, flag, mark, out, changed, asked: -1 };
    const title = element("td", { class: "title" }, element("label", {}, radio, element("span", { title: name }, name), mark, changed, out));
    const onclick = (event) => event.target.closest("input, label, button") || select();
    line.tr = element("tr", { "data-name": name, onclick }, element("td", { class: "eye" }, eye), title, ...line.cells, bar);
    return line;
  }
}
