// Light and dark: follows the system unless told otherwise; the choice stays in this browser.
import { element, stored } from "./numbers.js";

const CHOICES = [["auto", "Auto"], ["light", "Light"], ["dark", "Dark"]];
const KEY = "softstart-colours";

export class Theme {
  constructor(place, changed) {
    this.changed = changed;
    this.buttons = CHOICES.map(([choice, text]) => {
      const input = element("input", { type: "radio", name: "theme", value: choice, onchange: () => this.choose(choice) });
      place.append(element("label", {}, input, element("span", {}, text)));
      return input;
    });
    const kept = stored("localStorage", KEY);
    this.observer = new MutationObserver(() => this.read());
    this.observer.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    this.choose(CHOICES.some(([choice]) => choice === kept) ? kept : "auto");
  }

  choose(choice) {
    for (const button of this.buttons) button.checked = button.value === choice;
    stored("localStorage", KEY, choice);
    window.Quasar?.Dark.set(choice === "auto" ? "auto" : choice === "dark");
    this.read();
  }

  read() {
    this.dark = document.body.classList.contains("body--dark");
    const style = getComputedStyle(document.body);
    const names = ["font", "ink", "quiet", "line", "kept", "grid", "paper", "shade", "accent", "warn"];
    this.colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    this.font = this.colours.font;
    this.changed();
  }

  // of its colours on light and on dark paper, as the server tells them
  strategy(colours = []) {
    return colours[this.dark ? 1 : 0];
  }

  end() {
    this.observer.disconnect();
  }
}
