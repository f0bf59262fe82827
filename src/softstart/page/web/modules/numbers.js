// Numbers as the page writes them: a fixed count of digits, a real minus sign, a dash where there is none.
export const NONE = "\u2013";

export function fixed(value, digits) {
  if (value === null || value === undefined || Number.isNaN(value)) return NONE;
  return value.toFixed(digits).replace("-", "\u2212");
}

export function significant(value, digits) {
  if (value === null || value === undefined || Number.isNaN(value)) return NONE;
  if (value === 0) return "0";
  const before = Math.floor(Math.log10(Math.abs(value))) + 1;
  return value.toFixed(Math.min(Math.max(digits - before, 0), 9)).replace("-", "\u2212");
}

// round steps for an axis: about `count` ticks of 1, 2 or 5 times a power of ten
export function ticks(low, high, count) {
  const span = high - low;
  if (!(span > 0)) return [low];
  const raw = span / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) found.push(i * step);
  found.digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return found;
}

export function label(value, digits) {
  return (Math.abs(value) < 1e-12 ? 0 : value).toFixed(digits).replace("-", "\u2212");
}

// a range that stays while the data fit it well, so that axes do not tremble under a moving hand
export class Range {
  constructor() {
    this.low = 0;
    this.high = 0;
  }

  fit(low, high, room = 0.06, parts = 5) {
    const span = high - low || Math.abs(high) || 1;
    const used = span / (this.high - this.low);
    if (low >= this.low && high <= this.high && used > 0.62) return this;
    const wide = span * (1 + 2 * room);
    const power = 10 ** Math.floor(Math.log10(wide / parts));
    const step = [1, 2, 2.5, 5, 10].map((f) => f * power).find((s) => s >= wide / parts);
    this.low = low === 0 ? 0 : Math.floor((low - span * room * 0.5) / step + 1e-9) * step;
    this.high = Math.ceil((high + span * room) / step - 1e-9) * step;
    return this;
  }
}

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") made.className = value;
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

// a canvas as sharp as the screen, in CSS pixels; null while it has no size
export function sharp(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas.parentElement;
  if (!width || !height) return null;
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

// a whole number as a subscript
export const below = (number) => String(number).replace(/\d/g, (digit) => "\u2080\u2081\u2082\u2083\u2084\u2085\u2086\u2087\u2088\u2089"[digit]);
