// The figure that stands large: K_dyn of the selected strategy, and the facts about its start.
import { button, element, fixed, put, significant } from "./numbers.js";

const FACTS = [
  ["start time", "s", (f) => fixed(f.start_time, 4)],
  ["later", "s", (f) => fixed(f.settled_lost, 4)],
  ["overshoot", "%", (f) => fixed(f.overshoot, 1)],
  ["peak torque", "N m", (f) => significant(f.peak_torque, 5)],
  ["at the output", "N m", (f) => significant(f.output_torque, 5)],
  ["mean torque", "N m", (f) => significant(f.base, 5)],
  ["first impact", "", (f) => significant(f.impact_speed, 4)],
  ["contacts", "", (f) => String(f.contacts ?? "\u2013")],
];

export class Figure {
  constructor(place, say) {
    this.name = element("div", { class: "name" });
    const keep = button("Keep as reference", "Keep this start drawn, as a wide grey line, while drive and strategies change", () => say({ what: "reference", on: true }), { class: "keep", "aria-label": null });
    this.value = element("output", { class: "k-dyn", id: "k-dyn", "aria-live": "off" });
    this.status = element("div", { class: "status", role: "status" });
    this.facts = FACTS.map(([label, unit]) => element("div", {}, element("dt", {}, label), element("dd"), element("dd", { class: "unit" }, unit)));
    const head = element("div", { class: "head" }, element("div", { class: "caption" }, "K", element("sub", {}, "dyn")), this.value);
    place.append(element("div", { class: "of" }, this.name, keep), head, element("dl", {}, ...this.facts), this.status);
  }

  show(figure) {
    this.figure = figure;
    this.value.textContent = fixed(figure.k_dyn, 3);
    this.value.dataset.value = figure.k_dyn ?? "";
    this.value.classList.toggle("none", figure.k_dyn === null);
    put(this.name, figure.name);
    FACTS.forEach(([label, , text], index) => {
      const [, value, unit] = this.facts[index].children;
      put(value, text(figure));
      if (label === "first impact") put(unit, figure.speed_unit);
      if (/^(peak|mean)/.test(label)) put(unit, figure.torque_unit);
      if (label === "overshoot") this.facts[index].hidden = figure.overshoot == null; // of a torque strategy
      if (label === "at the output") this.facts[index].hidden = figure.output_torque == null; // where no gear is known
    });
    this.tell();
  }

  // how the start ended; after it a mistake that belongs to no field
  tell(mistake = this.mistake) {
    this.mistake = mistake;
    const { reached, position, status } = this.figure ?? { reached: true };
    put(this.status, [reached ? position : status, mistake].filter(Boolean).join(" "));
    this.status.classList.toggle("wrong", Boolean(!reached || mistake));
  }
}
