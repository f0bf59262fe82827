// A pen that writes SVG: what the plots draw on a canvas, they can draw into a file.
const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
const round = (value) => Math.round(value * 100) / 100;
const ANCHORS = { left: "start", center: "middle", right: "end" };

export class SvgPen {
  constructor(width, height, measure, paper) {
    Object.assign(this, { width, height, measure, parts: [], clips: 0, depth: [0], path: "", dash: [] });
    Object.assign(this, { fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, globalAlpha: 1, textAlign: "left", textBaseline: "alphabetic" });
    this.fillStyle = paper;
    this.fillRect(0, 0, width, height);
  }

  // fonts are measured where they are drawn
  set font(font) {
    this.measure.font = this.face = font;
  }

  get font() {
    return this.face;
  }

  measureText(text) {
    return this.measure.measureText(text);
  }

  setLineDash(dash) {
    this.dash = dash;
  }

  beginPath() {
    this.path = "";
  }

  moveTo(x, y) {
    this.path += `M${round(x)} ${round(y)}`;
  }

  lineTo(x, y) {
    this.path += `L${round(x)} ${round(y)}`;
  }

  rect(x, y, w, h) {
    this.path += `M${round(x)} ${round(y)}h${round(w)}v${round(h)}h${round(-w)}z`;
  }

  // whole circles only
  arc(x, y, r) {
    this.path += `M${round(x + r)} ${round(y)}a${r} ${r} 0 1 1 ${-2 * r} 0a${r} ${r} 0 1 1 ${2 * r} 0z`;
  }

  stroke() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.join(" ")}"` : "";
    this.parts.push(`<path d="${this.path}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}" stroke-linejoin="round"${dash}/>`);
  }

  fill() {
    this.parts.push(`<path d="${this.path}" fill="${this.fillStyle}"/>`);
  }

  fillRect(x, y, w, h) {
    this.parts.push(`<rect x="${round(x)}" y="${round(y)}" width="${round(w)}" height="${round(h)}" fill="${this.fillStyle}" fill-opacity="${this.globalAlpha}"/>`);
  }

  strokeRect(x, y, w, h) {
    this.beginPath();
    this.rect(x, y, w, h);
    this.stroke();
  }

  fillText(text, x, y) {
    const lower = this.textBaseline === "middle" ? 4 : 0;
    this.parts.push(`<text x="${round(x)}" y="${round(y + lower)}" text-anchor="${ANCHORS[this.textAlign]}" fill="${this.fillStyle}">${escaped(text)}</text>`);
  }

  save() {
    this.depth.push(0);
  }

  clip() {
    this.clips += 1;
    this.parts.push(`<clipPath id="clip-${this.clips}"><path d="${this.path}"/></clipPath><g clip-path="url(#clip-${this.clips})">`);
    this.depth[this.depth.length - 1] += 1;
  }

  restore() {
    this.parts.push("</g>".repeat(this.depth.pop()));
  }

  text(title) {
    const { width, height, face } = this;
    const size = /([\d.]+)px (.*)/.exec(face);
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" font-family="${escaped(size[2])}" font-size="${size[1]}"><title>${escaped(title)}</title>
${this.parts.join("\n")}
</svg>
`;
  }
}
