"""One VISA resource, by PyVISA; its errors in one line."""

from __future__ import annotations

from typing import Any

from triaxcal.base.errors import RefusedError


class Visa:
    """An open resource; every call ends within the time-out.

    Parameters
    ----------
    library : str
        "@py" for pyvisa-py, "" for the maker's, a path with "@sim" for the simulation.
    end : str
        End of a line, sent and expected.
    """

    def __init__(self, resource: str, library: str, end: str, timeout_s: float) -> None:
        import pyvisa  # noqa: PLC0415  optional

        self.name = resource
        self._timeout_s = timeout_s
        options: dict[str, Any] = {"read_termination": end, "write_termination": end}
        try:
            self._manager = pyvisa.ResourceManager(library)
            self._resource: Any = self._manager.open_resource(
                resource, open_timeout=round(1000 * timeout_s), **options
            )
            self._resource.timeout = round(1000 * timeout_s)
        except Exception as error:  # each library raises what its maker chose
            raise RefusedError(resource, f"cannot be opened: {_first_line(error)}") from error

    def write(self, text: str) -> None:
        """Send a text.

        Raises
        ------
        RefusedError
            When the instrument does not take it in time.
        """
        try:
            self._resource.write(text)
        except Exception as error:
            raise self._refusal(text, error) from error

    def read(self) -> str:
        """Next line that the instrument sends by itself.

        Raises
        ------
        RefusedError
            When none comes in time.
        """
        try:
            return str(self._resource.read())
        except Exception as error:
            raise self._refusal("read", error) from error

    def query(self, text: str) -> str:
        """Answer to a text.

        Raises
        ------
        RefusedError
            When none comes in time.
        """
        try:
            return str(self._resource.query(text))
        except Exception as error:
            raise self._refusal(text, error) from error

    def close(self) -> None:
        """Close the resource."""
        self._resource.close()

    def _refusal(self, text: str, error: Exception) -> RefusedError:
        late = "timeout" in str(error).lower()
        found = f"within {self._timeout_s:g} s" if late else f": {_first_line(error)}"
        return RefusedError(f"{self.name}, {text}", f"no answer {found}".replace(" :", ":"))


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
