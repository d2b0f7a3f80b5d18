"""Formats of recordings that need the rooms of the bench; `triaxcal.readings.format` finds them."""
