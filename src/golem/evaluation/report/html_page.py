"""Pages by jinja2, which the extra `report` brings: each is one file that needs no server and no script."""

from __future__ import annotations

from importlib import resources
from typing import Any

from golem.errors import MissingExtra


def render_page(template: str, facts: dict[str, str], **values: Any) -> str:
    """Return the page that a template of `templates/` makes of `values`, with `facts` of its provenance at the end.

    Raises:
        MissingExtra: jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined
    except ImportError as error:
        raise MissingExtra("jinja2", "report") from error
    css = resources.files("golem.evaluation.report").joinpath("report.css").read_text(encoding="utf-8")
    loader = PackageLoader("golem.evaluation.report")
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return pages.get_template(template).render(css=css, facts=facts, **values)
