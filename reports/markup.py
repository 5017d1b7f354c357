"""The templates' environment, the same for every page: what is missing is an error, and all text is escaped."""

import re

import jinja2
from markupsafe import Markup, escape


def make_environment() -> jinja2.Environment:
    """Return the environment of `reports/templates`, with the filters `breakable` and `formula`."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("aliasbench.reports", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["breakable"] = breakable
    environment.filters["formula"] = formula
    return environment


def breakable(text: str) -> Markup:
    """Return text that may wrap after a colon or a comma, where names have their joints."""
    return Markup(re.sub(r"([:,])", r"\1<wbr>", str(escape(text))))


def formula(text: str) -> Markup:
    """Return a formula in which what follows an underscore is an index: J_std, Σ_y."""
    return Markup(re.sub(r"_([A-Za-z0-9]+)", r"<sub>\1</sub>", str(escape(text))))
