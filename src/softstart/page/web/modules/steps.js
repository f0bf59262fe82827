// Undo and redo: two buttons, and the usual keys outside of a field that is being written.
import { button } from "./numbers.js";

export class Steps {
  constructor(place, say) {
    this.say = say;
    const step = (what, title, sign, keys) => button(sign, `${title} (${keys})`, () => say({ what }), { "aria-label": title, disabled: true });
    this.buttons = [step("undo", "Undo", "\u21b6", "Ctrl+Z"), step("redo", "Redo", "\u21b7", "Ctrl+Shift+Z or Ctrl+Y")];
    place.append(...this.buttons);
    window.addEventListener("keydown", (this.keys = (event) => this.press(event)));
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
    this.buttons.forEach((one, index) => (one.disabled = !counts[index]));
  }

  end() {
    window.removeEventListener("keydown", this.keys);
  }
}
