"""Formulas as MathML, which browsers draw by themselves: the pages load no script."""

from __future__ import annotations

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, object]:
    """Register the renderer of formulas under the name ``mathml``."""
    app.add_html_math_renderer(
        "mathml", inline_renderers=(write_inline, None), block_renderers=(write_block, None)
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def write_inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(_mathml(node.astext()))
    raise nodes.SkipNode


def write_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula on lines of its own, with an anchor if it has a label."""
    names = node["ids"]
    anchor = f' id="{names[0]}"' if names else ""
    formula = _mathml(node.astext(), as_block=True)
    writer.body.append(f'<div class="math"{anchor}>{formula}</div>\n')
    raise nodes.SkipNode


def _mathml(formula: str, *, as_block: bool = False) -> str:
    """Return a formula as MathML. Browsers draw dots that are marked as accents into letters such as q."""
    formula = formula.replace(r"\dots", r"\ldots")  # docutils knows the second only
    return str(tex2mathml(formula, as_block=as_block)).replace(' accent="true"', "")
