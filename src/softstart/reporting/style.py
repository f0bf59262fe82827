"""The look of a report: light paper on any screen, A4 in print. Nothing in it loads anything."""

from __future__ import annotations

from softstart.reporting.markup import css_string

_CSS = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
html { background: #e9ecef; }
body { margin: 0; color: #1b1f24; background: #e9ecef; line-height: 1.5;
  font: 15px/1.5 "Segoe UI", "Helvetica Neue", Helvetica, Arial, "DejaVu Sans", sans-serif; }
main { max-width: 60rem; margin: 2rem auto; padding: 2.5rem 3.5rem 3rem; background: #fff;
  box-shadow: 0 1px 6px rgb(0 0 0 / 18%); }
h1 { font-size: 1.75rem; line-height: 1.2; margin: .2rem 0 .3rem; overflow-wrap: anywhere; }
h2 { font-size: 1.3rem; margin: 2.6rem 0 .7rem; padding-bottom: .25rem; border-bottom: 2px solid #0072b2; }
h3 { font-size: 1.05rem; margin: 1.6rem 0 .5rem; }
p, ul { margin: .6rem 0; max-width: 50rem; }
a { color: #00598c; }
.kind { margin: 0; color: #5a6570; letter-spacing: .04em; }
.made { margin: 0 0 1.2rem; color: #5a6570; }
.answer { padding: 1rem 1.3rem .9rem; background: #eef5fa; border-left: 4px solid #0072b2; }
.answer p { margin: 0; font-size: 1.06rem; max-width: none; }
.tiles { display: grid; grid-template-columns: repeat(4, 1fr); gap: .8rem; margin: 1rem 0; padding: 0; }
.tiles div { border: 1px solid #cfd6dc; padding: .55rem .8rem .6rem; }
.tiles dt { font-size: .82rem; color: #5a6570; }
.tiles dd { margin: 0; font-size: 1.3rem; font-weight: 600; font-variant-numeric: tabular-nums; }
.tiles dd small { display: block; font-size: .8rem; font-weight: 400; color: #5a6570; }
nav ol { columns: 2; margin: .3rem 0 0; padding-left: 1.4rem; }
.wide { overflow-x: auto; margin: .9rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .88rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .3rem; }
th, td { padding: .28rem .55rem; border-bottom: 1px solid #dde2e6; vertical-align: top; text-align: left;
  font-weight: 400; overflow-wrap: break-word; }
thead th { border-bottom: 1.5px solid #5a6570; vertical-align: bottom; font-weight: 600; line-height: 1.25; }
.number { text-align: right; white-space: nowrap; }
thead .number { white-space: normal; }
table.names tbody th { min-width: 11.5em; }
tr.strong th, tr.strong td { font-weight: 700; background: #eef5fa; }
table.words td { font-size: .95em; }
ul.notes { font-size: .88rem; color: #3a434b; padding-left: 1.2rem; }
figure { margin: 1.2rem 0; }
figure svg { display: block; width: 100%; height: auto; }
figure svg.plot * { stroke-linejoin: round; stroke-linecap: butt; }
figcaption { font-size: .88rem; color: #3a434b; margin-top: .4rem; max-width: 50rem; }
pre { background: #f5f6f7; border: 1px solid #dde2e6; padding: .7rem .9rem; font: .8rem/1.4
  "DejaVu Sans Mono", Consolas, Menlo, monospace; white-space: pre-wrap; overflow-wrap: anywhere; }
@media screen and (max-width: 50rem) { main { padding: 1.2rem; margin: 0; }
  .tiles { grid-template-columns: 1fr 1fr; } }
@page { size: A4; margin: 19mm 16mm 17mm;
  @top-left { content: HEADER; font: 8pt Helvetica, Arial, sans-serif; color: #5a6570; }
  @top-right { content: "softstart report"; font: 8pt Helvetica, Arial, sans-serif; color: #5a6570; }
  @bottom-left { content: FOOTER; font: 8pt Helvetica, Arial, sans-serif; color: #5a6570; }
  @bottom-right { content: counter(page) " / " counter(pages); font: 8pt Helvetica, Arial, sans-serif;
    color: #5a6570; } }
@media print {
  html, body { background: #fff; font-size: 9.6pt; }
  main { max-width: none; margin: 0; padding: 0 1px; box-shadow: none; }
  h2 { margin-top: 7mm; } h1, h2, h3, caption, .lead { break-after: avoid; }
  figure, tr, .answer, .tiles, nav, section.sheet > .wide, pre { break-inside: avoid; }
  .page { break-before: page; } .page > h2 { margin-top: 0; }
  section.sheet ul { break-before: avoid; }
  ul.notes { break-inside: avoid; }
  p, ul, figcaption { max-width: none; orphans: 3; widows: 3; }
  thead { display: table-header-group; } .wide { overflow: visible; }
  a { color: inherit; text-decoration: none; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
"""
LONGEST = 70  # letters of a name in the head of a page


def style(header: str, footer: str) -> str:
    """The style sheet with what stands at the head and the foot of each printed page."""
    header = header if len(header) <= LONGEST else header[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return _CSS.replace("HEADER", css_string(header)).replace("FOOTER", css_string(footer))
