// Sliders and fields of the drive: what is typed or slid is sent at once, what the server says is shown.
import { element } from "./numbers.js";
import { scheme } from "./scheme.js";

const STEPS = 600;

export class Controls {
  constructor(place, groups, say) {
    this.say = say;
    this.rows = new Map();
    place.append(scheme());
    for (const group of groups) {
      const box = element("fieldset", {}, element("legend", {}, group.title));
      for (const row of group.rows) box.append(...this.row(row));
      place.append(box);
    }
  }

  row({ path, symbol, label, meaning, unit, slider, choices }) {
    const id = `field-${path.replace(".", "-")}`;
    const name = element("label", { for: id, title: meaning }, element("i", {}, symbol), label);
    const mistake = element("p", { class: "mistake", role: "alert", id: `${id}-mistake`, hidden: true });
    const line = element("div", { class: `row${slider ? "" : " plain"}`, "data-path": path }, name);
    const parts = { line, mistake, other: element("span", { class: "other" }) };
    if (slider) {
      parts.slider = element("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${label}, slider` });
      parts.slider.addEventListener("input", () => {
        this.say({ what: "slide", path, position: Number(parts.slider.value) });
      });
      line.append(parts.slider);
    }
    line.append(parts.other);
    if (choices.length) {
      parts.field = element("select", { id }, ...choices.map((choice) => element("option", {}, choice)));
      parts.field.addEventListener("change", () => this.edit(path, parts));
      line.append(parts.field, element("span", { class: "unit" }));
    } else {
      parts.field = element("input", { id, type: "text", spellcheck: "false", autocomplete: "off", "aria-describedby": mistake.id });
      this.listen(path, parts);
      const tail = element("span", { class: "unit" }, unit);
      line.append(parts.field, tail);
    }
    this.rows.set(path, parts);
    return [line, mistake];
  }

  listen(path, parts) {
    const { field } = parts;
    field.addEventListener("focus", () => field.select());
    field.addEventListener("input", () => (parts.typing = true));
    field.addEventListener("change", () => this.edit(path, parts));
    field.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        parts.typing = false;
        parts.wrong = undefined;
        field.value = parts.text ?? "";
        this.say({ what: "edit", path, text: field.value });
      }
    });
  }

  edit(path, parts) {
    parts.typing = false;
    parts.asked = parts.field.value;
    this.say({ what: "edit", path, text: parts.field.value });
  }

  show(fields, mistakes) {
    for (const [path, parts] of this.rows) {
      const [text, position, other] = fields[path] ?? ["", null, ""];
      const sentence = mistakes[path] ?? "";
      if (parts.text !== text || parts.sentence !== sentence || parts.position !== position) {
        parts.text = text;
        parts.position = position;
        // a field that is being written or was refused keeps what its writer wrote
        const refused = sentence && parts.asked !== undefined;
        if (!parts.typing && !refused) {
          if (parts.field.value !== text) parts.field.value = text;
          parts.asked = undefined;
        }
        if (parts.slider && document.activeElement !== parts.slider) parts.slider.value = position;
        else if (parts.slider && !sentence && Number(parts.slider.value) === position) parts.slider.value = position;
        if (parts.slider) parts.slider.style.setProperty("--share", `${(100 * parts.slider.value) / STEPS}%`);
        if (parts.slider) parts.slider.setAttribute("aria-valuetext", other ? `${text}, ${other}` : text);
        parts.other.textContent = other;
        parts.other.title = other;
      }
      if (parts.sentence !== sentence) {
        parts.sentence = sentence;
        parts.mistake.textContent = sentence;
        parts.mistake.hidden = !sentence;
        parts.line.classList.toggle("wrong", Boolean(sentence));
        parts.field.setAttribute("aria-invalid", String(Boolean(sentence)));
        if (!sentence && !parts.typing) {
          parts.asked = undefined;
          parts.field.value = text;
        }
      }
    }
  }
}
