// The drive in one line: motor, shaft, gap, load.
export function scheme() {
  const holder = document.createElement("div");
  holder.className = "scheme";
  holder.innerHTML = `
<svg viewBox="0 0 328 62" role="img" aria-label="Motor inertia J1, shaft of stiffness c and damping d, gap, load inertia J2">
  <g fill="none" stroke="currentColor" stroke-width="1.4">
    <rect class="motor" x="34" y="10" width="46" height="42" rx="2"/>
    <rect class="load" x="236" y="6" width="50" height="50" rx="2"/>
    <path d="M80 31h16l3 -8 6 16 6 -16 6 16 6 -16 3 8h16v0"/>
    <path d="M142 31h14"/>
    <path stroke-width="3.4" d="M157 19v24"/>
    <path d="M236 31h-30v-17h-72"/>
    <path stroke-width="2.4" d="M134 14v10M206 14v34M134 38v10"/>
    <path d="M134 48h72" stroke-dasharray="1 5"/>
    <path class="motor-line" d="M22 45a17 17 0 0 1 0 -28m-6 3l6 -3 2 7"/>
    <path class="load-line" d="M298 17a17 17 0 0 1 0 28m6 -3l-6 3 -2 -7"/>
  </g>
  <g fill="currentColor" font-size="11" text-anchor="middle">
    <text x="57" y="35" font-style="italic">J\u2081</text><text x="261" y="35" font-style="italic">J\u2082</text>
    <text x="111" y="55" font-style="italic">c, d</text><text x="182" y="44" font-style="italic">\u03b4</text>
    <text x="8" y="35" font-style="italic">u</text><text x="317" y="35" font-style="italic">Mc</text>
  </g>
</svg>`;
  return holder;
}
