// The figure that stands large: K_dyn of the selected strategy, and the facts about its start.
import { element, fixed, significant } from "./numbers.js";

const FACTS = [
  ["start_time", "start time", "s", (f) => fixed(f.start_time, 4)],
  ["time_lost", "after direct", "s", (f) => fixed(f.time_lost, 4)],
  ["peak_torque", "peak torque", "N m", (f) => significant(f.peak_torque, 5)],
  ["output_torque", "at the output", "N m", (f) => significant(f.output_torque, 5)],
  ["base", "mean torque", "N m", (f) => significant(f.base, 5)],
  ["impact_speed", "first impact", "", (f) => significant(f.impact_speed, 4)],
  ["contacts", "contacts", "", (f) => (f.contacts ?? "\u2013").toString()],
];

export class Figure {
  constructor(place, say) {
    this.name = element("div", { class: "name" });
    const keep = element("button", { type: "button", class: "keep", title: "Keep this start drawn, as a wide grey line, while drive and strategies change" }, "Keep as reference");
    keep.addEventListener("click", () => say({ what: "reference", kept: true }));
    this.value = element("output", { class: "k-dyn", id: "k-dyn", "aria-live": "off" });
    this.status = element("div", { class: "status", role: "status" });
    this.facts = new Map();
    const list = element("dl");
    for (const [key, label, unit] of FACTS) {
      const value = element("dd", {}, "");
      this.facts.set(key, value);
      const of = element("dd", { class: "unit" }, unit);
      if (key === "impact_speed") this.speed = of;
      list.append(element("div", {}, element("dt", {}, label), value, of));
    }
    const head = element("div", { class: "head" }, element("div", { class: "caption" }, "K", element("sub", {}, "dyn")), this.value);
    place.append(element("div", { class: "of" }, this.name, keep), head, list, this.status);
  }

  show(figure) {
    this.value.textContent = fixed(figure.k_dyn, 3);
    this.value.dataset.value = figure.k_dyn ?? "";
    this.value.classList.toggle("none", figure.k_dyn === null);
    if (this.name.textContent !== figure.name) this.name.textContent = figure.name;
    for (const [key, , , text] of FACTS) {
      const place = this.facts.get(key);
      const shown = text(figure);
      if (place.textContent !== shown) place.textContent = shown;
    }
    this.facts.get("output_torque").parentElement.hidden = figure.output_torque == null; // where no gear is known
    if (figure.speed_unit && this.speed.textContent !== figure.speed_unit) this.speed.textContent = figure.speed_unit;
    this.said = figure.reached ? figure.position : figure.status;
    this.failed = !figure.reached;
    this.tell();
  }

  // a mistake that belongs to no field stands here, after how the start ended
  mistake(sentence) {
    this.wrong = sentence;
    this.tell();
  }

  tell() {
    const text = [this.said, this.wrong].filter(Boolean).join(" ");
    if (this.status.textContent !== text) this.status.textContent = text;
    this.status.classList.toggle("wrong", Boolean(this.failed || this.wrong));
  }
}
