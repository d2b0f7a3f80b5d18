"""Ways of end-to-end protection, a file each; `triaxcal.rig.protection` has what they share."""
