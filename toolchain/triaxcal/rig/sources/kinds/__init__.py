"""Signal sources of the bench, a file each; `triaxcal.rig.sources.source` has what they share."""
