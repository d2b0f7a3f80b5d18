"""`python -m triaxcal` is the command `triaxcal`."""

from triaxcal.cli.entry import entry

entry()
