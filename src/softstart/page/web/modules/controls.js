// Sliders and fields of the drive: what is typed or slid is sent at once, what the server says is shown.
import { element, put, stored } from "./numbers.js";

const STEPS = 600;
const FOLDS = "softstart-folds"; // in this tab: those that a hand has opened or closed

export class Controls {
  constructor(place, own, head, duty, say) {
    Object.assign(this, { say, own, head, duty, rows: new Map(), open: new Map(JSON.parse(stored("sessionStorage", FOLDS))), groups: place.appendChild(element("div")) });
  }

  // the fields of another machine, the first group in the head of the page; or of another strategy
  build({ groups, strategy, duty_fields: duty, filled = [] }) {
    if (groups) {
      this.head.replaceChildren(...groups[0].rows.flatMap((row) => this.row(row)));
      this.groups.replaceChildren(...groups.slice(1).map((group) => this.box(group, filled)));
    }
    if (strategy) {
      this.own.replaceChildren(...strategy.map((group) => this.box(group, filled)));
      this.own.hidden = !strategy.length;
    }
    if (duty) this.duty.replaceChildren(...duty.map((group) => this.box(group, filled)));
    for (const [path, { line }] of this.rows) if (!line.isConnected) this.rows.delete(path);
  }

  // a fold that has values begins open; later it is as the hand left it
  box({ title, rows, folded }, filled) {
    const lines = rows.flatMap((row) => this.row(row));
    if (filled.includes(title) && !this.open.has(title)) this.open.set(title, true);
    if (folded) return element("details", { open: Boolean(this.open.get(title)), ontoggle: ({ target }) => this.fold(title, target) }, element("summary", {}, title), element("fieldset", {}, ...lines));
    return element("fieldset", {}, element("legend", {}, title), ...lines);
  }

  // what is unfolded comes into sight, and stays unfolded when its fields are built anew
  fold(title, place) {
    if (place.open && !this.open.get(title)) place.scrollIntoView({ block: "nearest" });
    this.open.set(title, place.open);
    stored("sessionStorage", FOLDS, JSON.stringify([...this.open]));
  }

  row({ path, symbol, label, meaning, unit, scale: slider, choices, words, text }) {
    const id = `field-${path.replaceAll(/[.[]/g, "-").replaceAll("]", "")}`;
    const own = /^(strategy|duty)\b/.test(path); // without symbols
    const mistake = element("p", { class: "mistake", role: "alert", id: `${id}-mistake`, hidden: true });
    const line = element("div", { class: `row${slider ? "" : " plain"}${text ? " words" : ""}${words.length ? " wide" : ""}`, "data-path": path },
      element("label", { for: id, title: meaning }, ...(own ? [] : [element("i", {}, symbol)]), label));
    // stamps of what was asked last: by the field until that is answered, by the slider
    const parts = { line, mistake, unit, shown: {}, asked: -1, slid: -1 };
    if (slider) {
      parts.marks = element("span", { class: "marks", "aria-hidden": "true" });
      parts.slider = element("input", {
        type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${label}, slider`,
        oninput: () => (parts.slid = this.say({ what: "slide", path, position: Number(parts.slider.value) })),
        onpointerdown: () => this.hold(parts),
        ondblclick: () => this.say({ what: "reset", path }),
        onkeydown: ({ key }) => (key === "Delete" || key === "Backspace") && this.say({ what: "reset", path }),
      });
      line.append(element("span", { class: "track" }, parts.marks, parts.slider));
    }
    const onchange = () => this.edit(path, parts);
    if (choices.length) {
      parts.field = element("select", { id, onchange, "aria-describedby": mistake.id }, ...choices.map((choice) => element("option", {}, choice)));
    } else {
      const list = words.length ? `${id}-words` : null;
      parts.field = element("input", {
        id, list, type: "text", spellcheck: "false", autocomplete: "off", "aria-describedby": mistake.id, onchange,
        onfocus: () => parts.field.select(),
        oninput: () => {
          parts.typing = true;
          parts.field.dataset.writing = "";
        },
        // what was typed and taken back by hand is no change to the browser: the field follows the drive again
        onblur: () => this.leave(parts),
        onkeydown: ({ key }) => key === "Escape" && this.escape(path, parts),
      });
      if (list) line.append(element("datalist", { id: list }, ...words.map((value) => element("option", { value }))));
    }
    line.append(parts.field);
    if (!text) line.append(element("span", { class: "unit" }, unit));
    this.rows.set(path, parts);
    return [line, mistake];
  }

  // not sent as a text: the field shows six digits, and the drive may have more
  escape(path, parts) {
    Object.assign(parts, { refused: false, typing: true });
    this.leave(parts);
    if (parts.sentence || parts.asked >= 0) this.say({ what: "leave", path });
  }

  leave(parts) {
    delete parts.field.dataset.writing;
    if (parts.typing && !parts.refused) parts.field.value = parts.shown.text ?? "";
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
  put({ slider, held, slid, shown }) {
    if (!slider || held || slid > this.stamp) return;
    const near = document.activeElement === slider ? 1 : 0;
    if (Math.abs(Number(slider.value) - shown.position) > near) slider.value = shown.position;
  }

  // where the value was when the drive was loaded, or the default and tuned values of a strategy
  mark({ marks, slider }, all) {
    marks.replaceChildren(...all.map(([position, title], index) => element("i", { class: index ? "tuned" : "", title, style: `--share: ${position / STEPS}` })));
    slider.title = [...all.map(([, title]) => title), "double click or Delete: back to the first of these"].join("; ");
  }

  // `stamp` is that of the last thing the server had taken in when it sent this
  show(fields, mistakes, stamp) {
    this.stamp = stamp;
    for (const [path, parts] of this.rows) {
      if (parts.asked > stamp) continue; // it does not know yet what was written here
      const answered = parts.asked >= 0;
      parts.asked = -1;
      const { field, slider, line, mistake, shown: before } = parts;
      const shown = (parts.shown = fields[path] ?? { text: "" });
      const sentence = mistakes[path] ?? "";
      if (parts.sentence !== sentence) {
        parts.sentence = sentence;
        put(mistake, sentence);
        mistake.hidden = !sentence;
        line.classList.toggle("wrong", Boolean(sentence));
        field.setAttribute("aria-invalid", String(Boolean(sentence)));
      }
      // a field that is being written or was refused keeps what its writer wrote
      parts.refused = Boolean(sentence) && (answered || Boolean(parts.refused));
      if (!parts.typing && !parts.refused && field.value !== shown.text) {
        field.value = shown.text;
        if (answered && document.activeElement === field) field.select?.();
      }
      if (before.text !== shown.text) {
        line.classList.toggle("typed", shown.text.includes(" ")); // with a unit of its own
        slider?.setAttribute("aria-valuetext", `${shown.text} ${parts.unit}`);
      }
      line.classList.toggle("changed", Boolean(shown.changed));
      if (slider && String(before.marks) !== String(shown.marks)) this.mark(parts, shown.marks ?? []);
      this.put(parts);
    }
  }
}
