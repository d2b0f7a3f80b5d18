"""A Digital Calibration Certificate against PTB's schema, by lxml and without a network.

The schema files are not part of triaxcal. A folder of the user has them; what they import by web
address is taken from the same folder.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from triaxcal.base.errors import RefusedError, refused_by_system
from triaxcal.base.extras import refuse_missing_packages
from triaxcal.report.dcc.elements import DCC, SCHEMA

if TYPE_CHECKING:
    from lxml import etree

SCHEMA_FILES = ("dcc.xsd", "SI_Format.xsd", "xmldsig-core-schema.xsd")
"""The DCC's own schema, and what it imports: D-SI, and signatures."""
EXTRA = "sign"


def parsed(content: bytes, where: str) -> etree._Element:
    """Root of an XML document; entities and anything outside the document are not read.

    Raises
    ------
    RefusedError
        When it is no XML or has a document type, lxml is missing, or its root is no certificate.
    """
    refuse_missing_packages(where, ("lxml",), EXTRA)
    from lxml import etree  # noqa: PLC0415  optional

    try:
        root = etree.fromstring(content, _parser())
    except (etree.XMLSyntaxError, ValueError) as error:
        raise RefusedError(
            where,
            f"not XML: {str(error).partition(' (<string>')[0]}",
            expected="a Digital Calibration Certificate",
        ) from None
    if root.getroottree().docinfo.doctype:
        raise RefusedError(
            where, "has a document type (DOCTYPE)", expected="a certificate, which has none"
        )
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        found = str(root.tag)[:80]
        raise RefusedError(where, f"is <{found}>", expected=f"a certificate of {DCC}")
    return root


def _parser(resolver: Any = None) -> Any:
    from lxml import etree  # noqa: PLC0415  optional

    # Comments stay: a signature covers the document as it is.
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    if resolver is not None:
        parser.resolvers.add(resolver)
    return parser


def schema_faults(content: bytes, folder: Path, where: str) -> tuple[str, ...]:
    """What in a certificate breaks the schema, with its line; nothing when it is valid.

    Parameters
    ----------
    content : bytes
        The certificate.
    folder : Path
        Has `SCHEMA_FILES`.
    where : str
        The certificate, for messages.

    Raises
    ------
    RefusedError
        When the file is no certificate or states another version of the schema, or a schema file
        is missing or of another version.
    """
    root = parsed(content, where)
    version = root.get("schemaVersion")
    if version != SCHEMA:
        raise RefusedError(
            f"{where}, schemaVersion", f"found {version!r}", expected=f"{SCHEMA!r}",
            remedy="only certificates of this version are checked",
        )  # fmt: skip
    schema = _schema(folder)
    schema.validate(root)
    return tuple(f"line {e.line}: {e.message}" for e in schema.error_log)


def _schema(folder: Path) -> etree.XMLSchema:
    from lxml import etree  # noqa: PLC0415  optional

    missing = [name for name in SCHEMA_FILES if not (folder / name).is_file()]
    if missing:
        raise RefusedError(
            str(folder),
            f"without the schema {', '.join(missing)}",
            expected=f"a folder with {', '.join(SCHEMA_FILES)} for version {SCHEMA}",
            remedy="PTB and W3C publish them; nothing was checked",
        )

    class Beside(etree.Resolver):  # type: ignore[misc]  # lxml has no types
        """Takes every import from the folder, by the last part of its address."""

        def resolve(self, url: str, _public_id: str, context: Any) -> Any:
            path = folder / url.rpartition("/")[2]
            if path.name not in SCHEMA_FILES:
                raise RefusedError(str(folder), f"imports {url}", expected=f"{SCHEMA_FILES}")
            return self.resolve_string(path.read_bytes(), context, base_url=url)

    try:
        document = etree.parse(str(folder / SCHEMA_FILES[0]), _parser(Beside()))
        if document.getroot().get("version") != SCHEMA:
            found = document.getroot().get("version")
            raise RefusedError(
                f"{folder / SCHEMA_FILES[0]}, version", f"found {found!r}", expected=f"{SCHEMA!r}"
            )
        return etree.XMLSchema(document)
    except OSError as error:
        raise refused_by_system(folder, "read", error) from error
    except etree.LxmlError as error:
        raise RefusedError(
            str(folder), f"no schema: {error}", expected="the files as they are published"
        ) from None
