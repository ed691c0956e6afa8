"""How values and messages get into pages: jinja2's escaping and newstyle gettext, with less done for each.

Templates are compiled so that a name after a dot is an attribute and nothing else, that what is called is
called with what stands in the brackets (jinja's `pass_context` and its like are not known), and that text is
copied only where it has something to escape.
"""

import operator
from functools import lru_cache
from typing import Any

from jinja2 import Environment
from jinja2.compiler import CodeGenerator, Frame
from jinja2.nodes import Call, Expr, Getattr
from markupsafe import Markup, escape

from sitegen.language import gettext, ngettext


def shown(value: object) -> str:
    """The value as HTML, as `markupsafe.escape` gives it; plain text where that has nothing to escape.

    Most of what pages show is short text without a special character, for which a copy that is marked as
    safe would cost more than all else about it. What comes back is put out or joined, never escaped again.
    """
    kind = type(value)
    if kind is str:
        text: str = value  # type: ignore[assignment]
        if "&" in text or "<" in text or ">" in text or "'" in text or '"' in text:
            return escape(text)
        return text
    if kind is Markup:
        return value  # type: ignore[return-value]
    return str(value) if kind is int else escape(value)


@lru_cache(maxsize=1 << 12)
def _plain(message: str) -> Markup:
    """A message without values, as a page shows it: "%%" becomes "%"."""
    return Markup(message % {})  # noqa: S704 - messages are ours, and may hold elements


def said(message: str, /, **values: object) -> Markup:
    """A message of a template in the language of the page, its values escaped."""
    return _filled(gettext(message), values)


def counted(one: str, many: str, num: int, /, **values: object) -> Markup:
    """The form of a template's message for `num` things, its values escaped; `num` is one of them."""
    return _filled(ngettext(one, many, num), {"num": num} | values)


def _filled(message: str, values: dict[str, object]) -> Markup:
    if not values:
        return _plain(message)
    return Markup(message % {name: shown(value) for name, value in values.items()})  # noqa: S704


class _Code(CodeGenerator):
    """Jinja's compiler, whose output goes through `shown`."""

    def _output_child_pre(self, node: Expr, frame: Frame, finalize: CodeGenerator._FinalizeInfo) -> None:
        if frame.eval_ctx.volatile or not frame.eval_ctx.autoescape or finalize.src is not None:
            super()._output_child_pre(node, frame, finalize)
        else:
            self.write("environment.shown(")

    def visit_Call(  # noqa: N802 - jinja's names
        self, node: Call, frame: Frame, forward_caller: bool = False
    ) -> None:
        """A call without jinja's context in between."""
        self.write("environment.call(")
        self.visit(node.node, frame)
        self.signature(node, frame, {"caller": "caller"} if forward_caller else None)
        self.write(")")

    def visit_Getattr(self, node: Getattr, frame: Frame) -> None:  # noqa: N802
        """Python's attribute, never an item."""
        self.visit(node.node, frame)
        self.write(f".{node.attr}")


class Pages(Environment):
    """An environment whose templates are compiled so; everything in them is escaped."""

    code_generator_class = _Code
    shown = staticmethod(shown)
    call: Any = operator.call
