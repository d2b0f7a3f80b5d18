"""Formats of recordings, a file each: a module here that defines `ENTRY` is one."""
