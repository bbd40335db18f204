"""Templates that people write: how deep they may nest before they are compiled."""

import jinja2
from jinja2 import nodes

DEEPEST = 60
"""Python, into which a template is compiled, takes seconds for some hundred signs in a row."""


def compiled(environment: jinja2.Environment, text: str) -> jinja2.Template:
    """Compile a template; raises jinja2.TemplateError, for one that nests too deeply as well."""
    waiting: list[tuple[nodes.Node, int]] = [(environment.parse(text), 0)]
    while waiting:
        node, depth = waiting.pop()
        if depth > DEEPEST:
            raise jinja2.TemplateSyntaxError(f"it nests deeper than {DEEPEST} levels", node.lineno)
        waiting += [(child, depth + 1) for child in node.iter_child_nodes()]
    return environment.from_string(text)
