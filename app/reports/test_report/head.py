"""Head of a report: who issues it, to whom, under which number, after which method."""

import datetime
from pathlib import Path
from typing import Final

import msgspec
import typst

from app.reports.test_report.blocks import Logo
from app.runs.errors import RunError
from config.files import config_directory, load_settings
from messages.i18n import N_

TITLE: Final = "Test report: dry friction by pullback"
METHOD: Final = (
    "Pullback test on a shaking stand, after “Experimental determination of dynamic coefficient of"
    " Amonton-Coulomb dry friction”; evaluation as under Procedure."
)
_LOGO_BYTES: Final = 2_000_000
_RASTER: Final = {".png": "png", ".jpg": "jpg", ".jpeg": "jpg"}


class LogoError(RunError):
    """The logo of the laboratory cannot be printed."""


class ReportHead(msgspec.Struct, frozen=True, kw_only=True):
    """What a report says of itself. An empty number is made of the date and the hash of the inputs."""

    date: datetime.date
    title: str = TITLE
    number: str = ""
    laboratory: str = ""
    address: str = ""  # lines of it are parted by line breaks
    logo: Logo | None = None
    customer: str = ""
    method: str = METHOD

    def numbered(self, inputs_hash: str) -> "ReportHead":
        """The same with a number: the same runs, results and date have the same."""
        number = self.number or f"{self.date:%Y%m%d}-{inputs_hash[:8]}"
        return msgspec.structs.replace(self, number=number)


def read_head(date: datetime.date) -> ReportHead:
    """Head of a report with the laboratory of the personal settings. Raises ConfigError, LogoError."""
    settings = load_settings()
    return ReportHead(
        date=date,
        laboratory=settings.laboratory,
        address=settings.laboratory_address,
        logo=read_logo(settings.laboratory_logo),
    )


def read_logo(name: str) -> Logo | None:
    """Read a logo, PNG, JPEG or SVG; None without a name. Raises LogoError.

    A relative path is one in the folder of settings.
    """
    if not name:
        return None
    path = config_directory() / Path(name).expanduser()
    suffix = path.suffix.lower()
    if suffix not in (*_RASTER, ".svg"):
        raise LogoError(
            N_("laboratory_logo {path} is no picture that a report can print. Use PNG, JPEG or SVG"),
            path=path,
        )
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogoError(
            N_("laboratory_logo {path} cannot be read ({fault}). Correct it in settings.toml"),
            path=path,
            fault=error.strerror or error,
        ) from None
    logo = Logo(_RASTER.get(suffix, "svg"), list(data))
    if len(data) > _LOGO_BYTES or not _can_be_printed(logo):
        raise LogoError(
            N_("laboratory_logo {path} is damaged or larger than 2 MB. Give a sound PNG, JPEG or SVG"),
            path=path,
        )
    return logo


def _can_be_printed(logo: Logo) -> bool:
    page = b"#let logo = json(bytes(sys.inputs.logo))\n#image(bytes(logo.data), format: logo.format)"
    try:
        typst.compile(page, format="svg", sys_inputs={"logo": msgspec.json.encode(logo).decode()})
    except typst.TypstError:
        return False
    return True
