"""What the commands share: a unit's folder, the help's form, words on the screen."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from triaxcal.base.errors import RefusedError
from triaxcal.base.publish import renew
from triaxcal.base.screentext import wrapped

if TYPE_CHECKING:
    from triaxcal import Study

    _PathType = click.ParamType[Path]
    _WholeType = click.ParamType[int]
else:  # click before 8.4 has no such types
    _PathType = _WholeType = click.ParamType

UNITS = Path("units")
_WIDTHS = 60, 120
"""Columns of text: a narrower terminal breaks the lines itself, a longer line is hard to read."""


class UnitFolder(_PathType):
    """The folder of a unit, by its path or by its name in units/."""

    name = "unit"

    def __init__(self, files: bool = False) -> None:
        # `batch` skips files: units/* names them as well; `check` takes a calibration.json.
        self.files = files

    def convert(
        self, value: Any, _param: click.Parameter | None, _ctx: click.Context | None
    ) -> Path:
        """Folder `value`, or units/`value` where only that can be meant."""
        path = Path(value)
        if path.is_file() and not self.files:
            raise RefusedError(
                str(path), "a file", expected="the unit's folder", remedy=f"give {path.parent}"
            )
        is_name = len(path.parts) == 1 and path.name not in {"", ".."}
        return UNITS / path if is_name and not path.exists() and UNITS.is_dir() else path

    def shell_complete(
        self, _ctx: click.Context, _param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Names in units/; the shell adds the folders there are."""
        from triaxcal.unit.folder import list_units  # noqa: PLC0415

        names = [CompletionItem(n) for n in list_units(UNITS) if n.startswith(incomplete)]
        return names or [CompletionItem(incomplete, type="dir")]


class HexNumber(_WholeType):
    """A whole number, decimal or hexadecimal with 0x."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number."""
        try:
            return int(str(value), 0)
        except ValueError:
            self.fail(f"{value!r} is no whole number, as 4096 or 0x1000", param, ctx)


_UNIT = click.argument("unit", type=UnitFolder())


PICTURE = click.option("--picture", type=click.Path(path_type=Path), help="Also draw this SVG.")


def build_option(
    receives: str, default: str = "build"
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """--build: the folder for the results."""
    return click.option(
        "--build",
        type=click.Path(path_type=Path),
        default=Path(default),
        show_default=True,
        help=f"Folder that receives {receives}.",
    )


_BUILD = build_option("a folder of the unit's name")


def unit_and_build(command: Callable[..., Any]) -> Callable[..., Any]:
    """UNIT and --build."""
    return _UNIT(_BUILD(command))


DELIVERED = click.option(
    "--build",
    type=click.Path(path_type=Path),
    default=Path("build"),
    show_default=True,
    help="Folder with the delivered units.",
)


PREFIX = click.option(
    "--prefix", help="What names in the C begin with; default: that of unit.toml."
)


ARITHMETIC = click.option(
    "--arithmetic",
    help="Form of products: portable, limbs, thumb2, thumb1, high-words; default: unit.toml's.",
)


_OPTIONS = {
    "gravity_m_per_s2": "--gravity",
    "bias_drift_mg": "--bias-drift",
    "scale_drift_ppm": "--scale-drift",
    "axes_drift_micro_rad": "--axes-drift",
}


def _by_option(refusal: RefusedError) -> RefusedError:
    """The refusal of an argument of the API by the name of its option."""
    place = _OPTIONS.get(refusal.place, refusal.place)
    return type(refusal)(place, refusal.found, expected=refusal.expected, remedy=refusal.remedy)


def field_command(flag: str, words: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """UNIT, --build, a recording from the field by `flag`, its --layout and --gravity.

    A refusal names an argument of the API as its option.
    """
    options = (
        click.argument("unit", type=UnitFolder(files=True)),
        DELIVERED,
        click.option(flag, "recorded", required=True, type=click.Path(path_type=Path), help=words),
        click.option(
            "--layout",
            type=click.Path(path_type=Path),
            help="TOML file with the [recording] of the file, if it is not that of the unit.",
        ),
        click.option(
            "--gravity",
            "gravity_m_per_s2",
            type=float,
            help="Local gravity where it was recorded, m/s^2; default: that of the unit.",
        ),
    )

    def decorated(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function)
        def run(**given: Any) -> None:
            try:
                function(**given)
            except RefusedError as refusal:
                raise _by_option(refusal) from refusal

        return functools.reduce(lambda command, option: option(command), reversed(options), run)

    return decorated


class WithKinds(click.Command):
    """A command whose help lists what unit.toml can choose from."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Options, then a section for each registry."""
        from triaxcal.model.methods.registry import METHODS  # noqa: PLC0415
        from triaxcal.model.thermal.registry import THERMAL_FUNCTIONS  # noqa: PLC0415
        from triaxcal.readings.format import FORMATS  # noqa: PLC0415

        super().format_options(ctx, formatter)
        for title, rows in (
            ("Thermal functions, [thermal] model", [(e.name, e.doc) for e in THERMAL_FUNCTIONS]),
            ("Methods, [compensation] method", [(e.name, e.doc) for e in METHODS]),
            ("Formats of recordings, [recording] format", [(e.name, e.doc) for e in FORMATS]),
        ):
            with formatter.section(title):
                formatter.write_dl(rows)


HELP = {"help_option_names": ["-h", "--help"]}
command = functools.partial(click.command, context_settings=HELP)
"""As `click.command`; the help does not depend on what the command is started from."""


def example(*lines: str) -> str:
    """Epilog of a command's help: command lines that can be copied."""
    return "\b\nExample:\n" + "\n".join(f"  {line}" for line in lines)


def say(text: str) -> None:
    """Print text with its words wrapped to the terminal, to 80 columns if there is none."""
    narrow, wide = _WIDTHS
    click.echo(wrapped(text, min(max(shutil.get_terminal_size().columns, narrow), wide)))


def show(study: Study[Any], picture: Path | None = None) -> None:
    """Print the text of a study; write its picture, whole or not at all, where one is wanted."""
    if picture is not None:
        renew({picture.name: study.picture()}, picture.parent)
    say(study.summary)
