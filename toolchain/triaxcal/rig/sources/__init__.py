"""Signal sources of the bench, a file each; `triaxcal.rig.source` has what they share."""
