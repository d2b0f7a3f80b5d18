"""Formats of logs, a file each: a module here that defines `ENTRY` is one."""
