// The shaft at which values are shown: that of the motor, or the output of the gear.
import { element } from "./numbers.js";

export class Shaft {
  constructor(place, say) {
    this.asked = -1; // stamp of what was pressed last
    this.buttons = ["motor", "output"].map((name) => {
      const input = element("input", { type: "radio", name: "shaft", value: name, onchange: () => (this.asked = say({ what: "show_at", output: name === "output" })) });
      place.append(element("label", {}, input, element("span", {}, name)));
      return input;
    });
    this.place = place;
  }

  show({ at, no_output: reason, stamp }) {
    this.buttons[1].disabled = Boolean(reason);
    this.place.title = reason || "Torques, speeds, angles, stiffness and inertias of shaft and load, at the motor shaft or at the output of the gear; the motor and the strategy stay at the motor shaft";
    if (this.asked > stamp) return;
    this.asked = -1;
    this.buttons.forEach((button, index) => (button.checked = Boolean(at) === Boolean(index)));
  }
}
