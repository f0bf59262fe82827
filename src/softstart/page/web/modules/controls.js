// Sliders and fields of the drive: what is typed or slid is sent at once, what the server says is shown.
import { element } from "./numbers.js";

const STEPS = 600;

export class Controls {
  constructor(place, own, head, say) {
    this.say = say;
    this.head = head;
    this.rows = new Map();
    this.own = own;
    this.groups = place.appendChild(element("div"));
  }

  box(title, rows) {
    const box = element("fieldset", {}, element("legend", {}, title));
    for (const row of rows) box.append(...this.row(row));
    return box;
  }

  // the parameters of the drive or chain, in place of those of the one before
  machine(groups) {
    for (const path of this.rows.keys()) if (!path.startsWith("strategy.")) this.rows.delete(path);
    this.head.replaceChildren(...groups.filter(({ head }) => head).flatMap(({ rows }) => rows.flatMap((row) => this.row(row))));
    this.groups.replaceChildren(...groups.filter(({ head }) => !head).map(({ title, rows, folded }) => {
      const box = this.box(title, rows);
      if (!folded) return box;
      box.firstChild.remove();
      return element("details", {}, element("summary", {}, title), box);
    }));
  }

  // the parameters of the selected strategy, in place of those of the one before
  strategy({ name, rows }) {
    for (const path of this.rows.keys()) if (path.startsWith("strategy.")) this.rows.delete(path);
    const main = rows.filter((row) => row.slider || row.choices.length);
    const more = rows.filter((row) => !main.includes(row));
    const parts = main.length ? [this.box(`parameters of ${name}`, main)] : [];
    if (more.length) {
      const box = this.box("", more);
      box.firstChild.remove();
      parts.push(main.length ? element("details", {}, element("summary", {}, "more parameters"), box) : this.box(`parameters of ${name}`, more));
    }
    this.own.replaceChildren(...parts);
    this.own.hidden = !parts.length;
  }

