"""Pages to HTML: where the templates are, how they are rendered, and the hash of all that renders."""

from functools import cache
from importlib.metadata import version
from pathlib import Path

from jinja2 import FileSystemLoader, StrictUndefined

from pipeline.errors import OutsideError
from pipeline.files import sha256_file, sha256_of
from sitegen.language import marked, whole
from sitegen.pages import Page
from sitegen.templating import Pages, counted, said

_CODE = {".css", ".html", ".js", ".po", ".py", ".svg", ".toml"}


def find_templates() -> Path:
    """The folder of templates: in the installed package, or at the root of the checkout.

    Raises OutsideError when it is in neither place.
    """
    here = Path(__file__).resolve().parent
    for folder in (here / "templates", here.parent / "templates"):
        if (folder / "base.html").is_file():
            return folder
    raise OutsideError(f"{here}: the templates are missing. Install COOOLER again.")


def find_locale() -> Path:
    """The folder of the catalogues that pages are translated by."""
    return find_templates() / "locale"


@cache
def environment() -> Pages:
    """The jinja environment: everything escaped, an undefined name is an error; one a process."""
    made = Pages(
        loader=FileSystemLoader(find_templates()),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        extensions=["jinja2.ext.i18n"],
    )
    made.newstyle_gettext = True  # type: ignore[attr-defined]
    made.globals |= {"_": said, "gettext": said, "ngettext": counted}
    made.filters |= {"marked": marked, "whole": whole}
    return made


def render(page: Page, address: str) -> bytes:
    """The page with an empty place for the tree's hash.

    Its canonical link is under `address`, where the site will be seen, or the page itself.
    """
    context = page.make()
    canonical = f"{address}{page.path}" if address else page.path.rpartition("/")[2]
    template = environment().get_template(page.template)
    return template.render(page=context, shell=context.shell, canonical=canonical).encode()


@cache
def code_sha256() -> str:
    """Hash of everything but data that decides a page: this code, the templates, what renders them."""
    package = Path(__file__).resolve().parent
    folders = (package, package.parent / "pipeline", find_templates())
    files = sorted({path for folder in folders for path in folder.rglob("*") if path.suffix in _CODE})
    versions = [f"{name} {version(name)}" for name in ("jinja2", "markupsafe", "numpy", "plotly")]
    return sha256_of("\n".join([*map(sha256_file, files), *versions]).encode())
