"""`continue` of Python in a language without it: what follows goes into the other branch."""

from __future__ import annotations

from dataclasses import replace

from softstart.export.statements import For, If, Leave, Return, Statement, Unary, While

GO_ON = Leave("continue")
Body = tuple[Statement, ...]


def without_continue(body: Body) -> Body:
    """The same statements without `continue`.

    >>> from softstart.export.statements import Constant, Variable
    >>> skips, stop = If(Variable("skip", "truth"), (GO_ON,)), Leave("break")
    >>> loop = While(Constant(True, "truth"), (skips, stop))
    >>> without_continue((loop,))[0].body
    (If(condition=Unary(operator='not', operand=Variable(name='skip', type='truth'), type='truth'),
        body=(Leave(word='break'),), otherwise=()),)
    """
    return tuple(_plain(statement) for statement in body)


def _plain(statement: Statement) -> Statement:
    match statement:
        case For() | While():
            return replace(statement, body=_to_the_end(without_continue(statement.body)))
        case If(condition, body, otherwise):
            return If(condition, without_continue(body), without_continue(otherwise))
        case _:
            return statement


def _to_the_end(body: Body) -> Body:
    """The body of a loop, or its last part; what follows a branch that may go on is done in both."""
    for k, statement in enumerate(body):
        if statement == GO_ON:
            return body[:k]
        if isinstance(statement, If) and _goes_on((statement,)):
            rest = body[k + 1 :]
            done = _to_the_end(statement.body if _leaves(statement.body) else statement.body + rest)
            other = statement.otherwise
            other = _to_the_end(other if _leaves(other) else other + rest)
            if not done and other:
                return (*body[:k], If(Unary("not", statement.condition, "truth"), other))
            return (*body[:k], If(statement.condition, done, other))
    return body


def _goes_on(body: Body) -> bool:
    """Whether a `continue` of this loop is in it."""
    return any(
        statement == GO_ON
        or (isinstance(statement, If) and (_goes_on(statement.body) or _goes_on(statement.otherwise)))
        for statement in body
    )


def _leaves(body: Body) -> bool:
    """Whether nothing behind it is reached."""
    if not body:
        return False
    last = body[-1]
    if isinstance(last, If):
        return _leaves(last.body) and _leaves(last.otherwise)
    return isinstance(last, Leave | Return)
