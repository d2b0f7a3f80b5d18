"""What every fit uses: groups of readings, thermal functions, outliers, results."""
