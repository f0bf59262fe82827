"""Templates of sentences with named values, and those that stand apart from where they are shown."""

from __future__ import annotations


def said(template: str, /, **values: object) -> str:
    """The sentence of a template with its values.

    >>> said("{name} takes {time:.2f} s", name="ramp", time=0.4567)
    'ramp takes 0.46 s'
    """
    return template.format(**values) if values else template


def later(template: str, /) -> str:
    """The template itself, to be said where it is shown."""
    return template