  row({ path, symbol, label, meaning, unit, slider, choices, words, suggestions }) {
    const id = `field-${path.replaceAll(/[.[]/g, "-").replaceAll("]", "")}`;
    const name = element("label", { for: id, title: meaning }, ...(symbol || !path.startsWith("strategy.") ? [element("i", {}, symbol)] : []), label);
    const mistake = element("p", { class: "mistake", role: "alert", id: `${id}-mistake`, hidden: true });
    const line = element("div", { class: `row${slider ? "" : " plain"}${words ? " words" : ""}${suggestions.length ? " wide" : ""}`, "data-path": path }, name);
    // stamps of what was asked last: by the field until that is answered, by the slider
    const parts = { line, mistake, other: element("span", { class: "other" }), asked: -1, slid: -1 };
    if (slider) {
      parts.slider = element("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${label}, slider` });
      parts.slider.addEventListener("input", () => {
        parts.slid = this.say({ what: "slide", path, position: Number(parts.slider.value) });
      });
      parts.slider.addEventListener("pointerdown", () => this.hold(parts));
      parts.slider.addEventListener("dblclick", () => this.say({ what: "reset", path }));
      parts.slider.addEventListener("keydown", (event) => {
        if (event.key === "Delete" || event.key === "Backspace") this.say({ what: "reset", path });
      });
      parts.marks = element("span", { class: "marks", "aria-hidden": "true" });
      line.append(element("span", { class: "track" }, parts.marks, parts.slider));
    }
    if (!words && !suggestions.length) line.append(parts.other);
    if (choices.length) {
      parts.field = element("select", { id, "aria-describedby": mistake.id }, ...choices.map((choice) => element("option", {}, choice)));
      parts.field.addEventListener("change", () => this.edit(path, parts));
      line.append(parts.field, element("span", { class: "unit" }));
    } else {
      const list = suggestions.length ? `${id}-words` : null;
      parts.field = element("input", { id, type: "text", spellcheck: "false", autocomplete: "off", list, "aria-describedby": mistake.id });
      this.listen(path, parts);
      line.append(parts.field);
      if (list) line.append(element("datalist", { id: list }, ...suggestions.map((value) => element("option", { value }))));
      if (!words) line.append(element("span", { class: "unit" }, unit));
    }
    this.rows.set(path, parts);
    return [line, mistake];
  }

  listen(path, parts) {
    const { field } = parts;
    field.addEventListener("focus", () => field.select());
    field.addEventListener("input", () => {
      parts.typing = true;
      field.dataset.writing = "";
    });
    field.addEventListener("change", () => this.edit(path, parts));
    // what was typed and taken back by hand is no change to the browser: the field follows the drive again
    field.addEventListener("blur", () => this.leave(parts));
    field.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      parts.refused = false;
      parts.typing = true;
      this.leave(parts);
      // not sent as a text: the field shows six digits, and the drive may have more
      if (parts.sentence || parts.asked >= 0) this.say({ what: "leave", path });
    });
  }

  leave(parts) {
    delete parts.field.dataset.writing;
    if (parts.typing && !parts.refused) parts.field.value = parts.text ?? "";
    parts.typing = false;
  }

  edit(path, parts) {
    delete parts.field.dataset.writing;
    parts.typing = false;
    parts.asked = this.say({ what: "edit", path, text: parts.field.value });
  }

  // the thumb belongs to the hand until it lets go
  hold(parts) {
    parts.held = true;
    const free = () => {
      parts.held = false;
      this.put(parts);
      for (const way of ["pointerup", "pointercancel"]) window.removeEventListener(way, free, true);
    };
    for (const way of ["pointerup", "pointercancel"]) window.addEventListener(way, free, true);
  }

  // the thumb where the drive is, once the server has answered; a step beside it is the rounding of the value
  put(parts) {
    if (!parts.slider || parts.held || parts.slid > this.stamp) return;
    const near = document.activeElement === parts.slider ? 1 : 0;
    if (Math.abs(Number(parts.slider.value) - parts.position) > near) parts.slider.value = parts.position;
    this.fill(parts);
  }

  fill(parts) {
    const share = `${(100 * parts.slider.value) / STEPS}%`;
    if (parts.share !== share) parts.slider.style.setProperty("--share", share);
    parts.share = share;
  }

  // where the value was when the drive was loaded, or the default and tuned values of a strategy
  mark(parts, marks) {
    const key = JSON.stringify(marks);
    if (parts.marked === key) return;
    parts.marked = key;
    parts.marks.replaceChildren(...marks.map(([position, meaning], index) => {
      const tick = element("i", { class: index ? "tuned" : "", title: meaning });
      tick.style.setProperty("--share", position / STEPS);
      return tick;
    }));
    parts.slider.title = [...marks.map(([, meaning]) => meaning), "double click or Delete: back to the first of these"].join("; ");
  }

  // `stamp` is that of the last thing the server had taken in when it sent this
  show(fields, mistakes, stamp) {
    this.stamp = stamp;
    for (const [path, parts] of this.rows) {
      if (parts.asked > stamp) continue; // it does not know yet what was written here
      const answered = parts.asked >= 0;
      parts.asked = -1;
      const [text, position, other, marks] = fields[path] ?? ["", null, "", []];
      const sentence = mistakes[path] ?? "";
      const { field, slider } = parts;
      if (parts.sentence !== sentence) {
        parts.sentence = sentence;
        parts.mistake.textContent = sentence;
        parts.mistake.hidden = !sentence;
        parts.line.classList.toggle("wrong", Boolean(sentence));
        field.setAttribute("aria-invalid", String(Boolean(sentence)));
      }
      // a field that is being written or was refused keeps what its writer wrote
      parts.refused = Boolean(sentence) && (answered || Boolean(parts.refused));
      if (!parts.typing && !parts.refused && field.value !== text) {
        field.value = text;
        if (answered && document.activeElement === field) field.select?.();
      }
      if (parts.text !== text || parts.position !== position) {
        parts.text = text;
        parts.position = position;
        parts.line.classList.toggle("typed", text.includes(" ")); // with a unit of its own
        if (slider) {
          this.fill(parts);
          slider.setAttribute("aria-valuetext", other ? `${text}, ${other}` : text);
        }
        parts.other.textContent = other;
        parts.other.title = other;
      }
      parts.line.classList.toggle("changed", other === "changed");
      if (slider) this.mark(parts, marks);
      this.put(parts);
    }
  }
}
