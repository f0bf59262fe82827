// Undo and redo: two buttons, and the usual keys outside of a field that is being written.
import { element } from "./numbers.js";

const STEPS = [["undo", "\u21b6", "Ctrl+Z"], ["redo", "\u21b7", "Ctrl+Shift+Z or Ctrl+Y"]];

export class Steps {
  constructor(place, say) {
    this.say = say;
    this.buttons = STEPS.map(([what, sign, keys]) => {
      const title = what[0].toUpperCase() + what.slice(1);
      const button = element("button", { type: "button", title: `${title} (${keys})`, "aria-label": title, disabled: true }, sign);
      button.addEventListener("click", () => say({ what }));
      place.append(button);
      return button;
    });
    this.keys = (event) => this.press(event);
    window.addEventListener("keydown", this.keys);
  }

  // the browser's own undo works in a text that was changed and not yet sent
  press(event) {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || event.altKey || !["z", "y"].includes(key)) return;
    const field = document.activeElement;
    const text = field?.matches("textarea, input:not([type=range], [type=radio], [type=checkbox])");
    if (text && (!field.closest(".fields") || "writing" in field.dataset)) return;
    event.preventDefault();
    this.say({ what: key === "y" || event.shiftKey ? "redo" : "undo" });
  }

  show(counts) {
    this.buttons.forEach((button, index) => (button.disabled = !counts[index]));
  }

  end() {
    window.removeEventListener("keydown", this.keys);
  }
}
