// Numbers as the page writes them: a fixed count of digits, a real minus sign, a dash where there is none.
// And what every part builds with: elements, a sharp canvas.
const written = (value, digits) => value.toFixed(digits).replace("-", "\u2212");
const known = (value) => value !== null && value !== undefined && !Number.isNaN(value);

export const fixed = (value, digits) => (known(value) ? written(value, digits) : "\u2013");

export function significant(value, digits) {
  if (!value) return value === 0 ? "0" : "\u2013";
  const before = Math.floor(Math.log10(Math.abs(value))) + 1;
  return written(value, Math.min(Math.max(digits - before, 0), 9));
}

// about `count` round steps of an axis, of 1, 2 or 5 times a power of ten; with `beyond` they enclose both ends
export function ticks(low, high, count, beyond = false) {
  const span = high - low || Math.abs(high) || 1;
  const raw = span / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * 0.999);
  const [first, last] = beyond ? [Math.floor(low / step + 1e-9), Math.ceil(high / step - 1e-9)] : [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
  const found = [];
  for (let i = first; i <= last; i++) found.push(i * step);
  found.digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return found;
}

export const label = (value, digits) => written(Math.abs(value) < 1e-12 ? 0 : value, digits);

// a whole number as a subscript
export const below = (number) => String(number).replace(/\d/g, (digit) => String.fromCharCode(0x2080 + Number(digit)));

// attributes that are functions listen: `onclick` to clicks
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

export const button = (text, title, onclick, more = {}) => element("button", { type: "button", title, "aria-label": title, onclick, ...more }, text);

// what this browser keeps, after something new is kept in it; null where it keeps nothing
export function stored(storage, key, value) {
  try {
    if (value !== undefined) window[storage].setItem(key, value);
    return window[storage].getItem(key);
  } catch {
    return null;
  }
}

// what is written already is not written again: the browser would lay it out again
export function put(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

// the pen of a canvas as sharp as the screen, in CSS pixels, on a clean paper; null while it has no size
export function sharp(canvas, paper) {
  const { clientWidth: width, clientHeight: height } = canvas.parentElement;
  if (!width || !height) return null;
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    Object.assign(canvas, { width: w, height: h });
    Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = paper;
  pen.fillRect(0, 0, width, height);
  return { pen, width, height };
}

// a straight line
export function stroke(pen, [x0, y0], [x1, y1], colour, dash = [], thick = 1) {
  Object.assign(pen, { strokeStyle: colour, lineWidth: thick });
  pen.setLineDash(dash);
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
  pen.setLineDash([]);
}

export function write(pen, text, x, y, colour, align = "left", baseline = "alphabetic") {
  Object.assign(pen, { fillStyle: colour, textAlign: align, textBaseline: baseline });
  pen.fillText(text, x, y);
}
